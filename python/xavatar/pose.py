"""Poses of a skeleton."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy


def _zeros(count: int):
    return field(default_factory=lambda: numpy.zeros(count, numpy.float32))


@dataclass(eq=False)
class Pose:
    """A pose of a skeleton of J joints. Rotations are absolute: zero is the flat hand. Made into float32 arrays of its own."""

    #: The joints' rotations relative to their parents (J, 3): axis times angle, radians.
    rotations: numpy.ndarray
    #: Added to every vertex (3), metres.
    translation: numpy.ndarray = _zeros(3)
    #: Coefficients of expression; those that are left out are zero.
    expression: numpy.ndarray = _zeros(0)
    #: Coefficients of shape. An avatar has its own instead.
    shape: numpy.ndarray = _zeros(0)

    def __post_init__(self) -> None:
        for name in ("rotations", "translation", "expression", "shape"):
            setattr(self, name, numpy.array(getattr(self, name), numpy.float32))
        self.rotations = self.rotations.reshape(-1, 3)
