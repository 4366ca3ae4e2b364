#!/usr/bin/env python3
"""Bodies a second of PyPI smplx (torch, CPU) beside ours, in turn, on one SMPL-X model.

    pip install . torch smplx
    python scripts/bodies_per_second.py [BODY.npz] [FRAMES]

The gradient is of the sum of squares of vertices and joints, with respect to all parameters. Without a model, the built-in one. Ours
alone, without Python: `cargo bench --bench bodies`.
"""
import pathlib
import sys
import tempfile
import time

import numpy
import smplx
import torch
import xavatar

ROUNDS = 5
#: What smplx insists on and poses nothing by.
LANDMARKS = {
    "lmk_faces_idx": numpy.zeros(51, numpy.int64),
    "lmk_bary_coords": numpy.full((51, 3), 1 / 3),
    "dynamic_lmk_faces_idx": numpy.zeros((79, 17), numpy.int64),
    "dynamic_lmk_bary_coords": numpy.full((79, 17, 3), 1 / 3),
}


def theirs(model_path, turns):
    """Forward, and with gradients."""
    frames = len(turns)
    layer = smplx.SMPLXLayer(model_path=model_path, num_betas=10, num_expression_coeffs=10, flat_hand_mean=True)
    theta = turns.norm(dim=-1, keepdim=True)
    x, y, z = (turns / theta).unbind(-1)
    zero = torch.zeros_like(x)
    k = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(frames, 55, 3, 3)
    rotations = torch.eye(3) + theta[..., None].sin() * k + (1 - theta[..., None].cos()) * (k @ k)
    parts = dict(global_orient=slice(0, 1), body_pose=slice(1, 22), jaw_pose=slice(22, 23), leye_pose=slice(23, 24),
                 reye_pose=slice(24, 25), left_hand_pose=slice(25, 40), right_hand_pose=slice(40, 55))
    given = {name: rotations[:, part].clone() for name, part in parts.items()}
    given.update(betas=torch.full((frames, 10), .5), expression=torch.full((frames, 10), .2), transl=torch.zeros(frames, 3))

    def forward():
        with torch.no_grad():
            layer(**given)

    def both():
        leaves = {name: value.clone().requires_grad_() for name, value in given.items()}
        posed = layer(**leaves)
        (posed.vertices.square().sum() + posed.joints[:, :55].square().sum()).backward()

    return forward, both


def ours(body, turns):
    """Forward, and with gradients."""
    rotations = turns.numpy()
    coefficients = numpy.tile(numpy.repeat(numpy.float32([.5, .2]), 10), (len(turns), 1))

    def forward():
        body.forward(rotations, coefficients)

    def both():
        posed = body.forward(rotations, coefficients)
        posed.pullback(2 * posed.vertices, 2 * posed.joints)

    return forward, both


def rates(work, frames):
    """Bodies a second of each; the best of some rounds."""
    best = []
    for one in work:
        one()
        times = []
        for _ in range(ROUNDS):
            start = time.perf_counter()
            one()
            times.append(time.perf_counter() - start)
        best.append(frames / min(times))
    return best


given = sys.argv[1] if len(sys.argv) > 1 else None
frames = int(sys.argv[2]) if len(sys.argv) > 2 else 64
with tempfile.TemporaryDirectory() as folder:
    if given is None:
        xavatar.write_built_in_subject(folder, 1, 1)
        given = pathlib.Path(folder, "body", "SMPLX_NEUTRAL.npz")
    path = pathlib.Path(folder, "SMPLX_NEUTRAL.npz")
    numpy.savez(path, **{**LANDMARKS, **numpy.load(given, allow_pickle=True)})
    turns = 0.3 * torch.randn(frames, 55, 3)
    work = {"smplx": theirs(str(path), turns), "xavatar": ours(xavatar.Body.load(path), turns)}
    work["smplx again"] = work["smplx"]
    found = {name: rates(pair, frames) for name, pair in work.items()}
print(f"batches of {frames}, {torch.get_num_threads()} threads of torch {torch.__version__}")
for name, (forward, gradient) in found.items():
    print(f"{name:12} forward {forward:9.1f} bodies/s   with gradients {gradient:9.1f} bodies/s")
print("ratio        forward %.1f   with gradients %.1f" % tuple(
    found["xavatar"][k] / max(found["smplx"][k], found["smplx again"][k]) for k in (0, 1)))
