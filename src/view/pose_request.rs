//! What a browser asks for: `{"pose": {"rotations": {"jaw": [0.3, 0, 0]}}, "resolution": 128}`, rotations by the joints' names, as
//! axis times angle.

use std::collections::BTreeMap;

use glam::Vec3;
use serde::Deserialize;

use super::site::LARGEST_RESOLUTION;
use crate::avatar::Subject;
use crate::body::Pose;
use crate::{Error, InputError, Result};

/// Least cells along the longest side.
const SMALLEST_RESOLUTION: usize = 16;
/// Longest rotation vector, radians: three turns are no mistake, a thousand are.
const LARGEST_ANGLE: f32 = 20.0;
/// Largest expression coefficient: standard deviations.
const LARGEST_EXPRESSION: f32 = 10.0;
/// Farthest translation, metres.
const FARTHEST: f32 = 1000.0;

/// A pose, and how finely its surface is wanted.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PoseRequest {
    pose: NamedPose,
    /// Cells along the longest side of the box around the body.
    pub(super) resolution: usize,
}

/// A pose of any skeleton; what is absent is zero. The shape is the avatar's own.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
struct NamedPose {
    rotations: BTreeMap<String, [f32; 3]>,
    expression: Vec<f32>,
    translation: [f32; 3],
}

impl PoseRequest {
    /// Reads a request's body.
    ///
    /// # Errors
    /// [`InputError::Value`] naming what is wrong.
    pub fn parse(body: &[u8]) -> Result<Self> {
        let request: Self = serde_json::from_slice(body).map_err(|error| {
            Error::from(InputError::Value {
                name: "the request's body".into(),
                found: error.to_string(),
                expected: "JSON as docs/report.md has it".into(),
            })
        })?;
        request.check()?;
        Ok(request)
    }

    /// The pose of a subject's body.
    ///
    /// # Errors
    /// [`InputError::Value`] naming a joint that the body does not have, or that there are too many coefficients.
    pub(super) fn pose(&self, subject: &Subject) -> Result<Pose> {
        let NamedPose { rotations, expression, translation } = &self.pose;
        let turns = rotations.iter().map(|(name, turn)| (name.as_str(), Vec3::from(*turn)));
        let pose = subject.skeleton.turned(turns)?;
        if expression.len() > subject.expressions {
            return Err(Error::from(InputError::Value {
                name: "number of expression coefficients".into(),
                found: expression.len().to_string(),
                expected: format!("at most {}", subject.expressions),
            }));
        }
        Ok(Pose { expression: expression.clone(), translation: (*translation).into(), ..pose })
    }

    fn check(&self) -> Result<()> {
        within("a rotation", self.pose.rotations.values().flatten(), LARGEST_ANGLE)?;
        within("an expression coefficient", self.pose.expression.iter(), LARGEST_EXPRESSION)?;
        within("the translation", self.pose.translation.iter(), FARTHEST)?;
        if !(SMALLEST_RESOLUTION..=LARGEST_RESOLUTION).contains(&self.resolution) {
            return Err(Error::from(InputError::Value {
                name: "resolution".into(),
                found: self.resolution.to_string(),
                expected: format!("{SMALLEST_RESOLUTION} to {LARGEST_RESOLUTION} cells"),
            }));
        }
        Ok(())
    }
}

fn within<'a>(name: &str, mut values: impl Iterator<Item = &'a f32>, limit: f32) -> Result<()> {
    match values.find(|value| value.is_nan() || value.abs() > limit) {
        None => Ok(()),
        Some(value) => Err(Error::from(InputError::Value {
            name: name.into(),
            found: value.to_string(),
            expected: format!("-{limit} to {limit}"),
        })),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Gender, PoseAxisAngle, smplx};

    fn subject() -> Subject {
        let skeleton = smplx::skeleton().clone();
        Subject {
            gender: Gender::Neutral,
            betas: Vec::new(),
            expressions: 2,
            joints: vec![Vec3::ZERO; skeleton.joints.len()],
            skeleton,
            bounds: (Vec3::NEG_ONE, Vec3::ONE),
            frames: 0,
        }
    }

    #[test]
    fn absent_numbers_are_zero_and_present_ones_arrive() {
        let request = br#"{"pose": {"rotations": {"jaw": [0.2, 0, 0]}, "translation": [0, 1, 0]}, "resolution": 64}"#;
        let request = PoseRequest::parse(request).unwrap();
        let mut expected = Pose { translation: Vec3::Y, ..smplx::skeleton().rest_pose() };
        expected.rotations[22] = PoseAxisAngle(Vec3::X * 0.2);
        assert_eq!(request.pose(&subject()).unwrap(), expected);
        assert_eq!(request.resolution, 64);
    }

    #[test]
    fn what_cannot_be_posed_is_named() {
        for (body, word) in [
            (r#"{"resolution": 64}"#, "pose"),
            (r#"{"pose": {}, "resolution": 4096}"#, "resolution is 4096"),
            (r#"{"pose": {}, "resolution": -1}"#, "body"),
            (r#"{"pose": {"jaw": [0, 0, 0]}, "resolution": 64}"#, "jaw"),
            (r#"{"pose": {"rotations": {"jaw": [0, 0]}}, "resolution": 64}"#, "body"),
            (r#"{"pose": {"rotations": {"jaw": [1e9, 0, 0]}}, "resolution": 64}"#, "rotation"),
            (r#"{"pose": {"rotations": {"jaw": [1e99, 0, 0]}}, "resolution": 64}"#, "rotation is inf"),
            (r#"{"pose": {"expression": [0, 99]}, "resolution": 64}"#, "expression"),
            (r#"{"pose": {"expression": [0, 0, 0]}, "resolution": 64}"#, "coefficients is 3, expected at most 2"),
            (r#"{"pose": {"rotations": {"tail": [0, 0, 0]}}, "resolution": 64}"#, "is tail, expected one of pelvis, "),
            ("[", "body"),
        ] {
            let message = PoseRequest::parse(body.as_bytes()).and_then(|request| request.pose(&subject())).unwrap_err();
            assert!(message.to_string().contains(word), "{body}: {message}");
        }
    }
}
