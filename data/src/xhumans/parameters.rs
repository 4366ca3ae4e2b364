//! A frame's registration as X-Humans stores it: every parameter under smplx's name, hands as offsets from the mean hand.

use std::path::Path;

use crate::fields::{Fields, rotations};
use xavatar_body::{BodyParameters, HandPose};
use xavatar_formats::{ArrayMap, Result};

const FORMAT: &str = "X-Humans frame";

/// The registered parameters of a frame; shape is left at zero.
pub(crate) fn parameters_of(path: &Path, arrays: &ArrayMap) -> Result<BodyParameters> {
    let fields = Fields { path, format: FORMAT, arrays };
    let [global_orient] = rotations(&fields.vector::<3>("global_orient")?);
    let [jaw_pose] = rotations(&fields.vector::<3>("jaw_pose")?);
    let [left_eye_pose] = rotations(&fields.vector::<3>("leye_pose")?);
    let [right_eye_pose] = rotations(&fields.vector::<3>("reye_pose")?);
    Ok(BodyParameters {
        betas: [0.0; 10],
        expression: fields.vector("expression")?,
        global_orient,
        body_pose: rotations(&fields.vector::<63>("body_pose")?),
        jaw_pose,
        left_eye_pose,
        right_eye_pose,
        left_hand_pose: HandPose::RelativeToMean(rotations(&fields.vector::<45>("left_hand_pose")?)),
        right_hand_pose: HandPose::RelativeToMean(rotations(&fields.vector::<45>("right_hand_pose")?)),
        transl: fields.vector::<3>("transl")?.into(),
    })
}
