"""Animatable human avatars: train them from scans, pose them, ask them, measure them.

    >>> import xavatar
    >>> avatar = xavatar.load("runs/demo")
    >>> mesh = avatar.pose({"left_shoulder": [0, 0, 0.7]})
    >>> mesh.vertices.shape, mesh.faces.shape

Metres, radians, Y up, facing +Z. Arrays are numpy's; torch is needed only where tensors are given. docs/python.md is the tour.
"""

from ._native import (
    Avatar,
    Body,
    FixedTopology,
    PosedBodies,
    Subject,
    __version__,
    evaluate,
    read_mesh,
    read_motion,
    register,
    train,
    write_built_in_subject,
)
from .errors import (
    ArgumentError,
    Error,
    FileError,
    FormatError,
    MissingError,
    RefusedError,
    TrainingError,
    UnfitError,
)
from .event import Event
from .frame import Frame
from .mesh import Mesh
from .motion import Motion
from .pose import Pose
from .samples import Samples

load = Avatar.load

__all__ = [
    "ArgumentError",
    "Avatar",
    "Body",
    "Error",
    "Event",
    "FileError",
    "FixedTopology",
    "FormatError",
    "Frame",
    "Mesh",
    "MissingError",
    "Motion",
    "Pose",
    "PosedBodies",
    "RefusedError",
    "Samples",
    "Subject",
    "TrainingError",
    "UnfitError",
    "__version__",
    "evaluate",
    "load",
    "read_mesh",
    "read_motion",
    "register",
    "train",
    "write_built_in_subject",
]
