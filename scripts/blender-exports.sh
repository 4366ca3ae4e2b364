#!/usr/bin/env bash
# Has Blender import the built-in subject as a dancing GLB and compares every vertex of ten frames with `animate --fixed-topology`:
# 0.05 mm at most; then as an OBJ, whose material must not shine. Skipped where Blender is no module of Python (pip install bpy).
#   scripts/blender-exports.sh [AVATAR BODY]    an avatar and its body model instead of a smoke demo's
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh bpy
. scripts/dancer.sh "$@"
xavatar() { cargo run --release --quiet -- "$@" --quiet; }
# Vertices as `animate` has them: a texture would double those on its seams.
xavatar export "$avatar" --body "$body" --resolution 128 --texture 0 --out "$folder/dance.glb" > /dev/null
xavatar export "$avatar" --resolution 64 --texture 256 --out "$folder/still.obj" > /dev/null
xavatar animate "$avatar" dance --body "$body" --resolution 128 --fixed-topology --out "$folder/frames" > /dev/null

cat > "$folder/check.py" << 'SCRIPT'
import pathlib
import sys

import bpy
import numpy

from vertices_in_scene import vertices_in_scene
from vertices_of_ply import vertices_of_ply

FRAMES_PER_SECOND = 30
COMPARED = 10
TOLERANCE = 5e-5
folder = pathlib.Path(sys.argv[1])


def imported(read, path, **options):
    """The mesh with most vertices that an import brings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FRAMES_PER_SECOND
    read(filepath=str(path), **options)
    meshes = [each for each in bpy.data.objects if each.type == "MESH"]
    return max(meshes, key=lambda each: len(each.data.vertices))


def farthest_of_clip():
    body = imported(bpy.ops.import_scene.gltf, folder / "dance.glb")
    files = sorted((folder / "frames").glob("*.ply"))
    farthest = 0.0
    for index in numpy.linspace(0, len(files) - 1, COMPARED).round().astype(int):
        bpy.context.scene.frame_set(int(index))
        distances = numpy.linalg.norm(vertices_in_scene(body) - vertices_of_ply(files[index]), axis=1)
        farthest = max(farthest, distances.max())
    return farthest


def shine_of_obj():
    body = imported(bpy.ops.wm.obj_import, folder / "still.obj")
    nodes = body.data.materials[0].node_tree.nodes
    surface = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    assert any(node.type == "TEX_IMAGE" and node.image.size[0] > 0 for node in nodes), "the OBJ has lost its texture"
    return [surface.inputs[name].default_value for name in ("Specular IOR Level", "Metallic", "Roughness")]


farthest = farthest_of_clip()
specular, metallic, roughness = shine_of_obj()
print(f"Blender {bpy.app.version_string}: the clip is at most {1000 * farthest:.4f} mm off in {COMPARED} frames;", end=" ")
print(f"the OBJ has specular {specular:.2f}, metallic {metallic:.2f}, roughness {roughness:.2f}")
sys.exit(0 if farthest < TOLERANCE and specular == 0 and metallic == 0 else 1)
SCRIPT
PYTHONPATH=scripts "$python" "$folder/check.py" "$folder"
