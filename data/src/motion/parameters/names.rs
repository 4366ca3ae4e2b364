//! The names that tools have for the same parameters (docs/motion.md).

use crate::motion::Coordinates;

/// A name, and what its numbers are relative to, where it says so.
pub(super) type Name = (&'static str, Option<Coordinates>);

const CAMERA: Option<Coordinates> = Some(Coordinates::Camera);
const WORLD: Option<Coordinates> = Some(Coordinates::World);

/// The rotations of the body alone.
pub(super) const BODY: &[Name] = &[
    // Beside it, `body_pose` may be a code.
    ("body_pose_axis", None),
    ("body_pose", None),
    ("smplx_body_pose", None),
    ("pose_body", None),
    ("poses_body", None),
    ("smpl_body_pose", None),
    ("pred_body_pose", None),
];
/// Those of all joints of a model, of SMPL, SMPL+H or SMPL-X, with the root's or without.
pub(super) const POSE: &[Name] = &[
    ("pose_world", WORLD),
    ("poses", None),
    ("pose", None),
    ("smpl_poses", None),
    ("smpl_pose", None),
    ("smplx_pose", None),
    ("full_pose", None),
    ("fullpose", None),
    ("smpl_thetas", None),
    ("thetas", None),
    ("theta", None),
    ("pred_pose", None),
    ("pred_thetas", None),
    ("pred_theta_mats", None),
    ("pred_rotmat", None),
];
pub(super) const ROOT: &[Name] = &[
    ("smpl_orient_world", WORLD),
    ("smpl_orient_cam", CAMERA),
    ("world_global_rots", WORLD),
    ("global_orient", None),
    ("smplx_global_orient", None),
    ("smpl_global_orient", None),
    ("pred_global_orient", None),
    ("smplx_root_pose", None),
    ("root_pose", None),
    ("root_orient", None),
    ("poses_root", None),
    ("global_orientation", None),
    ("Rh", None),
];
pub(super) const LEFT_HAND: &[Name] = &[
    ("left_hand_pose", None),
    ("smplx_lhand_pose", None),
    ("lhand_pose", None),
    ("pose_lhand", None),
    ("left_hand", None),
    ("pred_left_hand_pose", None),
];
pub(super) const RIGHT_HAND: &[Name] = &[
    ("right_hand_pose", None),
    ("smplx_rhand_pose", None),
    ("rhand_pose", None),
    ("pose_rhand", None),
    ("right_hand", None),
    ("pred_right_hand_pose", None),
];
/// Both hands', left before right.
pub(super) const HANDS: &[Name] = &[("pose_hand", None), ("hand_pose", None)];
pub(super) const JAW: &[Name] = &[("jaw_pose", None), ("smplx_jaw_pose", None), ("pose_jaw", None)];
pub(super) const LEFT_EYE: &[Name] = &[("leye_pose", None), ("left_eye_pose", None), ("smplx_leye_pose", None)];
pub(super) const RIGHT_EYE: &[Name] = &[("reye_pose", None), ("right_eye_pose", None), ("smplx_reye_pose", None)];
pub(super) const EXPRESSION: &[Name] = &[
    ("expression", None),
    ("expressions", None),
    ("smplx_expr", None),
    ("smplx_expression", None),
    ("face_expr", None),
    ("expr", None),
    ("exp", None),
];
pub(super) const BETAS: &[Name] =
    &[("betas", None), ("smplx_shape", None), ("smplx_betas", None), ("smpl_betas", None), ("shape", None)];
pub(super) const TRANSLATION: &[Name] = &[
    ("trans_world", WORLD),
    ("world_trans", WORLD),
    // Of the whole picture's camera; beside it, `transl` is of a part's.
    ("transl_camsys", CAMERA),
    ("transl", None),
    ("trans", None),
    ("smplx_transl", None),
    ("smpl_trans", None),
    ("translation", None),
    ("pred_trans", None),
    ("global_t", None),
    ("Th", None),
    ("cam_trans", CAMERA),
];
/// Where the pelvis is, not by how much the body is moved.
pub(super) const PELVIS: &[Name] = &[("root_trans_world", WORLD), ("root_trans_cam", CAMERA)];
pub(in crate::motion) const RATE: [&str; 5] =
    ["frames_per_second", "fps", "mocap_frame_rate", "mocap_framerate", "frame_rate"];
/// Whether hand vectors are absolute.
pub(super) const FLAT_HANDS: &str = "flat_hand_mean";

/// Whether an array of this name has a body's rotations.
pub(super) fn is_body(name: &str) -> bool {
    BODY.iter().chain(POSE).any(|(known, _)| *known == name)
}

/// The first name that says nothing else, for messages.
pub(super) fn plain(names: &[Name]) -> &'static str {
    names.iter().find(|(_, coordinates)| coordinates.is_none()).map_or("", |(name, _)| name)
}

/// The names, quoted and joined.
pub(super) fn quoted(names: &[Name]) -> String {
    names.iter().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
