"""Writes three frames of one motion in the layout of each source (numpy and joblib needed)."""
import joblib
import numpy as np

rows = 3
poses = (np.arange(rows * 165).reshape(rows, 165) % 97 - 48) / 100.0
transl = np.arange(rows * 3.0).reshape(rows, 3)
expression = np.arange(rows * 10.0).reshape(rows, 10) / 10
hand = np.arange(rows * 24.0).reshape(rows, 24) / 24

np.savez(
    "amass.npz",
    gender="neutral",
    surface_model_type="smplx",
    mocap_frame_rate=120.0,
    latent_labels=np.array(["ARIEL", "C7"]),
    markers_latent_vids={"ARIEL": 9011, "C7": 3832},
    trans=transl,
    poses=np.asfortranarray(poses),
    betas=np.arange(16.0) / 16,
    root_orient=poses[:, :3],
)

f4 = lambda array: array.astype(np.float32)
parameters = {
    "transl": f4(transl),
    "global_orient": f4(poses[:, :3]),
    "body_pose": f4(poses[:, 3:66]),
    "jaw_pose": f4(poses[:, 66:69]),
    "leye_pose": f4(poses[:, 69:72]),
    "reye_pose": f4(poses[:, 72:75]),
    "left_hand_pose": f4(hand),
    "right_hand_pose": f4(-hand),
    "fullpose": f4(poses),
    "expression": f4(expression),
}
np.savez(
    "grab.npz",
    gender="male",
    framerate=120.0,
    n_frames=rows,
    body={"params": parameters, "vtemp": "tools/subject_meshes/male/s1.ply"},
    object={"params": {"transl": f4(transl)}, "object_mesh": "cup.ply"},
    contact={"body": np.zeros((rows, 4), np.int8)},
)

np.savez_compressed("own.npz", body_pose=poses[:, 3:66], transl=transl.astype(np.float16), betas=np.arange(10.0))

# SMPLer-X: a file a frame, (joints, 3), in camera coordinates: turned by pi about x.
camera = poses[1].copy()
camera[:3] = [np.pi, 0, 0]
np.savez(
    "smpler_x.npz",
    global_orient=f4(camera[None, :3]),
    body_pose=f4(camera[3:66].reshape(-1, 3)),
    left_hand_pose=f4(camera[75:120].reshape(-1, 3)),
    right_hand_pose=f4(camera[120:165].reshape(-1, 3)),
    jaw_pose=f4(camera[None, 66:69]),
    leye_pose=np.zeros((1, 3)),
    reye_pose=np.zeros((1, 3)),
    betas=f4(np.arange(10.0)[None]),
    expression=f4(expression[1][None]),
    transl=f4(transl[1][None]),
)


def matrices(vectors):
    """Rotation matrices (T, joints, 3, 3) of vectors (T, 3 joints), by Rodrigues' formula."""
    vectors = vectors.reshape(len(vectors), -1, 3)
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)[..., None]
    x, y, z = np.moveaxis(vectors / np.maximum(angle[..., 0], 1e-12), -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*x.shape, 3, 3)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


# PyMAF-X: batches of rotation matrices, the root's with the body's, dumped by joblib.
upright = poses.copy()
upright[:, :3] = [np.pi, 0, 0]
batch = lambda rows: {
    "shape": f4(np.zeros((len(rows), 10))),
    "body_pose": f4(matrices(rows[:, :66])),
    "left_hand_pose": f4(matrices(rows[:, 75:120])),
    "right_hand_pose": f4(matrices(rows[:, 120:165])),
    "jaw_pose": f4(matrices(rows[:, 66:69])),
    "leye_pose": f4(matrices(rows[:, 69:72])),
    "reye_pose": f4(matrices(rows[:, 72:75])),
    "expression": f4(np.ones((len(rows), 10))),
}
pymaf = {"pred_cam": np.zeros((3, 3)), "smplx_params": [batch(upright[:2]), batch(upright[2:])], "frame_ids": np.arange(3)}
joblib.dump(pymaf, "pymaf_x.pkl")
