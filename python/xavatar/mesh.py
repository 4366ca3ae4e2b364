"""Triangle meshes."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy

from . import _native


@dataclass(eq=False)
class Mesh:
    """A triangle mesh. V vertices, F faces; metres, Y up, faces counter-clockwise seen from outside."""

    #: Positions (V, 3), float32.
    vertices: numpy.ndarray
    #: Vertex indices (F, 3), uint32.
    faces: numpy.ndarray
    #: Unit vertex normals (V, 3), float32, outward.
    normals: numpy.ndarray | None = None
    #: Vertex colours (V, 3), uint8, sRGB.
    colours: numpy.ndarray | None = None
    #: Texture coordinates (V, 2), float32; v = 0 is the texture's first row.
    uvs: numpy.ndarray | None = None
    #: The texture (H, W, 3), uint8, sRGB.
    texture: numpy.ndarray | None = None

    def save(self, path: str | PathLike[str]) -> None:
        """Writes vertices, faces, normals and colours as a binary PLY file."""
        _native.write_mesh(path, self.vertices, self.faces, self.normals, self.colours)

    def __repr__(self) -> str:
        return f"<xavatar.Mesh of {len(self.vertices)} vertices, {len(self.faces)} faces>"
