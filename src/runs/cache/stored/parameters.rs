//! Body parameters as arrays, hands in the convention that they came in.

use super::{Stored, rows};
use crate::body::{BodyParameters, HandPose, PoseAxisAngle};
use crate::formats::{Array, ArrayMap, Result};

pub(super) fn insert(arrays: &mut ArrayMap, parameters: &BodyParameters) {
    let joints = [parameters.global_orient].into_iter().chain(parameters.body_pose).chain([
        parameters.jaw_pose,
        parameters.left_eye_pose,
        parameters.right_eye_pose,
    ]);
    arrays.extend([
        ("transl".to_owned(), rows([parameters.transl])),
        ("betas".to_owned(), Array::from_f32(&[10], parameters.betas.to_vec())),
        ("expression".to_owned(), Array::from_f32(&[10], parameters.expression.to_vec())),
        ("joints".to_owned(), rows(joints.map(|joint| joint.0))),
    ]);
    for (name, hand) in [("left", &parameters.left_hand_pose), ("right", &parameters.right_hand_pose)] {
        let (convention, values) = match hand {
            HandPose::Flat(joints) => ("flat", rows(joints.map(|joint| joint.0))),
            HandPose::RelativeToMean(joints) => ("relative_to_mean", rows(joints.map(|joint| joint.0))),
            HandPose::Pca(coefficients) => ("pca", Array::from_f32(&[coefficients.len()], coefficients.clone())),
        };
        arrays.insert(format!("{name}_hand.{convention}"), values);
    }
}

pub(super) fn of(stored: &Stored) -> Result<BodyParameters> {
    let joints: Vec<PoseAxisAngle> = stored.points("joints")?.into_iter().map(PoseAxisAngle).collect();
    let [global_orient, body_pose @ .., jaw_pose, left_eye_pose, right_eye_pose] = joints.as_slice() else {
        return Err(stored.broken("joints"));
    };
    Ok(BodyParameters {
        betas: stored.exactly("betas")?,
        expression: stored.exactly("expression")?,
        global_orient: *global_orient,
        body_pose: body_pose.try_into().map_err(|_| stored.broken("joints"))?,
        jaw_pose: *jaw_pose,
        left_eye_pose: *left_eye_pose,
        right_eye_pose: *right_eye_pose,
        left_hand_pose: hand(stored, "left")?,
        right_hand_pose: hand(stored, "right")?,
        transl: stored.exactly("transl")?.into(),
    })
}

fn hand(stored: &Stored, side: &str) -> Result<HandPose> {
    let axis_angles = |key: &str| -> Result<[PoseAxisAngle; 15]> {
        let joints: Vec<PoseAxisAngle> = stored.points(key)?.into_iter().map(PoseAxisAngle).collect();
        joints.try_into().map_err(|_| stored.broken(key))
    };
    let [flat, relative, pca] = ["flat", "relative_to_mean", "pca"].map(|kind| format!("{side}_hand.{kind}"));
    if stored.has(&flat) {
        Ok(HandPose::Flat(axis_angles(&flat)?))
    } else if stored.has(&relative) {
        Ok(HandPose::RelativeToMean(axis_angles(&relative)?))
    } else {
        Ok(HandPose::Pca(stored.floats(&pca)?))
    }
}
