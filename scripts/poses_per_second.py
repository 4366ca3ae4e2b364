#!/usr/bin/env python3
"""Seconds a pose's mesh from Python, to lay beside the row "posed, without hidden surfaces" of `cargo bench --bench extraction` of the same arguments.

    pip install .
    python scripts/poses_per_second.py RUN BODY MOTION [RESOLUTION]
"""
import sys
import time

import xavatar

#: The bench's.
FRAMES = 8

if len(sys.argv) < 4:
    sys.exit(__doc__)
run, body, motion, *resolution = sys.argv[1:]
resolution = int(resolution[0]) if resolution else 256
avatar = xavatar.load(run, xavatar.Body.load(body))
poses = xavatar.read_motion(motion, avatar).poses[:FRAMES]
avatar.pose(poses[0], resolution=32)
began = time.perf_counter()
for pose in poses:
    vertices = len(avatar.pose(pose, resolution=resolution).vertices)
print(f"{(time.perf_counter() - began) / len(poses):.4f} s a pose, {vertices} vertices")
