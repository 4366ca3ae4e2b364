"""Motions: poses that follow each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy

from .pose import Pose


@dataclass(eq=False)
class Motion:
    """T poses of one skeleton; ``for pose in motion`` gives them in turn."""

    #: The poses (T).
    poses: list[Pose]
    #: How fast they follow each other.
    frames_per_second: float
    #: What was read, detected, declared and changed, a line each.
    report: list[str]
    #: What may be wrong, a line each.
    warnings: list[str]

    @property
    def rotations(self) -> numpy.ndarray:
        """All rotations (T, J, 3), radians."""
        return numpy.stack([pose.rotations for pose in self.poses])

    @property
    def translations(self) -> numpy.ndarray:
        """All translations (T, 3), metres."""
        return numpy.stack([pose.translation for pose in self.poses])

    def __len__(self) -> int:
        return len(self.poses)

    def __iter__(self) -> Iterator[Pose]:
        return iter(self.poses)

    def __getitem__(self, frame: int) -> Pose:
        return self.poses[frame]
