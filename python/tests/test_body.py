"""Bodies: batches, their gradients, and the arguments of smplx."""

import numpy
import pytest

import xavatar
from xavatar import smplx

STEP = 1e-5


def batch(body, frames=3, dtype=numpy.float64):
    random = numpy.random.default_rng(1)
    count = body.shape_coefficients + body.expression_coefficients
    return [
        random.normal(scale=scale, size=size).astype(dtype)
        for scale, size in ((0.3, (frames, len(body.joints), 3)), (0.5, (frames, count)), (0.2, (frames, 3)))
    ]


# d/dt f(x + t d) at 0 is <pullback of df, d>, for f the sum of a few vertices and joints with random weights.
def test_the_pullback_is_the_gradient(body):
    arguments = batch(body)
    random = numpy.random.default_rng(2)
    posed = body.forward(*arguments)
    weights = [random.normal(size=array.shape) for array in (posed.vertices, posed.joints)]

    def value(arguments):
        posed = body.forward(*arguments)
        return (weights[0] * posed.vertices).sum() + (weights[1] * posed.joints).sum()

    gradients = posed.pullback(*weights)
    for place in range(3):
        direction = random.normal(size=arguments[place].shape)
        moved = []
        for sign in (1, -1):
            there = list(arguments)
            there[place] = there[place] + sign * STEP * direction
            moved.append(value(there))
        expected = (moved[0] - moved[1]) / (2 * STEP)
        assert (gradients[place] * direction).sum() == pytest.approx(expected, rel=1e-6)


def test_what_is_left_out_is_zero(body):
    rotations, coefficients, _ = batch(body, dtype=numpy.float32)
    some = body.forward(rotations)
    full = body.forward(rotations, numpy.zeros_like(coefficients), numpy.zeros((3, 3)))
    assert some.vertices.dtype == numpy.float32 and numpy.array_equal(some.vertices, full.vertices)
    of_joints = some.pullback(joints=numpy.ones_like(some.joints))
    assert numpy.array_equal(of_joints[2], numpy.full((3, 3), len(body.joints)))


def test_arrays_of_wrong_shapes_are_named(body):
    with pytest.raises(xavatar.ArgumentError, match=r"rotations is of shape \[2, 9\], expected \(B, 55, 3\)"):
        body.forward(numpy.zeros((2, 9)))
    with pytest.raises(xavatar.ArgumentError, match=r"translations is of 3 frames, expected \(2, 3\)"):
        body.forward(numpy.zeros((2, 55, 3)), translations=numpy.zeros((3, 3)))
    with pytest.raises(xavatar.ArgumentError, match="body_pose is of shape"):
        body(body_pose=numpy.zeros((1, 69)))
    with pytest.raises(xavatar.ArgumentError, match="tail_pose is given, expected one of betas"):
        body(tail_pose=numpy.zeros((1, 3)))


def test_the_arguments_of_smplx_are_the_joints_in_order(body):
    rotations, coefficients, translations = batch(body, dtype=numpy.float32)
    flat = rotations.reshape(3, -1)
    named, start = {}, 0
    for name, joints in smplx.ARGUMENTS["SMPL-X"].items():
        named[name] = flat[:, start : start + 3 * joints]
        start += 3 * joints
    output = body(**named, betas=coefficients[:, :10], expression=coefficients[:, 10:], transl=translations)
    posed = body.forward(rotations, coefficients, translations)
    assert numpy.array_equal(output.vertices, posed.vertices) and numpy.array_equal(output.joints, posed.joints)


def test_one_row_is_every_frame_s(body):
    output = body(betas=numpy.full((1, 2), 0.5), transl=numpy.zeros((4, 3), numpy.float32))
    assert output.vertices.shape == (4, len(body.template), 3)
    assert numpy.array_equal(output.vertices[0], output.vertices[3])


def test_hands_are_relaxed_as_in_smplx_unless_they_are_flat(data, body):
    components = body.hand_components
    layer = smplx.create(data / "body", "smplx", use_pca=False, flat_hand_mean=False)
    relaxed = layer()
    expected = body(left_hand_pose=body.hand_means[:1], right_hand_pose=body.hand_means[1:])
    assert numpy.array_equal(relaxed.vertices, expected.vertices)
    pca = smplx.create(data / "body", "smplx", use_pca=True, num_pca_comps=2, flat_hand_mean=True)
    weights = numpy.array([[0.5, -0.25]], numpy.float32)
    assert numpy.allclose(pca(left_hand_pose=weights).full_pose[:, 75:120], weights @ components[0][:2])


def test_more_coefficients_are_all_of_the_file(data, tmp_path):
    arrays = dict(numpy.load(data / "body" / "SMPLX_NEUTRAL.npz", allow_pickle=True))
    directions = arrays["shapedirs"]
    wide = numpy.zeros((*directions.shape[:2], 400), directions.dtype)
    wide[:, :, :10], wide[:, :, 11], wide[:, :, 300:310] = directions[:, :, :10], 0.5, directions[:, :, 10:]
    numpy.savez(tmp_path / "SMPLX_NEUTRAL.npz", **{**arrays, "shapedirs": wide})
    betas = numpy.zeros((1, 12), numpy.float32)
    betas[0, 11] = 1
    layer = smplx.create(tmp_path, num_betas=12)
    assert layer.body.shape_coefficients == 300 and layer.body.expression_coefficients == 100
    assert numpy.allclose(layer(betas=betas).vertices - layer().vertices, 0.5, atol=1e-5)
    with pytest.raises(xavatar.ArgumentError, match=r"betas is of shape \(1, 12\)"):
        smplx.create(tmp_path)(betas=betas)


def test_hands_of_another_body_are_refused(tmp_path):
    with pytest.raises(xavatar.MissingError, match="SMPLX_MALE"):
        xavatar.Body.load(tmp_path, "male")
    with pytest.raises(xavatar.ArgumentError, match="neutral, female or male"):
        xavatar.Body.load(tmp_path, "tall")
