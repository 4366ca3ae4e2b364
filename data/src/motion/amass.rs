//! AMASS motions: `poses` (T, n) over all joints in order, `trans` (T, 3), `betas`, `mocap_frame_rate`; Z up.
//!
//! | n | model | joints |
//! |---|---|---|
//! | 165 | SMPL-X | 22 of the body, jaw, eyes, 2 x 15 of the hands |
//! | 156 | SMPL+H | 22 of the body, 2 x 15 of the hands |
//! | 72 | SMPL | 22 of the body, the two hands, which have no counterpart |
//!
//! Hands are absolute rotations: AMASS was fitted with a flat mean hand (`flat_hand_mean=True`). What a model does not have
//! stays neutral: the hands flat, the face at rest. Shape coefficients of SMPL and SMPL+H mean other shapes and are left out.

use std::path::Path;

use glam::Vec3;

use super::frames::FrameReader;
use super::{Motion, RestPose, UpAxis};
use crate::fields::Fields;
use xavatar_body::{Skeleton, smpl, smplh, smplx};
use xavatar_formats::{ArrayMap, Result};

const FORMAT: &str = "AMASS motion";
/// Where SMPL's and SMPL+H's pelvis is at rest, to two centimetres between genders, metres: SMPL-X's origin is higher.
pub(super) const SMPL_PELVIS: Vec3 = Vec3::new(0.0, -0.23, 0.028);

const RATE: [&str; 2] = ["mocap_frame_rate", "mocap_framerate"];

pub(super) fn recognised(arrays: &ArrayMap) -> std::result::Result<(), String> {
    if !arrays.contains_key("poses") {
        return Err("no `poses`".into());
    }
    // Others took its names, but not its marks, and other axes.
    let is_marked = RATE.iter().chain(&["dmpls"]).any(|key| arrays.contains_key(*key));
    (is_marked && !arrays.contains_key("expressions")).then_some(()).ok_or_else(|| "no `mocap_frame_rate`".into())
}

pub(super) fn read(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    let fields = Fields { path, format: FORMAT, arrays };
    let poses = fields.array("poses")?;
    let skeletons = [smplx::skeleton(), smplh::skeleton(), smpl::skeleton()];
    let is_of = |skeleton: &&Skeleton| poses.shape.len() == 2 && poses.shape[1] == 3 * skeleton.joints.len();
    let Some(skeleton) = skeletons.into_iter().find(is_of) else {
        let known = skeletons.map(|skeleton| format!("{} ({})", 3 * skeleton.joints.len(), skeleton.family));
        let expected = format!("numbers in {}, {} or {} columns", known[0], known[1], known[2]);
        return Err(fields.malformed("poses", poses.description(), expected));
    };
    let width = 3 * skeleton.joints.len();
    let mut reader = FrameReader::new(fields, "poses", width)?;
    let mut frames = reader.full_poses("poses", skeleton)?;
    for (frame, translation) in frames.iter_mut().zip(reader.rows::<3>("trans")?) {
        frame.transl = translation.into();
    }
    let mut notes = Vec::new();
    let mut neutral = vec!["expression"];
    if skeleton == smplx::skeleton() {
        let betas = reader.betas("betas")?;
        frames.iter_mut().zip(betas).for_each(|(frame, betas)| frame.betas = betas);
    } else {
        neutral.extend(["betas", "jaw_pose", "left_eye_pose", "right_eye_pose"]);
        let shift = SMPL_PELVIS - RestPose::default().pelvis();
        frames.iter_mut().for_each(|frame| frame.transl += shift);
        let has_fingers = skeleton != smpl::skeleton();
        let hands = if has_fingers { "" } else { "hands are flat, " };
        notes.push(format!("a motion of {} ({width} values a frame): {hands}the face is neutral", skeleton.family));
        if !has_fingers {
            neutral.extend(["left_hand_pose", "right_hand_pose"]);
        }
    }
    let frames_per_second = reader.frames_per_second(&RATE)?;
    let mut zeroed = reader.zeroed();
    zeroed.extend(neutral.into_iter().map(str::to_owned));
    let source = format!("{} ({FORMAT})", path.display());
    Ok(Motion {
        frames,
        frames_per_second,
        up: UpAxis::Z,
        up_is_certain: true,
        source,
        zeroed,
        notes,
        ..Motion::default()
    })
}
