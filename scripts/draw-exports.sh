#!/usr/bin/env bash
# Has VTK (PyVista, ParaView, F3D) load and draw the built-in subject as a dancing GLB and as an OBJ: no complaint, and a figure in its colours
# that fills what its bounds say. Skipped where there is no VTK (pip install vtk).
#   scripts/draw-exports.sh [AVATAR BODY [PICTURES]]    an avatar and its body model instead of a smoke demo's; a folder for the pictures
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh vtk
. scripts/dancer.sh "${@:1:2}"
xavatar() { cargo run --release --quiet -- "$@" --quiet > /dev/null; }
xavatar export "$avatar" --body "$body" --resolution 128 --texture 0 --out "$folder/coloured.glb"
xavatar export "$avatar" --body "$body" --resolution 128 --texture 512 --ground --out "$folder/textured.glb"
xavatar export "$avatar" --resolution 128 --texture 512 --out "$folder/still.obj"

cat > "$folder/draw.py" << 'SCRIPT'
import pathlib
import sys

import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

SIZE = 480
BACKGROUND = (0.8, 0.8, 0.85)
folder, pictures = map(pathlib.Path, sys.argv[1:])
complaints = []


class Complaints(vtk.vtkOutputWindow):
    def DisplayErrorText(self, text):
        complaints.append(text)


def importer_of(path):
    if path.suffix == ".glb":
        importer = vtk.vtkGLTFImporter()
        importer.SetFileName(str(path))
        return importer
    importer = vtk.vtkOBJImporter()
    importer.SetFileName(str(path))
    importer.SetFileNameMTL(str(path.with_suffix(".mtl")))
    importer.SetTexturePath(str(path.parent))
    return importer


def drawn(path):
    """What VTK draws of a file (rows, columns, RGB), and how many points it has."""
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(SIZE, SIZE)
    importer = importer_of(path)
    importer.SetRenderWindow(window)
    importer.Update()
    renderer = importer.GetRenderer()
    renderer.SetBackground(*BACKGROUND)
    actors = list(renderer.GetActors())
    points = sum(actor.GetMapper().GetInput().GetNumberOfPoints() for actor in actors)
    light = vtk.vtkLight()
    light.SetLightTypeToHeadlight()
    renderer.AddLight(light)
    renderer.ResetCamera()
    window.Render()
    reader = vtk.vtkWindowToImageFilter()
    reader.SetInput(window)
    reader.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(pictures / f"{path.name}.png"))
    writer.SetInputConnection(reader.GetOutputPort())
    writer.Write()
    picture = reader.GetOutput()
    return vtk_to_numpy(picture.GetPointData().GetScalars()).reshape(SIZE, SIZE, -1)[..., :3].astype(float), points


vtk.vtkOutputWindow.SetInstance(Complaints())
failed = False
for name in ["coloured.glb", "textured.glb", "still.obj"]:
    picture, points = drawn(folder / name)
    figure = (abs(picture - [255 * channel for channel in BACKGROUND]) > 8).any(axis=2)
    share = figure.mean()
    colourful = (picture.max(axis=2) - picture.min(axis=2))[figure].mean() if figure.any() else 0
    print(f"VTK {vtk.vtkVersion().GetVTKVersion()}, {name}: {points} points, {100 * share:.0f} % of the picture, channels {colourful:.0f} apart")
    failed |= points < 1000 or not 0.03 < share < 0.6 or colourful < 10
for complaint in complaints[:5]:
    print(f"  {complaint.strip()}")
sys.exit(1 if failed or complaints else 0)
SCRIPT
pictures=${3:-$folder}
mkdir -p "$pictures"
"$python" "$folder/draw.py" "$folder" "$pictures"
