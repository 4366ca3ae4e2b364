"""What an avatar's fields say of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy


@dataclass(eq=False)
class Samples:
    """The fields at N canonical points; J joints."""

    #: The geometry field (N), float32: a logit, positive inside, or metres to the surface, negative inside; the avatar's configuration says
    #: which, ``fields.representation``.
    values: numpy.ndarray
    #: Where the outside lies (N, 3), float32, of unit length; zero where there is no gradient.
    normals: numpy.ndarray
    #: Colours (N, 3), uint8, sRGB.
    colours: numpy.ndarray
    #: How much of each bone's motion a point follows (N, J), float32; rows sum to 1.
    weights: numpy.ndarray
