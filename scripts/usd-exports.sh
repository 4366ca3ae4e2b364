#!/usr/bin/env bash
# Has OpenUSD read the built-in subject as USDZ and USDA: its compliance checker must be content, and the vertices that its skinning makes of
# skeleton, weights and morphs must be those of `animate --fixed-topology` in ten frames, to 0.05 mm. Skipped where there is no OpenUSD
# (pip install usd-core numpy).
#   scripts/usd-exports.sh [AVATAR BODY]    an avatar and its body model instead of a smoke demo's
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh pxr numpy
. scripts/dancer.sh "$@"
xavatar() { cargo run --release --quiet -- "$@" --quiet > /dev/null; }
xavatar export "$avatar" --body "$body" --resolution 128 --texture 0 --for unreal --out "$folder/dance.usda"
xavatar export "$avatar" --body "$body" --resolution 128 --texture 512 --faces 5000 --out "$folder/dance.usdz"
xavatar animate "$avatar" dance --body "$body" --resolution 128 --fixed-topology --out "$folder/frames"

cat > "$folder/check.py" << 'SCRIPT'
import pathlib
import sys

import numpy
from pxr import Usd, UsdGeom, UsdSkel, UsdValidation, Vt

from vertices_of_ply import vertices_of_ply

COMPARED = 10
TOLERANCE = 5e-5
folder = pathlib.Path(sys.argv[1])


def complaints(path):
    """What OpenUSD's validators, those of its checker, say of a file."""
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    return [error.GetMessage() for error in context.Validate(Usd.Stage.Open(str(path)))]


def farthest_of_clip(path):
    stage = Usd.Stage.Open(str(path))
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    skeleton = cache.GetSkelQuery(binding.GetSkeleton())
    (target,) = binding.GetSkinningTargets()
    mesh = UsdGeom.Mesh(target.GetPrim())
    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(target.GetPrim()))
    indices, offsets = shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets()
    files = sorted((folder / "frames").glob("*.ply"))
    farthest = 0.0
    for index in numpy.linspace(0, len(files) - 1, COMPARED).round().astype(int):
        points = Vt.Vec3fArray(mesh.GetPointsAttr().Get())
        weights = skeleton.GetAnimQuery().ComputeBlendShapeWeights(float(index))
        mapper = target.GetBlendShapeMapper()
        weights = mapper.Remap(weights) if mapper else weights
        assert shapes.ComputeDeformedPoints(*shapes.ComputeSubShapeWeights(weights), indices, offsets, points)
        transforms = skeleton.ComputeSkinningTransforms(float(index))
        assert target.ComputeSkinnedPoints(transforms, points, float(index))
        distances = numpy.linalg.norm(numpy.array(points) - vertices_of_ply(files[index]), axis=1)
        farthest = max(farthest, distances.max())
    return farthest


found = {name: complaints(folder / name) for name in ("dance.usda", "dance.usdz")}
farthest = farthest_of_clip(folder / "dance.usda")
packed = Usd.Stage.Open(str(folder / "dance.usdz"))
faces = len(UsdGeom.Mesh(packed.GetPrimAtPath("/avatar/mesh")).GetFaceVertexCountsAttr().Get())
print(f"OpenUSD {'.'.join(map(str, Usd.GetVersion()))}: the clip is at most {1000 * farthest:.4f} mm off in {COMPARED} frames;", end=" ")
print(f"{faces} faces in the package; the checker says {found if any(found.values()) else 'nothing'}")
sys.exit(0 if farthest < TOLERANCE and not any(found.values()) and 4900 < faces <= 5000 else 1)
SCRIPT
PYTHONPATH=scripts "$python" "$folder/check.py" "$folder"
