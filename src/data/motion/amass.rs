//! AMASS motions for SMPL-X: `poses` (T, 165) over all joints in order, `trans` (T, 3), `betas`.
//!
//! Hands are absolute rotations: AMASS was fitted with a flat mean hand (`flat_hand_mean=True`). Z up.

use std::path::Path;

use super::frames::FrameReader;
use super::{Motion, UpAxis};
use crate::data::ArrayMap;
use crate::data::fields::Fields;
use crate::{Error, Result};

const FORMAT: &str = "AMASS motion";

pub(super) fn recognised(arrays: &ArrayMap) -> std::result::Result<(), &'static str> {
    arrays.contains_key("poses").then_some(()).ok_or("AMASS: no `poses`")
}

pub(super) fn read(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    let other_model = match arrays["poses"].shape[..] {
        [_, 72] => Some("SMPL"),
        [_, 156] => Some("SMPL+H"),
        _ => None,
    };
    if let Some(model) = other_model {
        return Err(Error::Mismatch {
            path: path.into(),
            found: format!("an AMASS motion of the {model} model"),
            expected: "one of SMPL-X, with 165 pose columns".into(),
            remedy: "download the data set's SMPL-X version".into(),
        });
    }
    let mut reader = FrameReader::new(Fields { path, format: FORMAT, arrays }, "poses", 165)?;
    let mut frames = reader.full_poses("poses")?;
    let (betas, translations) = (reader.betas("betas")?, reader.rows::<3>("trans")?);
    for ((frame, betas), translation) in frames.iter_mut().zip(betas).zip(translations) {
        frame.betas = betas;
        frame.transl = translation.into();
    }
    let frames_per_second = reader.frames_per_second(&["mocap_frame_rate", "mocap_framerate"])?;
    let mut zeroed = reader.zeroed();
    zeroed.push("expression".into());
    let source = format!("{} ({FORMAT})", path.display());
    Ok(Motion { frames, frames_per_second, up: UpAxis::Z, source, zeroed, ..Motion::default() })
}
