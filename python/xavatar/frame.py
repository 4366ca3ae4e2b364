"""Frames of a subject."""

from __future__ import annotations

from dataclasses import dataclass

from .mesh import Mesh
from .pose import Pose


@dataclass(eq=False)
class Frame:
    """A scan with the body registered to it."""

    #: ``"train/Take1/f00001"``.
    name: str
    #: The scan in world coordinates.
    mesh: Mesh
    #: The registered body.
    pose: Pose
