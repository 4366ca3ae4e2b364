//! The joints of a rig, from an avatar's skeleton alone: no body model is needed.
//!
//! Local frames have axes parallel to the world's in the rest pose, so that a joint's local rotation *is* its rotation in a pose,
//! whatever the pose the mesh is bound in. J joints; metres.

use glam::{Affine3A, Quat, Vec3};

use super::rig::Joint;
use crate::body::{PoseAxisAngle, Skeleton};

/// The joints (J) of a skeleton whose canonical joints are at `canonical` (J).
pub(super) fn joints(skeleton: &Skeleton, canonical: &[Vec3]) -> Vec<Joint> {
    let rotations = rotations(&skeleton.canonical);
    let parts = skeleton.parts_of_joints();
    let mut turns: Vec<Quat> = Vec::with_capacity(rotations.len());
    let joint = |joint: usize| {
        let parent = skeleton.parents[joint];
        let above = parent.map_or(Quat::IDENTITY, |parent| turns[parent]);
        let turn = (above * rotations[joint]).normalize();
        turns.push(turn);
        let offset = canonical[joint] - parent.map_or(Vec3::ZERO, |parent| canonical[parent]);
        Joint {
            name: skeleton.joints[joint].clone(),
            part: parts[joint].index(),
            parent,
            translation: above.inverse() * offset,
            scale: 1.0,
            rotation: rotations[joint],
            inverse_bind: Affine3A::from_rotation_translation(turn, canonical[joint]).inverse(),
        }
    };
    (0..rotations.len()).map(joint).collect()
}

/// The local rotations (J) of a pose.
pub(super) fn rotations(poses: &[PoseAxisAngle]) -> Vec<Quat> {
    poses.iter().map(|pose| Quat::from_scaled_axis(pose.0).normalize()).collect()
}
