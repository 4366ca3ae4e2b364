//! The SMPL-X skeleton: its tree, the canonical pose's rotations, and forward kinematics.
//!
//! G_j = G_parent(j) [R_j | t_j]: each joint turns about its own rest position. Returned transforms are rest -> posed, so
//! that T-pose rotations give identities. J = 55 joints; metres, radians.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use super::PoseAxisAngle;

/// Joints of the SMPL-X skeleton: 22 body, jaw, two eyes, 2 x 15 hand joints.
pub const JOINTS: usize = 55;

/// The parent of each joint; the root is its own parent. Every parent comes before its children.
pub const PARENTS: [usize; JOINTS] = [
    0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15, // body, jaw, eyes
    20, 25, 26, 20, 28, 29, 20, 31, 32, 20, 34, 35, 20, 37, 38, // left index, middle, pinky, ring, thumb
    21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50, 21, 52, 53, // right index, middle, pinky, ring, thumb
];

/// The names of the joints, as in the SMPL-X release.
#[rustfmt::skip]
pub const JOINT_NAMES: [&str; JOINTS] = [
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle", "spine3",
    "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder", "right_shoulder",
    "left_elbow", "right_elbow", "left_wrist", "right_wrist", "jaw", "left_eye", "right_eye", "left_index1",
    "left_index2", "left_index3", "left_middle1", "left_middle2", "left_middle3", "left_pinky1", "left_pinky2",
    "left_pinky3", "left_ring1", "left_ring2", "left_ring3", "left_thumb1", "left_thumb2", "left_thumb3", "right_index1",
    "right_index2", "right_index3", "right_middle1", "right_middle2", "right_middle3", "right_pinky1", "right_pinky2",
    "right_pinky3", "right_ring1", "right_ring2", "right_ring3", "right_thumb1", "right_thumb2", "right_thumb3",
];

/// The rotation matrix of an axis-angle vector.
pub(super) fn rotation(pose: PoseAxisAngle) -> Mat3A {
    let angle = pose.0.length();
    // Below this the quadratic term is under f32's resolution, and the axis is noise.
    if angle < 1e-6 {
        let [x, y, z] = pose.0.to_array();
        return Mat3A::from_cols(Vec3A::new(1.0, z, -y), Vec3A::new(-z, 1.0, x), Vec3A::new(y, -x, 1.0));
    }
    Mat3A::from_axis_angle(pose.0 / angle, angle)
}

/// The rest -> posed transform of each joint (J) from the rest positions and the rotations relative to the parents.
pub(super) fn bone_transforms(rest: &[Vec3; JOINTS], rotations: &[Mat3A; JOINTS]) -> Vec<Affine3A> {
    let mut transforms: Vec<Affine3A> = Vec::with_capacity(JOINTS);
    for joint in 0..JOINTS {
        let pivot = Vec3A::from(rest[joint]);
        let turn = Affine3A { matrix3: rotations[joint], translation: pivot - rotations[joint] * pivot };
        transforms.push(if joint == 0 { turn } else { transforms[PARENTS[joint]] * turn });
    }
    transforms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_before_their_children() {
        assert!((1..JOINTS).all(|joint| PARENTS[joint] < joint));
    }

    #[test]
    fn small_rotations_are_continuous() {
        for angle in [0.0, 0.5e-6, 0.999e-6, 1.001e-6, 2e-6] {
            let axis = Vec3::new(0.6, 0.0, 0.8);
            let matrix = rotation(PoseAxisAngle(axis * angle));
            let turned = matrix * Vec3A::Y;
            assert!((turned - Vec3A::from(Vec3::Y + angle * axis.cross(Vec3::Y))).length() < 1e-7);
        }
    }

    #[test]
    fn a_turned_joint_moves_only_its_descendants_and_keeps_its_own_place() {
        let rest: [Vec3; JOINTS] =
            std::array::from_fn(|joint| Vec3::new(joint as f32, (joint * joint % 7) as f32, 0.5));
        let mut rotations = [Mat3A::IDENTITY; JOINTS];
        rotations[16] = rotation(PoseAxisAngle(Vec3::new(0.3, -0.8, 0.4)));
        let transforms = bone_transforms(&rest, &rotations);
        assert!((transforms[16].transform_point3(rest[16]) - rest[16]).length() < 1e-4);
        for (joint, transform) in transforms.iter().enumerate() {
            let mut ancestor = joint;
            while ancestor > 16 {
                ancestor = PARENTS[ancestor];
            }
            let descends = ancestor == 16;
            assert_eq!(*transform != Affine3A::IDENTITY, descends, "joint {joint}");
        }
    }
}
