//! GRAB motions: the pickled dict `body`, whose `params` hold one array a parameter, T rows each.
//!
//! Hands are PCA coefficients relative to the mean hand (24 of them); where they are missing, the absolute rotations
//! of `fullpose` (T, 165) serve. The subject's shape is a template mesh beside the archive, so betas are zero. Z up.

use std::path::Path;

use super::frames::{FrameReader, rotation};
use super::{Motion, UpAxis};
use crate::fields::{Fields, rotations};
use xavatar_body::smplx;
use xavatar_formats::{ArrayMap, Result};

const FORMAT: &str = "GRAB motion";
const PARAMETERS: &str = "body.params.";

pub(super) fn recognised(arrays: &ArrayMap) -> std::result::Result<(), String> {
    let key = |name: &str| arrays.contains_key(&format!("{PARAMETERS}{name}"));
    (key("body_pose") || key("fullpose"))
        .then_some(())
        .ok_or_else(|| "no `body.params.body_pose` or `.fullpose`".into())
}

pub(super) fn read(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    let key = |name: &str| format!("{PARAMETERS}{name}");
    let fields = Fields { path, format: FORMAT, arrays };
    let mut reader = if arrays.contains_key(&key("body_pose")) {
        FrameReader::new(fields, &key("body_pose"), 3 * smplx::BODY_JOINTS)?
    } else {
        FrameReader::new(fields, &key("fullpose"), 3 * smplx::joint::COUNT)?
    };
    let has_full_poses = reader.has(&key("fullpose"));
    let mut frames = if has_full_poses {
        reader.full_poses(&key("fullpose"), smplx::skeleton())?
    } else {
        separate_poses(&mut reader)?
    };
    if !has_full_poses || (reader.has(&key("left_hand_pose")) && reader.has(&key("right_hand_pose"))) {
        let left = reader.pca_hands(&key("left_hand_pose"))?;
        let right = reader.pca_hands(&key("right_hand_pose"))?;
        for ((frame, left), right) in frames.iter_mut().zip(left).zip(right) {
            frame.left_hand_pose = left;
            frame.right_hand_pose = right;
        }
    }
    let (translations, expressions) =
        (reader.rows::<3>(&key("transl"))?, reader.rows::<{ smplx::EXPRESSIONS }>(&key("expression"))?);
    for ((frame, translation), expression) in frames.iter_mut().zip(translations).zip(expressions) {
        frame.transl = translation.into();
        frame.expression = expression.to_vec();
    }
    let frames_per_second = reader.frames_per_second(&["framerate"])?;
    let mut zeroed = reader.zeroed();
    zeroed.push("betas".into());
    let source = format!("{} ({FORMAT})", path.display());
    Ok(Motion { frames, frames_per_second, up: UpAxis::Z, up_is_certain: true, source, zeroed, ..Motion::default() })
}

fn separate_poses(reader: &mut FrameReader) -> Result<Vec<smplx::Parameters>> {
    let key = |name: &str| format!("{PARAMETERS}{name}");
    let body = reader.rows::<{ 3 * smplx::BODY_JOINTS }>(&key("body_pose"))?;
    let global = reader.rows(&key("global_orient"))?;
    let jaw = reader.rows(&key("jaw_pose"))?;
    let (left_eye, right_eye) = (reader.rows(&key("leye_pose"))?, reader.rows(&key("reye_pose"))?);
    let frame = |index: usize| smplx::Parameters {
        global_orient: rotation(global[index]),
        body_pose: rotations(&body[index]),
        jaw_pose: rotation(jaw[index]),
        left_eye_pose: rotation(left_eye[index]),
        right_eye_pose: rotation(right_eye[index]),
        ..Default::default()
    };
    Ok((0..body.len()).map(frame).collect())
}
