#!/usr/bin/env python3
"""Bodies a second of PyPI smplx (torch, CPU) beside ours, in turn, on one SMPL-X model.

    pip install torch smplx
    python scripts/bodies_per_second.py BODY.npz [FRAMES]

The gradient is of the sum of squares of vertices and joints, with respect to all parameters. Runs `cargo bench --bench bodies`.
"""
import re
import subprocess
import sys
import time

import smplx
import torch

model_path, frames = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 64
ROUNDS = 5


def ours():
    """Forward, and with gradients."""
    command = ["cargo", "bench", "--bench", "bodies", "--", model_path, str(frames)]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [float(rate) for rate in re.search(r"forward ([\d.]+) .* gradients ([\d.]+)", printed).groups()]


def theirs():
    """Forward, and with gradients."""
    layer = smplx.SMPLXLayer(model_path=model_path, num_betas=10, num_expression_coeffs=10, flat_hand_mean=True)
    turns = 0.3 * torch.randn(frames, 55, 3)
    theta = turns.norm(dim=-1, keepdim=True)
    x, y, z = (turns / theta).unbind(-1)
    zero = torch.zeros_like(x)
    k = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(frames, 55, 3, 3)
    rotations = torch.eye(3) + theta[..., None].sin() * k + (1 - theta[..., None].cos()) * (k @ k)
    parts = dict(global_orient=slice(0, 1), body_pose=slice(1, 22), jaw_pose=slice(22, 23), leye_pose=slice(23, 24),
                 reye_pose=slice(24, 25), left_hand_pose=slice(25, 40), right_hand_pose=slice(40, 55))
    given = {name: rotations[:, part].clone() for name, part in parts.items()}
    given.update(betas=torch.full((frames, 10), .5), expression=torch.full((frames, 10), .2), transl=torch.zeros(frames, 3))
    best = [float("inf")] * 2
    for _ in range(ROUNDS):
        start = time.perf_counter()
        with torch.no_grad():
            layer(**given)
        best[0] = min(best[0], time.perf_counter() - start)
        leaves = {name: value.clone().requires_grad_() for name, value in given.items()}
        start = time.perf_counter()
        posed = layer(**leaves)
        (posed.vertices.square().sum() + posed.joints[:, :55].square().sum()).backward()
        best[1] = min(best[1], time.perf_counter() - start)
    return [frames / seconds for seconds in best]


rates = {"smplx": theirs(), "xavatar": ours(), "smplx again": theirs()}
for name, (forward, gradient) in rates.items():
    print(f"{name:12} forward {forward:9.1f} bodies/s   with gradients {gradient:9.1f} bodies/s")
print("ratio        forward %.1f   with gradients %.1f" % tuple(
    rates["xavatar"][k] / max(rates["smplx"][k], rates["smplx again"][k]) for k in (0, 1)))
