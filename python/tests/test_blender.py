"""Blender's add-on, headless, by the module and by the program. Skipped where `bpy` cannot be imported (pip install bpy)."""

import importlib.util
import os
import pathlib

import numpy
import pytest

import xavatar

bpy = pytest.importorskip("bpy")

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "xavatar"
RESOLUTION = 48
#: Blender takes smaller ones for none, radians.
SMALLEST_TURN = 2e-3


@pytest.fixture(scope="module")
def addon():
    path = ROOT / "python" / "blender" / "xavatar_blender.py"
    specification = importlib.util.spec_from_file_location("xavatar_blender", path)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    module.register()
    yield module
    module.unregister()


@pytest.fixture(scope="module")
def armature(addon, trained):
    return addon.add_avatar(str(trained[0]), resolution=RESOLUTION)


def vertices_in_scene(mesh):
    """Where Blender draws a mesh's vertices, turned back to Y up."""
    places = numpy.empty(3 * len(mesh.data.vertices), numpy.float32)
    mesh.data.vertices.foreach_get("co", places)
    matrix = numpy.array(mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
    x, y, z = (places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]).T
    return numpy.stack([x, z, -y], axis=1)


def test_an_avatar_is_an_armature_with_the_field_s_surface(addon, armature, avatar):
    bones = armature.data.bones
    assert len(bones) == len(avatar.joints)
    heads = numpy.array([bones[joint].head_local for joint in avatar.joints])
    above = [bones[joint].parent.name if bones[joint].parent else None for joint in avatar.joints]
    assert above == [avatar.joints[parent] if parent >= 0 else None for parent in avatar.parents]
    assert numpy.allclose(heads, avatar.rest_joints, atol=1e-6)
    mesh = armature.xavatar.mesh
    expected = avatar.pose(resolution=RESOLUTION)
    assert numpy.allclose(vertices_in_scene(mesh), expected.vertices, atol=1e-5)
    colours = numpy.empty(4 * len(expected.vertices), numpy.float32)
    mesh.data.color_attributes["Colour"].data.foreach_get("color_srgb", colours)
    assert numpy.allclose(colours.reshape(-1, 4)[:, :3] * 255, expected.colours, atol=0.6)


def test_bones_that_are_turned_are_the_pose(addon, armature, avatar):
    random = numpy.random.default_rng(7)
    rotations, translation = random.normal(scale=0.5, size=(55, 3)), numpy.array([0.3, -0.1, 0.5])
    addon.set_pose(armature, addon.source_of(armature), rotations, translation)
    bpy.context.view_layer.update()
    found = addon.pose_of(armature, addon.source_of(armature))
    assert numpy.allclose(found[0], rotations, atol=1e-4) and numpy.allclose(found[1], translation, atol=1e-5)


def test_the_surface_follows_the_motion(addon, armature, avatar):
    dance = xavatar.read_motion("dance", avatar)
    scene = bpy.context.scene
    scene.frame_set(1)
    assert addon.add_motion(armature, "dance") == len(dance)
    assert (scene.frame_end, scene.render.fps) == (len(dance), 30)
    for frame in (1, 20, 50):
        scene.frame_set(frame)
        rotations, translation = addon.pose_of(armature, addon.source_of(armature))
        assert numpy.allclose(rotations, dance[frame - 1].rotations, atol=SMALLEST_TURN), frame
        assert numpy.allclose(armature.xavatar.expression, dance[frame - 1].expression, atol=1e-6), frame
        assert numpy.allclose(translation, dance[frame - 1].translation, atol=1e-5), frame
        pose = xavatar.Pose(rotations, translation, dance[frame - 1].expression)
        expected = avatar.pose(pose, resolution=RESOLUTION)
        assert numpy.allclose(vertices_in_scene(armature.xavatar.mesh), expected.vertices, atol=1e-4), frame


def test_the_program_gives_what_the_module_gives(addon, trained, avatar):
    if not PROGRAM.is_file():
        pytest.skip(f"{PROGRAM} is not built (cargo build --release)")
    source = addon.ProgramSource(str(PROGRAM), str(trained[0]), "")
    module = addon.ModuleSource(xavatar, str(trained[0]), "")
    assert source.joints == module.joints and source.parents == module.parents
    assert numpy.allclose(source.rest, module.rest, atol=1e-5)
    rotations = numpy.random.default_rng(8).normal(scale=0.1, size=(55, 3))
    arguments = rotations, numpy.array([0, 1, 0]), [0.5] * 10, RESOLUTION
    found, expected = (each.surface(*arguments) for each in (source, module))
    for name in ("vertices", "faces", "normals", "colours"):
        assert numpy.array_equal(getattr(found, name), getattr(expected, name)), name
    found, expected = source.motion("dance"), module.motion("dance")
    assert found[3] == pytest.approx(expected[3], rel=1e-4)
    assert numpy.allclose(found[0], expected[0], atol=SMALLEST_TURN)
    assert numpy.allclose(found[1], expected[1], atol=1e-4)
