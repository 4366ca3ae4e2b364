//! SMPL-X parameters, with their conventions as types.
//!
//! theta = global 3 + body 63 (21 joints) + jaw 3 + left eye 3 + right eye 3 + hands 45 + 45; beta 10; psi 10.

use glam::Vec3;

use super::skeleton::JOINTS;
use xavatar_formats::{Error, Result};

/// One joint's rotation relative to its parent: axis times angle, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseAxisAngle(pub Vec3);

/// One hand's pose, in the convention of its source. A wrong convention cannot be passed silently.
#[derive(Clone, Debug, PartialEq)]
pub enum HandPose {
    /// Absolute joint rotations: zero is the flat hand (`flat_hand_mean=True`).
    Flat([PoseAxisAngle; 15]),
    /// Offsets from the model's `hands_mean{l,r}`: zero is the relaxed hand (`flat_hand_mean=False`, X-Humans).
    RelativeToMean([PoseAxisAngle; 15]),
    /// Coefficients of the first rows of `hands_components{l,r}`, relative to the mean.
    Pca(Vec<f32>),
}

impl Default for HandPose {
    fn default() -> Self {
        Self::Flat(Default::default())
    }
}

/// One frame of SMPL-X parameters. `Default` is the T-pose with flat hands.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyParameters {
    /// Shape coefficients beta (10).
    pub betas: [f32; 10],
    /// Expression coefficients psi (10).
    pub expression: [f32; 10],
    /// Rotation of the root.
    pub global_orient: PoseAxisAngle,
    /// Rotations of joints 1..=21.
    pub body_pose: [PoseAxisAngle; 21],
    /// Rotation of the jaw (joint 22).
    pub jaw_pose: PoseAxisAngle,
    /// Rotation of the left eye (joint 23).
    pub left_eye_pose: PoseAxisAngle,
    /// Rotation of the right eye (joint 24).
    pub right_eye_pose: PoseAxisAngle,
    /// Left hand (joints 25..=39).
    pub left_hand_pose: HandPose,
    /// Right hand (joints 40..=54).
    pub right_hand_pose: HandPose,
    /// Translation added to every vertex, metres.
    pub transl: Vec3,
}

impl BodyParameters {
    /// The rotation of each joint (J), with these absolute rotations of the hands' joints.
    ///
    /// # Errors
    /// [`Error::Value`] if a parameter is not finite.
    pub fn joint_poses(
        &self,
        left_hand: &[PoseAxisAngle; 15],
        right_hand: &[PoseAxisAngle; 15],
    ) -> Result<[PoseAxisAngle; JOINTS]> {
        require_finite("betas", &self.betas)?;
        require_finite("expression", &self.expression)?;
        require_finite("transl", &self.transl.to_array())?;
        let poses: [PoseAxisAngle; JOINTS] = std::array::from_fn(|joint| match joint {
            0 => self.global_orient,
            1..=21 => self.body_pose[joint - 1],
            22 => self.jaw_pose,
            23 => self.left_eye_pose,
            24 => self.right_eye_pose,
            25..=39 => left_hand[joint - 25],
            _ => right_hand[joint - 40],
        });
        for (joint, pose) in poses.iter().enumerate() {
            require_finite(&format!("the rotation of joint {joint}"), &pose.0.to_array())?;
        }
        Ok(poses)
    }
}

fn require_finite(name: &str, values: &[f32]) -> Result<()> {
    match values.iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) => Err(Error::Value { name: name.into(), found: value.to_string(), expected: "finite".into() }),
    }
}
