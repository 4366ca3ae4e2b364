"""Bodies by the arguments of PyPI smplx, so that a script changes one import: ``from xavatar import smplx``.

Numpy arrays in, numpy arrays out. Torch tensors in, torch tensors out, with exact gradients to every argument (``xavatar.gradients``);
they are computed on the CPU and come back on the arguments' device. B frames, V vertices, J joints; metres, radians.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy

from ._native import Body
from .errors import ArgumentError

#: The arguments of each family in the order of its joints, and how many joints each turns.
ARGUMENTS = {
    "SMPL-X": {
        "global_orient": 1,
        "body_pose": 21,
        "jaw_pose": 1,
        "leye_pose": 1,
        "reye_pose": 1,
        "left_hand_pose": 15,
        "right_hand_pose": 15,
    },
    "SMPL+H": {"global_orient": 1, "body_pose": 21, "left_hand_pose": 15, "right_hand_pose": 15},
    "SMPL": {"global_orient": 1, "body_pose": 23},
    "STAR": {"global_orient": 1, "body_pose": 23},
    "MANO": {"global_orient": 1, "hand_pose": 15},
    "FLAME": {"global_orient": 1, "neck_pose": 1, "jaw_pose": 1, "leye_pose": 1, "reye_pose": 1},
}


@dataclass(eq=False)
class Output:
    """A batch of bodies, as arrays or tensors. The joints are those of the skeleton: the first J of smplx's, which appends landmarks."""

    #: (B, V, 3).
    vertices: Any
    #: (B, J, 3).
    joints: Any
    #: The absolute rotations that it was posed by (B, 3 J).
    full_pose: Any


class BodyLayer:
    """A body that is called as smplx's are: ``layer(betas=..., body_pose=..., global_orient=..., transl=...)``.

    What is left out is zero. Hands are absolute rotations, unless ``flat_hand_mean`` is false or ``use_pca`` is true, as in smplx.
    """

    def __init__(
        self, body: Body, use_pca: bool = False, num_pca_comps: int = 45, flat_hand_mean: bool = True, batch_size: int = 1
    ) -> None:
        self.body = body
        self.use_pca, self.num_pca_comps, self.flat_hand_mean = use_pca, num_pca_comps, flat_hand_mean
        self.batch_size = batch_size
        family = body.family.split()[0]
        if family not in ARGUMENTS:
            raise ArgumentError(
                f"the body is of {family}, expected one of {', '.join(ARGUMENTS)}; pose it by Body.forward",
                remedy="Body.forward",
            )
        self.arguments = ARGUMENTS[family]

    @property
    def faces(self) -> numpy.ndarray:
        """(F, 3)."""
        return self.body.faces

    def to(self, *_: Any, **__: Any) -> BodyLayer:
        """Itself: results are on the device of the arguments."""
        return self

    def eval(self) -> BodyLayer:
        """Itself: there is nothing to train."""
        return self

    def forward(self, *, transl: Any = None, return_verts: bool = True, **parameters: Any) -> Output:
        """As calling it."""
        return self(transl=transl, return_verts=return_verts, **parameters)

    def __call__(
        self, *, betas: Any = None, expression: Any = None, transl: Any = None, return_verts: bool = True, **poses: Any
    ) -> Output:
        del return_verts  # Vertices cost nothing that joints do not.
        unknown = set(poses) - set(self.arguments)
        if unknown:
            known = ", ".join(["betas", "expression", "transl", *self.arguments])
            raise ArgumentError(f"{min(unknown)} is given, expected one of {known}", remedy=known)
        given = {name: value for name, value in poses.items() if value is not None}
        arrays = _Arrays([betas, expression, transl, *given.values()], self.batch_size)
        rotations = arrays.joined([self._rotations(arrays, name, given.get(name)) for name in self.arguments])
        coefficients = arrays.joined(
            [
                arrays.rows("betas", betas, self.body.shape_coefficients, pads=True),
                arrays.rows("expression", expression, self.body.expression_coefficients, pads=True),
            ]
        )
        rotations = rotations.reshape(arrays.frames, -1, 3)
        vertices, joints = arrays.posed(self.body, rotations, coefficients, arrays.rows("transl", transl, 3))
        return Output(vertices, joints, rotations.reshape(arrays.frames, -1))

    def _rotations(self, arrays: _Arrays, name: str, given: Any) -> Any:
        """Absolute rotations (B, 3 n) of the joints that an argument turns."""
        width = 3 * self.arguments[name]
        hand = {"left_hand_pose": 0, "right_hand_pose": 1, "hand_pose": 0}.get(name)
        if hand is None:
            return arrays.rows(name, given, width)
        if self.use_pca:
            components = self.body.hand_components[hand][: self.num_pca_comps]
            rows = arrays.rows(name, given, len(components)) @ arrays.like(components)
        else:
            rows = arrays.rows(name, given, width)
        return rows if self.flat_hand_mean else rows + arrays.like(self.body.hand_means[hand])


