"""Beside PyPI smplx and torch on the same file: vertices and joints to 1e-5 m, gradients to 1e-5 of the largest, in double precision both.

In single precision both sum in an order of their own, and gradients differ by 1e-4 of themselves. Skipped where either is absent."""

import numpy
import pytest

import xavatar
import xavatar.smplx

torch = pytest.importorskip("torch")
smplx = pytest.importorskip("smplx")

FRAMES = 4
SIZES = {
    "betas": 10,
    "expression": 10,
    "global_orient": 3,
    "body_pose": 63,
    "jaw_pose": 3,
    "leye_pose": 3,
    "reye_pose": 3,
    "left_hand_pose": 45,
    "right_hand_pose": 45,
    "transl": 3,
}


@pytest.fixture(scope="module")
def folder(data, tmp_path_factory):
    """The model's file with the landmarks that smplx insists on."""
    folder = tmp_path_factory.mktemp("models")
    arrays = dict(numpy.load(data / "body" / "SMPLX_NEUTRAL.npz", allow_pickle=True))
    # smplx counts expressions from column 300 on where a file has fewer than 400 shapes.
    arrays.setdefault("lmk_faces_idx", numpy.zeros(51, numpy.int64))
    arrays.setdefault("lmk_bary_coords", numpy.full((51, 3), 1 / 3))
    arrays.setdefault("dynamic_lmk_faces_idx", numpy.zeros((79, 17), numpy.int64))
    arrays.setdefault("dynamic_lmk_bary_coords", numpy.full((79, 17, 3), 1 / 3))
    numpy.savez(folder / "SMPLX_NEUTRAL.npz", **arrays)
    return folder


@pytest.fixture(scope="module")
def parameters():
    generator = torch.Generator().manual_seed(3)
    return {name: 0.3 * torch.randn(FRAMES, size, generator=generator, dtype=torch.float64) for name, size in SIZES.items()}


def gradients_of(model, parameters):
    """Vertices, joints of the skeleton, and the gradients of a weighted sum of both."""
    leaves = {name: value.clone().requires_grad_() for name, value in parameters.items()}
    output = model(**leaves)
    joints = output.joints[:, :55]
    generator = torch.Generator().manual_seed(4)
    weights = [torch.randn(array.shape, generator=generator, dtype=array.dtype) for array in (output.vertices, joints)]
    ((weights[0] * output.vertices).sum() + (weights[1] * joints).sum()).backward()
    return output.vertices.detach(), joints.detach(), {name: leaf.grad for name, leaf in leaves.items()}


@pytest.mark.parametrize("options", [{"flat_hand_mean": True}, {"flat_hand_mean": False}])
def test_bodies_and_gradients_are_those_of_smplx(folder, parameters, options):
    sizes = {"num_betas": 10, "num_expression_coeffs": 10, "batch_size": FRAMES}
    theirs = smplx.SMPLX(str(folder), use_pca=False, dtype=torch.float64, **sizes, **options)
    ours = xavatar.smplx.create(folder, "smplx", use_pca=False, **options)
    expected, found = gradients_of(theirs, parameters), gradients_of(ours, parameters)
    assert torch.allclose(found[0], expected[0], rtol=0, atol=1e-5)
    assert torch.allclose(found[1], expected[1], rtol=0, atol=1e-5)
    for name, gradient in expected[2].items():
        assert (found[2][name] - gradient).abs().max() <= 1e-5 * gradient.abs().max(), name


def test_components_of_hands_are_those_of_smplx(folder):
    hands = {name: torch.tensor([[0.7, -0.4]]) for name in ("left_hand_pose", "right_hand_pose")}
    theirs = smplx.SMPLX(str(folder), use_pca=True, num_pca_comps=2, num_betas=10, num_expression_coeffs=10)(**hands)
    ours = xavatar.smplx.create(folder, "smplx", num_pca_comps=2)(**hands)
    assert torch.allclose(ours.vertices, theirs.vertices, rtol=0, atol=1e-5)


# gradcheck compares with differences in double precision.
def test_gradients_pass_the_check_of_torch(body):
    generator = torch.Generator().manual_seed(5)
    pose = (0.3 * torch.randn(1, 3, generator=generator, dtype=torch.float64)).requires_grad_()
    some = torch.arange(0, len(body.template), 997)

    def corner(jaw, betas):
        return body(jaw_pose=jaw, betas=betas).vertices[:, some]

    betas = torch.zeros(1, 10, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(corner, (pose, betas), eps=1e-6, atol=1e-6)
