//! The joints of a rig, from an avatar's canonical joints alone: no body model is needed.
//!
//! Local frames are SMPL-X's: axes parallel to the world's in the T-pose, so that a joint's local rotation *is* its SMPL-X
//! rotation, whatever the pose the mesh is bound in. J = 55 joints; metres.

use glam::{Affine3A, Quat, Vec3};

use super::rig::Joint;
use crate::body::{BodyModel, BodyParameters, HandPose, JOINT_NAMES, JOINTS, PARENTS, PoseAxisAngle};
use crate::{Error, InputError, Result};

/// The joints (J) of a skeleton whose canonical joints are at `canonical` (J).
///
/// # Errors
/// Never: the canonical pose is finite, and its hands are flat.
pub(super) fn skeleton(canonical: &[Vec3]) -> Result<Vec<Joint>> {
    let rotations = rotations(&joint_poses(None, &BodyModel::canonical_parameters(&[0.0; 10]))?);
    let mut turns = [Quat::IDENTITY; JOINTS];
    let joint = |joint: usize| {
        let (parent, above) = match joint {
            0 => (None, Quat::IDENTITY),
            _ => (Some(PARENTS[joint]), turns[PARENTS[joint]]),
        };
        turns[joint] = (above * rotations[joint]).normalize();
        let offset = canonical[joint] - parent.map_or(Vec3::ZERO, |parent| canonical[parent]);
        Joint {
            name: JOINT_NAMES[joint],
            parent,
            translation: above.inverse() * offset,
            rotation: rotations[joint],
            inverse_bind: Affine3A::from_rotation_translation(turns[joint], canonical[joint]).inverse(),
        }
    };
    Ok((0..JOINTS).map(joint).collect())
}

/// The local rotations (J) of a pose.
pub(super) fn rotations(poses: &[PoseAxisAngle; JOINTS]) -> [Quat; JOINTS] {
    poses.map(|pose| Quat::from_scaled_axis(pose.0).normalize())
}

/// The absolute rotations of all joints. Without a body model, hands have to be absolute already.
pub(super) fn joint_poses(body: Option<&BodyModel>, parameters: &BodyParameters) -> Result<[PoseAxisAngle; JOINTS]> {
    match (body, &parameters.left_hand_pose, &parameters.right_hand_pose) {
        (Some(body), ..) => Ok(body.joint_poses(parameters)?),
        (None, HandPose::Flat(left), HandPose::Flat(right)) => Ok(parameters.joint_poses(left, right)?),
        (None, ..) => Err(Error::from(InputError::Value {
            name: "the motion's hand pose".into(),
            found: "given relative to the body model's mean hand, and no body model".into(),
            expected: "a body model to know that hand, or hands relative to the flat one".into(),
        })),
    }
}
