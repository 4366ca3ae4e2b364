//! What is known of the built-in subject, for verbs that have to find it: landmarks that are a little off, and how far a body is from the true one.

use serde_json::{Value, json};
use xavatar::body::BodyParameters;
use xavatar::data::Split;
use xavatar::synthetic::BuiltInSubject;

/// The joints that landmarks are given of.
pub(super) const SEEN: [&str; 16] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "neck",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_eye",
];

/// Rows of `landmarks.json` for a frame: the named joints, up to `most` metres off along each axis, in units of so many a metre.
pub(super) fn landmarks(
    subject: &BuiltInSubject,
    parameters: &BodyParameters,
    frame: usize,
    names: &[&str],
    (most, units): (f32, f32),
) -> Value {
    let model = subject.model();
    let joints = model.pose(&model.resolve(parameters).unwrap()).unwrap().joints;
    let row = |(place, name): (usize, &&str)| {
        let joint = joints[model.skeleton().joint(name).unwrap()];
        let along = |axis: usize| units * (joint[axis] + most * ((place * 7 + frame * 3 + axis * 5) as f32).sin());
        json!([along(0), along(1), along(2), 1.0])
    };
    names.iter().enumerate().map(row).collect()
}

/// The mean distance between a registered body's vertices and the true one's of a frame of a take, millimetres.
pub(super) fn error(subject: &BuiltInSubject, parameters: &BodyParameters, frame: usize, frames: usize) -> f32 {
    let body = subject.model();
    let expected = subject.parameters(Split::Train, frame, frames).unwrap().into();
    let [found, expected] =
        [parameters, &expected].map(|parameters| body.pose(&body.resolve(parameters).unwrap()).unwrap().vertices);
    1e3 * found.iter().zip(&expected).map(|(found, expected)| found.distance(*expected)).sum::<f32>()
        / found.len() as f32
}
