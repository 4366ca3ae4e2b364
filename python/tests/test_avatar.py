"""Avatars: posed, asked, skinned."""

import numpy
import pytest

import xavatar


def extent(mesh):
    return mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)


def test_a_pose_is_an_array_names_or_an_object(avatar):
    turn = [0.0, numpy.pi / 2, 0.0]
    pose = avatar.rest_pose()
    pose.rotations[avatar.joints.index("pelvis")] = turn
    meshes = [avatar.pose(given, resolution=64) for given in (pose, pose.rotations, {"pelvis": turn})]
    assert all(numpy.array_equal(meshes[0].vertices, mesh.vertices) for mesh in meshes[1:])
    still, turned = extent(avatar.pose(resolution=64)), extent(meshes[0])
    assert numpy.allclose(turned, still[[2, 1, 0]], atol=0.05) and still[0] > still[2] + 0.1, "what was wide is deep"


def test_a_mesh_has_outward_normals_colours_and_valid_faces(avatar):
    mesh = avatar.pose(resolution=48)
    count = len(mesh.vertices)
    assert mesh.vertices.dtype == numpy.float32 and mesh.faces.dtype == numpy.uint32
    assert mesh.normals.shape == (count, 3) and mesh.colours.shape == (count, 3) and mesh.colours.dtype == numpy.uint8
    assert mesh.faces.max() < count
    corners = mesh.vertices.astype(float)[mesh.faces]
    volume = numpy.linalg.det(corners).sum() / 6
    assert volume > 0, "faces wind counter-clockwise seen from outside"


def test_the_translation_moves_the_mesh(avatar):
    pose = avatar.rest_pose()
    still = avatar.pose(pose, resolution=48).vertices
    pose.translation += [1.0, 0.0, 0.0]
    assert numpy.allclose(avatar.pose(pose, resolution=48).vertices - still, [1, 0, 0], atol=1e-5)


def test_a_mesh_is_read_as_it_was_written(avatar, tmp_path):
    mesh = avatar.canonical(resolution=32)
    mesh.save(tmp_path / "canonical.ply")
    read = xavatar.read_mesh(tmp_path / "canonical.ply")
    for name in ("vertices", "faces", "normals", "colours"):
        assert numpy.array_equal(getattr(read, name), getattr(mesh, name)), name


def test_the_fields_are_zero_on_the_surface_and_weights_sum_to_one(avatar):
    mesh = avatar.canonical(resolution=96)
    on = avatar.query(mesh.vertices)
    off = avatar.query(mesh.vertices + 0.05 * mesh.normals)
    assert numpy.abs(on.values).mean() < numpy.abs(off.values).mean() / 2
    assert on.weights.shape == (len(mesh.vertices), len(avatar.joints))
    assert numpy.allclose(on.weights.sum(axis=1), 1, atol=1e-4)


def test_a_fixed_topology_keeps_its_faces(avatar):
    topology = avatar.fixed_topology(resolution=48)
    still, turned = topology.pose(), topology.pose({"left_shoulder": [0, 0, 1.2]})
    assert numpy.array_equal(still.faces, turned.faces) and numpy.array_equal(still.colours, topology.canonical.colours)
    moved = numpy.linalg.norm(turned.vertices - still.vertices, axis=1)
    arm = topology.weights[:, avatar.joints.index("left_elbow")] > 0.5
    assert moved[arm].min() > 0.1 > numpy.median(moved)


def test_a_saved_avatar_is_the_same(avatar, tmp_path):
    avatar.save(tmp_path / "avatar.safetensors")
    again = xavatar.load(tmp_path / "avatar.safetensors", body=avatar.body)
    assert numpy.array_equal(again.pose(resolution=32).vertices, avatar.pose(resolution=32).vertices)
    assert again.config == avatar.config and again.steps == 12


def test_what_cannot_be_posed_is_named(avatar, tmp_path):
    with pytest.raises(xavatar.ArgumentError, match="is tail, expected one of pelvis, "):
        avatar.pose({"tail": [0, 0, 0]})
    with pytest.raises(ValueError, match="3 rotations, expected 55"):
        avatar.pose(numpy.zeros((3, 3)))
    with pytest.raises(xavatar.Error, match="resolution"):
        avatar.pose(resolution=0)
    with pytest.raises(FileNotFoundError, match="avatar not found") as caught:
        xavatar.load(tmp_path / "nowhere")
    assert "avatar.safetensors" in caught.value.remedy


def test_motions_are_poses_in_turn(avatar, body, tmp_path):
    dance = xavatar.read_motion("dance", avatar)
    assert dance.rotations.shape == (len(dance), 55, 3) and dance.translations.shape == (len(dance), 3)
    assert dance.frames_per_second == 30 and "dance" in dance.report[0]
    still = avatar.pose(resolution=32).vertices
    assert not numpy.array_equal(avatar.pose(dance[0], resolution=32).vertices, still)
    some = xavatar.read_motion("dance", body, frames=(2, 4))
    assert len(some) == 3 and numpy.allclose(some[0].rotations, dance[1].rotations)
    with pytest.raises(xavatar.ArgumentError, match="up is north, expected one of Y, Z"):
        xavatar.read_motion("dance", avatar, up="north")


def test_doubts_about_a_motion_are_warnings(avatar, tmp_path):
    turns = numpy.zeros((4, 3), numpy.float32)
    turns[:, 0] = numpy.pi
    path = tmp_path / "upside_down.npz"
    still = {"body_pose": numpy.zeros((4, 63), numpy.float32), "transl": numpy.zeros((4, 3), numpy.float32)}
    numpy.savez(path, global_orient=turns, frames_per_second=numpy.float32(30), **still)
    with pytest.warns(UserWarning, match=r"head down in 4 of 4 frames.*\(read_motion\(..., up="):
        motion = xavatar.read_motion(path, avatar)
    assert len(motion.warnings) == 1
