//! What a browser asks for: `{"parameters": {…}, "resolution": 128}`, rotations as axis times angle, hands absolute.

use glam::Vec3;
use serde::Deserialize;

use super::site::LARGEST_RESOLUTION;
use crate::body::{BodyParameters, HandPose, PoseAxisAngle};
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
    parameters: PoseParameters,
    /// Cells along the longest side of the box around the body.
    pub(super) resolution: usize,
}

/// SMPL-X parameters; those that are absent are zero. The shape is the avatar's own.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
struct PoseParameters {
    global_orient: [f32; 3],
    body_pose: [[f32; 3]; 21],
    jaw_pose: [f32; 3],
    left_eye_pose: [f32; 3],
    right_eye_pose: [f32; 3],
    left_hand_pose: [[f32; 3]; 15],
    right_hand_pose: [[f32; 3]; 15],
    expression: [f32; 10],
    transl: [f32; 3],
}

impl PoseRequest {
    /// Reads a request's body.
    ///
    /// # Errors
    /// [`Error::Value`] naming what is wrong.
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

    /// The body's parameters.
    pub(super) fn body_parameters(&self) -> BodyParameters {
        let turn = |vector: [f32; 3]| PoseAxisAngle(Vec3::from(vector));
        let parameters = &self.parameters;
        BodyParameters {
            betas: [0.0; 10],
            expression: parameters.expression,
            global_orient: turn(parameters.global_orient),
            body_pose: parameters.body_pose.map(turn),
            jaw_pose: turn(parameters.jaw_pose),
            left_eye_pose: turn(parameters.left_eye_pose),
            right_eye_pose: turn(parameters.right_eye_pose),
            left_hand_pose: HandPose::Flat(parameters.left_hand_pose.map(turn)),
            right_hand_pose: HandPose::Flat(parameters.right_hand_pose.map(turn)),
            transl: parameters.transl.into(),
        }
    }

    fn check(&self) -> Result<()> {
        let parameters = &self.parameters;
        let single =
            [parameters.global_orient, parameters.jaw_pose, parameters.left_eye_pose, parameters.right_eye_pose];
        let hands = parameters.left_hand_pose.iter().chain(&parameters.right_hand_pose);
        let rotations = single.iter().chain(&parameters.body_pose).chain(hands).flatten();
        within("a rotation", rotations, LARGEST_ANGLE)?;
        within("an expression coefficient", parameters.expression.iter(), LARGEST_EXPRESSION)?;
        within("the translation", parameters.transl.iter(), FARTHEST)?;
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

    #[test]
    fn absent_parameters_are_zero_and_present_ones_arrive() {
        let request =
            PoseRequest::parse(br#"{"parameters": {"jaw_pose": [0.2, 0, 0], "transl": [0, 1, 0]}, "resolution": 64}"#);
        let request = request.unwrap();
        let expected =
            BodyParameters { jaw_pose: PoseAxisAngle(Vec3::X * 0.2), transl: Vec3::Y, ..BodyParameters::default() };
        assert_eq!(request.body_parameters(), expected);
        assert_eq!(request.resolution, 64);
    }

    #[test]
    fn what_cannot_be_posed_is_named() {
        for (body, word) in [
            (r#"{"resolution": 64}"#, "parameters"),
            (r#"{"parameters": {}, "resolution": 4096}"#, "resolution is 4096"),
            (r#"{"parameters": {}, "resolution": -1}"#, "body"),
            (r#"{"parameters": {"jaw": [0, 0, 0]}, "resolution": 64}"#, "jaw"),
            (r#"{"parameters": {"jaw_pose": [0, 0]}, "resolution": 64}"#, "body"),
            (r#"{"parameters": {"jaw_pose": [1e9, 0, 0]}, "resolution": 64}"#, "rotation"),
            (r#"{"parameters": {"jaw_pose": [1e99, 0, 0]}, "resolution": 64}"#, "rotation is inf"),
            (r#"{"parameters": {"expression": [0,0,0,0,0,0,0,0,0,99]}, "resolution": 64}"#, "expression"),
            ("[", "body"),
        ] {
            let message = PoseRequest::parse(body.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(word), "{body}: {message}");
        }
    }
}
