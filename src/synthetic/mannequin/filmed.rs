//! A take of the built-in subject in memory: frames to train or measure on, with no data.

use rayon::prelude::*;

use super::BuiltInSubject;
use crate::body::Gender;
use crate::data::{Capture, CaptureKind, FrameId, ScanFrame, Source, Split};
use crate::formats::Result;

/// The frames of one take.
pub struct FilmedTake {
    frames: Vec<ScanFrame>,
    ids: Vec<FrameId>,
    betas: Vec<f32>,
}

impl BuiltInSubject {
    /// Films a take in `count` frames, evenly spaced.
    ///
    /// # Errors
    /// As [`BuiltInSubject::frame`].
    pub fn film(&self, split: Split, count: usize) -> Result<FilmedTake> {
        let frames: Vec<ScanFrame> =
            (0..count).into_par_iter().map(|index| self.frame(split, index, count)).collect::<Result<_>>()?;
        let ids = frames.iter().map(|frame| frame.id.clone()).collect();
        Ok(FilmedTake { frames, ids, betas: self.betas().to_vec() })
    }
}

impl FilmedTake {
    /// The frames, in order.
    pub fn frames(&self) -> &[ScanFrame] {
        &self.frames
    }
}

impl Source for FilmedTake {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Scans
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> Result<Capture> {
        Ok(Capture::Scan(Box::new(self.frames[index].clone())))
    }

    fn betas(&self) -> &[f32] {
        &self.betas
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}