class _Arrays:
    """The arguments of one call as arrays of one kind: numpy's, or tensors if any of them is one."""

    def __init__(self, given: list[Any], batch_size: int) -> None:
        given = [value for value in given if value is not None]
        torch = sys.modules.get("torch")
        tensors = [value for value in given if torch is not None and isinstance(value, torch.Tensor)]
        self.torch = torch if tensors else None
        if self.torch:
            self.options = {"dtype": tensors[0].dtype, "device": tensors[0].device}
        else:
            is_double = any(getattr(value, "dtype", None) == numpy.float64 for value in given)
            self.options = {"dtype": numpy.float64 if is_double else numpy.float32}
        self.frames = max([batch_size, *(len(value) for value in given)])

    def like(self, numbers: Any) -> Any:
        """An array of this kind."""
        return self.torch.as_tensor(numbers, **self.options) if self.torch else numpy.asarray(numbers, **self.options)

    def rows(self, name: str, given: Any, width: int, pads: bool = False) -> Any:
        """An argument (B, width); one row is every frame's, and none is zero. ``pads``: what is left out of a row is zero."""
        library = self.torch or numpy
        if given is None:
            return library.zeros((self.frames, width), **self.options)
        rows = self.like(given).reshape(len(given), -1)
        missing = width - rows.shape[1]
        if missing < 0 or (missing > 0 and not pads) or len(rows) not in (1, self.frames):
            raise ArgumentError(f"{name} is of shape {tuple(rows.shape)}, expected ({self.frames}, {width})")
        rows = library.broadcast_to(rows, (self.frames, rows.shape[1]))
        return self.joined([rows, library.zeros((self.frames, missing), **self.options)]) if missing else rows

    def joined(self, rows: list[Any]) -> Any:
        """Rows side by side."""
        return self.torch.cat(rows, 1) if self.torch else numpy.concatenate(rows, 1)

    def posed(self, body: Body, rotations: Any, coefficients: Any, translations: Any) -> tuple[Any, Any]:
        """Vertices and joints."""
        if self.torch:
            from .gradients import pose

            return pose(body, rotations, coefficients, translations)
        posed = body.forward(rotations, coefficients, translations)
        return posed.vertices, posed.joints


def create(
    model_path: str | PathLike[str],
    model_type: str = "smplx",
    gender: str = "neutral",
    use_pca: bool = True,
    num_pca_comps: int = 6,
    flat_hand_mean: bool = False,
    batch_size: int = 1,
    num_betas: int = 10,
    num_expression_coeffs: int = 10,
    **_: Any,
) -> BodyLayer:
    """A body as ``smplx.create`` makes it, with its defaults; ``model_path`` is a file, a folder of models, or the folder above such.

    More than ten coefficients of either kind take all that the file has; those that are left out of a row are zero. Options of smplx that
    ask for what there is not, such as default parameters, are taken and have no effect.
    """
    folder = Path(model_path) / model_type
    takes_all = max(num_betas, num_expression_coeffs) > 10
    body = Body.load(folder if folder.is_dir() else model_path, gender, all_coefficients=takes_all)
    has_hands = len(body.hand_means) > 0
    return BodyLayer(body, use_pca and has_hands, num_pca_comps, flat_hand_mean or not has_hands, batch_size)
