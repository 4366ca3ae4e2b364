"""Bodies as a function of torch, with exact gradients. Imports torch: nothing else in the package does."""

from __future__ import annotations

from typing import Any

import torch

from ._native import Body


class PosedBody(torch.autograd.Function):
    """rotations (B, J, 3), coefficients (B, K), translations (B, 3) -> vertices (B, V, 3), joints (B, J, 3)."""

    @staticmethod
    def forward(context: Any, body: Body, rotations: Any, coefficients: Any, translations: Any) -> tuple[Any, Any]:
        arguments = (rotations, coefficients, translations)
        context.posed = body.forward(*(_array(tensor) for tensor in arguments))
        return tuple(_tensor(array, rotations) for array in (context.posed.vertices, context.posed.joints))

    @staticmethod
    def backward(context: Any, vertices: Any, joints: Any) -> tuple[Any, ...]:
        gradients = context.posed.pullback(_array(vertices), _array(joints))
        return (None, *(_tensor(gradient, vertices) for gradient in gradients))


def pose(body: Body, rotations: Any, coefficients: Any, translations: Any) -> tuple[Any, Any]:
    """Vertices (B, V, 3) and joints (B, J, 3) of a batch, differentiable in all three tensors; see ``Body.forward``."""
    return PosedBody.apply(body, rotations, coefficients, translations)


def _array(tensor: Any) -> Any:
    """The tensor's memory as an array, copied only from another device."""
    return tensor.detach().cpu().numpy()


def _tensor(array: Any, like: Any) -> Any:
    """The array's memory as a tensor, copied only to another device or type."""
    return torch.from_numpy(array).to(device=like.device, dtype=like.dtype)
