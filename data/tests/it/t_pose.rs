//! The skeleton of the fixtures' BVH files: which of its bones are which joints, and where they lie in its T-pose.

use glam::DVec3;

/// How far rotations that are meant to be the same may be apart, degrees.
pub const CLOSE: f64 = 2.0;

/// Bones of the T-pose's file that have a joint.
pub const BONES: [(&str, &str); 22] = [
    ("Hips", "pelvis"),
    ("Spine", "spine1"),
    ("Spine1", "spine2"),
    ("Spine2", "spine3"),
    ("Neck", "neck"),
    ("Head", "head"),
    ("LeftShoulder", "left_collar"),
    ("LeftArm", "left_shoulder"),
    ("LeftForeArm", "left_elbow"),
    ("LeftHand", "left_wrist"),
    ("RightShoulder", "right_collar"),
    ("RightArm", "right_shoulder"),
    ("RightForeArm", "right_elbow"),
    ("RightHand", "right_wrist"),
    ("LeftUpLeg", "left_hip"),
    ("LeftLeg", "left_knee"),
    ("LeftFoot", "left_ankle"),
    ("LeftToeBase", "left_foot"),
    ("RightUpLeg", "right_hip"),
    ("RightLeg", "right_knee"),
    ("RightFoot", "right_ankle"),
    ("RightToeBase", "right_foot"),
];

/// The number of a joint.
pub fn joint(name: &str) -> usize {
    xavatar_body::smplx::skeleton().joint(name).unwrap()
}

/// The joint of a bone.
pub fn joint_of(bone: &str) -> usize {
    joint(BONES.iter().find(|(name, _)| *name == bone).unwrap().1)
}

/// The direction of a bone in the T-pose's file.
pub fn direction(bone: &str) -> DVec3 {
    match bone {
        "LeftShoulder" | "LeftArm" | "LeftForeArm" | "LeftHand" => DVec3::X,
        "RightShoulder" | "RightArm" | "RightForeArm" | "RightHand" => DVec3::NEG_X,
        "LeftUpLeg" | "LeftLeg" | "RightUpLeg" | "RightLeg" => DVec3::NEG_Y,
        "LeftFoot" | "RightFoot" | "LeftToeBase" | "RightToeBase" => DVec3::new(0.0, -6.0, 14.0).normalize(),
        _ => DVec3::Y,
    }
}
