//! A body's pose, whatever its family: the rotation of every joint, and what its coefficients are.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use xavatar_formats::{Error, Result};

use super::Skeleton;

/// One joint's rotation relative to its parent: axis times angle, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseAxisAngle(pub Vec3);

/// What a [`BodyModel`](super::BodyModel) is posed by. Every rotation is absolute: what a source says of hands in terms of its
/// model, as offsets from a mean or as components, is resolved before ([`BodyParameters`](super::BodyParameters)).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// The rotation of each joint of the skeleton (J).
    pub rotations: Vec<PoseAxisAngle>,
    /// Shape coefficients beta; those that are left out are zero.
    pub shape: Vec<f32>,
    /// Expression coefficients psi; those that are left out are zero.
    pub expression: Vec<f32>,
    /// Translation added to every vertex, metres.
    pub translation: Vec3,
}

impl Pose {
    /// That it is a pose of a skeleton, with no more coefficients than there are of shape and of expression, and finite.
    ///
    /// # Errors
    /// [`Error::Value`] naming what is not.
    pub fn check(&self, skeleton: &Skeleton, shapes: usize, expressions: usize) -> Result<()> {
        let wrong =
            |name: &str, found: String, expected: String| Err(Error::Value { name: name.into(), found, expected });
        let (found, expected) = (self.rotations.len(), skeleton.joints.len());
        if found != expected {
            let expected = format!("{expected}, for {}", skeleton.description());
            return wrong("the pose", format!("{found} rotations"), expected);
        }
        let coefficients = [("shape", &self.shape, shapes), ("expression", &self.expression, expressions)];
        for (name, given, most) in coefficients {
            if given.len() > most {
                let found = format!("{} coefficients", given.len());
                return wrong(name, found, format!("at most the body's {most}"));
            }
            if let Some(value) = given.iter().find(|value| !value.is_finite()) {
                return wrong(name, value.to_string(), "finite".into());
            }
        }
        let mut rotations = skeleton.joints.iter().zip(&self.rotations).map(|(name, rotation)| (name, rotation.0));
        if let Some((name, rotation)) = rotations.find(|(_, rotation)| !rotation.is_finite()) {
            return wrong(&format!("the rotation of {name}"), rotation.to_string(), "finite".into());
        }
        if !self.translation.is_finite() {
            return wrong("the translation", self.translation.to_string(), "finite".into());
        }
        Ok(())
    }

    /// The same pose of a body of another shape.
    #[must_use]
    pub fn in_shape(&self, shape: &[f32]) -> Self {
        Self { shape: shape.to_vec(), ..self.clone() }
    }
}
