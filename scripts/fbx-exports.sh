#!/usr/bin/env bash
# Has Blender make an FBX of the built-in subject's GLB for Blender: its bones must lie along the limbs, and the FBX, read again, must have
# its skeleton, its clip and its shape keys. Skipped where Blender is no module of Python (pip install bpy).
#   scripts/fbx-exports.sh [AVATAR BODY]    an avatar and its body model instead of a smoke demo's
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh bpy
. scripts/dancer.sh "$@"
cargo run --release --quiet -- export "$avatar" --body "$body" --resolution 128 --texture 256 --for blender --faces 4000 \
    --out "$folder/dance.glb" --quiet > /dev/null

cat > "$folder/convert.py" << 'SCRIPT'
import pathlib
import sys

import bpy

STRAIGHT = 0.999
folder = pathlib.Path(sys.argv[1])


def fresh(read, **options):
    """The armature and the largest mesh that an import brings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = 30
    read(**options)
    meshes = [each for each in bpy.data.objects if each.type == "MESH"]
    (armature,) = (each for each in bpy.data.objects if each.type == "ARMATURE")
    return armature, max(meshes, key=lambda each: len(each.data.vertices))


def height(body, frame):
    bpy.context.scene.frame_set(frame)
    posed = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    corners = [posed.matrix_world @ vertex.co for vertex in posed.to_mesh().vertices]
    return [max(corner[axis] for corner in corners) - min(corner[axis] for corner in corners) for axis in range(3)]


armature, body = fresh(bpy.ops.import_scene.gltf, filepath=str(folder / "dance.glb"), bone_heuristic="BLENDER")
bones = armature.data.bones
straight = []
for upper, lower in (("left_hip", "left_knee"), ("left_knee", "left_ankle"), ("right_shoulder", "right_elbow"), ("right_elbow", "right_wrist")):
    along = (bones[lower].head_local - bones[upper].head_local).normalized()
    straight.append((bones[upper].tail_local - bones[upper].head_local).normalized().dot(along))
before = len(bones), len(body.data.shape_keys.key_blocks), [height(body, frame) for frame in (0, 20, 40)]
bpy.ops.export_scene.fbx(filepath=str(folder / "dance.fbx"), add_leaf_bones=False, bake_anim_simplify_factor=0, path_mode="COPY", embed_textures=True)

armature, body = fresh(bpy.ops.import_scene.fbx, filepath=str(folder / "dance.fbx"))
# The importer of FBX begins at frame 1.
after = len(armature.data.bones), len(body.data.shape_keys.key_blocks), [height(body, frame) for frame in (1, 21, 41)]
farthest = max(abs(a - b) for one, other in zip(before[2], after[2]) for a, b in zip(one, other))
print(f"Blender {bpy.app.version_string}: bones along the limbs to {min(straight):.5f}; FBX with {after[0]} bones and {after[1]} shape keys", end=" ")
print(f"(of {before[0]} and {before[1]}), whose figure is as large in three frames to {1000 * farthest:.2f} mm")
sys.exit(0 if min(straight) > STRAIGHT and before[:2] == after[:2] and farthest < 5e-3 else 1)
SCRIPT
"$python" "$folder/convert.py" "$folder"
