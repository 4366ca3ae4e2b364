#!/usr/bin/env bash
# Has Blender import a BLSM body that dances, its bones' sizes as scales of nodes, and compares every vertex of ten frames with
# `body pose`: 0.1 mm at most. Skipped where Blender is no module of Python (pip install bpy).
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh bpy
xavatar() { cargo run --release --quiet -- "$@" --quiet; }
xavatar body synth --kind blsm --subjects 1 --poses 1 --out "$folder/people" > /dev/null
blsm=$folder/people/truth/blsm.npz
xavatar body fit "$blsm" "$folder/people/00/0000.ply" --out "$folder/person.npz" > /dev/null
for file in dancer.glb moves.npz; do
    xavatar body retarget dance --to "$blsm" --person "$folder/person.npz" --out "$folder/$file" > /dev/null
done
for frame in 1 9 17 25 33 41 49 57 65 72; do
    xavatar body pose "$blsm" "$folder/moves.npz" --frame "$frame" --out "$folder/$frame.ply" > /dev/null
done

cat > "$folder/check.py" << 'SCRIPT'
import pathlib
import sys

import bpy
import numpy

from vertices_in_scene import vertices_in_scene
from vertices_of_ply import vertices_of_ply

TOLERANCE = 1e-4
folder = pathlib.Path(sys.argv[1])

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 30
bpy.ops.import_scene.gltf(filepath=str(folder / "dancer.glb"))
meshes = [each for each in bpy.data.objects if each.type == "MESH"]
body = max(meshes, key=lambda each: len(each.data.vertices))
farthest = 0.0
files = sorted(folder.glob("*.ply"))
for file in files:
    bpy.context.scene.frame_set(int(file.stem) - 1)
    distances = numpy.linalg.norm(vertices_in_scene(body) - vertices_of_ply(file), axis=1)
    farthest = max(farthest, distances.max())
bones = next(each for each in bpy.data.objects if each.type == "ARMATURE").pose.bones
scales = [bone.scale[0] for bone in bones]
print(f"Blender {bpy.app.version_string}: scaled bones, {min(scales):.3f} to {max(scales):.3f}, are at most", end=" ")
print(f"{1000 * farthest:.4f} mm off in {len(files)} frames")
sys.exit(0 if farthest < TOLERANCE and max(scales) - min(scales) > 0.01 else 1)
SCRIPT
PYTHONPATH=scripts "$python" "$folder/check.py" "$folder"
