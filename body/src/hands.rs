//! Hand poses in the conventions of the families that have hands (SMPL+H, SMPL-X, MANO), and what a model knows to resolve them.

use glam::Vec3;

use super::PoseAxisAngle;
use xavatar_formats::{Error, Result};

/// Joints of one hand.
pub(super) const HAND_JOINTS: usize = 15;
/// Components of their rotations.
pub(super) const HAND_COMPONENTS: usize = 3 * HAND_JOINTS;

/// Rotations of the joints of one hand: three each of index, middle, little and ring finger and thumb, from the palm on.
pub type Fingers = [PoseAxisAngle; HAND_JOINTS];

/// One hand's pose, in the convention of its source. A wrong convention cannot be passed silently.
#[derive(Clone, Debug, PartialEq)]
pub enum HandPose {
    /// Absolute joint rotations: zero is the flat hand (`flat_hand_mean=True`).
    Flat(Fingers),
    /// Offsets from the model's `hands_mean{l,r}`: zero is the relaxed hand (`flat_hand_mean=False`, X-Humans).
    RelativeToMean(Fingers),
    /// Coefficients of the first rows of `hands_components{l,r}`, relative to the mean.
    Pca(Vec<f32>),
}

impl Default for HandPose {
    fn default() -> Self {
        Self::Flat(Default::default())
    }
}

/// The pose space of one hand.
#[derive(Clone, Debug)]
pub struct HandSpace {
    /// The relaxed hand, axis-angle of its joints.
    pub mean: [f32; HAND_COMPONENTS],
    /// Principal components, one a row.
    pub components: Vec<[f32; HAND_COMPONENTS]>,
}

impl HandSpace {
    /// The absolute rotations of the hand's joints; `name` is the pose's in messages.
    pub(super) fn rotations(&self, name: &str, pose: &HandPose) -> Result<Fingers> {
        let mut values = self.mean;
        match pose {
            HandPose::Flat(rotations) => return Ok(*rotations),
            HandPose::RelativeToMean(rotations) => {
                for (joint, rotation) in rotations.iter().enumerate() {
                    for axis in 0..3 {
                        values[joint * 3 + axis] += rotation.0[axis];
                    }
                }
            }
            HandPose::Pca(coefficients) => {
                if coefficients.len() > self.components.len() {
                    return Err(Error::Value {
                        name: name.into(),
                        found: format!("{} PCA coefficients", coefficients.len()),
                        expected: format!("at most {}, the components of the model", self.components.len()),
                    });
                }
                for (coefficient, component) in coefficients.iter().zip(&self.components) {
                    for index in 0..HAND_COMPONENTS {
                        values[index] += coefficient * component[index];
                    }
                }
            }
        }
        Ok(std::array::from_fn(|joint| PoseAxisAngle(Vec3::from_slice(&values[joint * 3..]))))
    }
}
