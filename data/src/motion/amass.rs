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
use crate::fields::{Fields, rotations};
use xavatar_body::{HandPose, PoseAxisAngle, smplx};
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

/// The model that poses of so many columns are of.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    SmplX,
    SmplH,
    Smpl,
}

pub(super) fn read(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    let fields = Fields { path, format: FORMAT, arrays };
    let poses = fields.array("poses")?;
    let (model, width) = match poses.shape[..] {
        [_, width @ 165] => (Model::SmplX, width),
        [_, width @ 156] => (Model::SmplH, width),
        [_, width @ 72] => (Model::Smpl, width),
        _ => {
            let expected = "numbers in 165 (SMPL-X), 156 (SMPL+H) or 72 (SMPL) columns";
            return Err(fields.malformed("poses", poses.description(), expected));
        }
    };
    let values = fields.rows("poses", width)?;
    let mut reader = FrameReader::new(fields, "poses", width)?;
    let mut frames: Vec<smplx::Parameters> = values.chunks_exact(width).map(|row| pose(model, row)).collect();
    for (frame, translation) in frames.iter_mut().zip(reader.rows::<3>("trans")?) {
        frame.transl = translation.into();
    }
    let mut notes = Vec::new();
    let mut neutral = vec!["expression"];
    if model == Model::SmplX {
        let betas = reader.betas("betas")?;
        frames.iter_mut().zip(betas).for_each(|(frame, betas)| frame.betas = betas);
    } else {
        neutral.extend(["betas", "jaw_pose", "left_eye_pose", "right_eye_pose"]);
        let shift = SMPL_PELVIS - RestPose::default().pelvis();
        frames.iter_mut().for_each(|frame| frame.transl += shift);
        notes.push(match model {
            Model::Smpl => "a motion of SMPL (72 values a frame): hands are flat, the face is neutral".into(),
            _ => "a motion of SMPL+H (156 values a frame): the face is neutral".into(),
        });
    }
    if model == Model::Smpl {
        neutral.extend(["left_hand_pose", "right_hand_pose"]);
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

fn pose(model: Model, row: &[f32]) -> smplx::Parameters {
    let part = |joint: usize| PoseAxisAngle(Vec3::from_slice(&row[3 * joint..]));
    let hand = |first: usize| HandPose::Flat(rotations(&row[3 * first..3 * (first + 15)]));
    let mut parameters =
        smplx::Parameters { global_orient: part(0), body_pose: rotations(&row[3..66]), ..smplx::Parameters::default() };
    match model {
        Model::SmplX => {
            parameters.jaw_pose = part(22);
            parameters.left_eye_pose = part(23);
            parameters.right_eye_pose = part(24);
            (parameters.left_hand_pose, parameters.right_hand_pose) = (hand(25), hand(40));
        }
        Model::SmplH => (parameters.left_hand_pose, parameters.right_hand_pose) = (hand(22), hand(37)),
        Model::Smpl => {}
    }
    parameters
}
