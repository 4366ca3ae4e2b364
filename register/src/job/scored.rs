//! How well bodies that are registered already, by whatever program, lie on their scans.

use std::sync::Arc;

use rayon::prelude::*;
use xavatar_body::{BodyModel, PartLabels};
use xavatar_data::{FrameFiles, Split, Subject, read_frame};
use xavatar_formats::Result;

use super::coordinates::{FileCoordinates, Up};
use super::report::{FrameReport, RegistrationReport, Verdict, summary, why};
use super::{KEY_FRAMES, Observer};
use crate::fit::{Clothing, Fitter, Frame, FrameQuality, Sequence, Shaped, doubtful};
use crate::linear::FramePose;
use crate::surface_model::Density;
use crate::target::ScanTarget;

/// Learning clothing starts from an assumption, which the second round no longer depends on.
const ROUNDS: usize = 2;

/// Scores the registrations of a subject, which has to be settled with its body; frames that cannot be read are doubtful.
///
/// # Errors
/// [`Error::Value`](xavatar_formats::Error::Value) for a shape of another body.
pub fn score_registration(
    subject: &Subject,
    body: &BodyModel,
    labels: &PartLabels,
    observe: &mut Observer<'_>,
) -> Result<RegistrationReport> {
    let fitter = Fitter::new(body, labels, Density::FINE);
    let extents = fitter.linkage.extents();
    let files: Vec<&FrameFiles> =
        [Split::Train, Split::Test].into_iter().flat_map(|split| subject.files(split)).collect();
    let mut shape: Vec<f64> = subject.betas.iter().map(|value| f64::from(*value)).collect();
    shape.resize(extents.shapes, 0.0);
    let read = |files: &FrameFiles| -> Result<(FramePose, Frame)> {
        let frame = read_frame(files, &subject.betas)?;
        let pose = FramePose::of(&body.resolve(&frame.parameters)?, extents);
        Ok((
            pose,
            Frame {
                scan: Arc::new(ScanTarget::of(&frame.scan)?),
                landmarks: Vec::new(),
                motion: None,
                unseen: Vec::new(),
            },
        ))
    };
    let count = files.len().min(KEY_FRAMES);
    let keys = (0..count).into_par_iter().filter_map(|place| read(files[place * files.len() / count]).ok());
    let (poses, frames): (Vec<FramePose>, Vec<Frame>) = keys.collect::<Vec<_>>().into_iter().unzip();
    let sequence = Sequence { poses, shape: shape.clone() };
    let mut clothing = Clothing::assumed(&fitter, false);
    if !frames.is_empty() {
        (0..ROUNDS).try_for_each(|_| clothing.learn(&fitter, &sequence, &frames))?;
    }
    let mut qualities: Vec<std::result::Result<FrameQuality, String>> = Vec::new();
    for (done, files) in files.iter().enumerate() {
        observe("frames", done as f64 / count.max(1) as f64, &files.id.to_string());
        let quality = read(files).and_then(|(pose, frame)| {
            let sequence = Sequence { poses: vec![pose], shape: shape.clone() };
            Ok(fitter.qualities(&sequence, &[frame], &clothing.thickness)?.remove(0))
        });
        qualities.push(quality.map_err(|error| error.to_string()));
    }
    let known: Vec<FrameQuality> = qualities.iter().flatten().cloned().collect();
    let mut verdicts = doubtful(&known).into_iter();
    let report = |(files, quality): (&&FrameFiles, std::result::Result<FrameQuality, String>)| {
        let is_doubtful = quality.is_err() || verdicts.next().unwrap_or(true);
        let reason = match &quality {
            Err(error) => error.clone(),
            Ok(quality) if is_doubtful => why(quality),
            Ok(_) => String::new(),
        };
        FrameReport {
            frame: files.id.to_string(),
            verdict: if is_doubtful { Verdict::Doubtful } else { Verdict::Registered },
            reason,
            missing_hands: quality
                .as_ref()
                .map(|quality| quality.missing_hands(body.skeleton(), &[]))
                .unwrap_or_default(),
            turned_hands: Vec::new(),
            quality: quality.ok(),
            landmarks: 0,
            dropped_landmarks: Vec::new(),
            notes: Vec::new(),
        }
    };
    let frames = files.iter().zip(qualities).map(report).collect();
    let coordinates = FileCoordinates { scale: 1.0, up: Up::Y };
    Ok(summary(coordinates, &Shaped { shape, clothing }, &fitter, frames))
}
