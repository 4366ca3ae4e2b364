"""Writes amass.npz, grab.npz and own.npz: three frames of one motion in the layout of each source (numpy needed)."""
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
