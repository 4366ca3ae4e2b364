//! Scans: a coloured mesh and the body registered to it.

use super::{Capture, CaptureKind, FrameId, Source};
use crate::{FrameFiles, Subject, read_frame};
use xavatar_body::{BodyParameters, Gender};
use xavatar_formats::Result;
use xavatar_mesh::{Note, TriangleMesh};

/// A frame in memory: a coloured scan and the body registered to it.
#[derive(Clone, Debug)]
pub struct ScanFrame {
    /// Which frame.
    pub id: FrameId,
    /// The scan in world coordinates (the registration's `transl` not subtracted), metres.
    pub scan: TriangleMesh,
    /// Its parameters; the shape is the subject's mean shape.
    pub parameters: BodyParameters,
    /// Names of the body's parts that the scan does not show: their pose is a guess.
    pub unseen_parts: Vec<String>,
    /// What the scan's file says that is not in `scan`.
    pub notes: Vec<Note>,
}

/// Scans of a subject on disk, read when they are asked for.
#[derive(Clone, Debug)]
pub struct ScanFrames {
    files: Vec<FrameFiles>,
    ids: Vec<FrameId>,
    betas: Vec<f32>,
    gender: Gender,
}

impl ScanFrames {
    /// Some of a subject's frames.
    pub fn new(subject: &Subject, files: &[FrameFiles]) -> Self {
        let ids = files.iter().map(|files| files.id.clone()).collect();
        Self { files: files.to_vec(), ids, betas: subject.betas.clone(), gender: subject.gender }
    }

    /// All scans, one in memory at a time.
    pub fn iter(&self) -> impl Iterator<Item = Result<ScanFrame>> {
        self.files.iter().map(|files| read_frame(files, &self.betas))
    }
}

impl Source for ScanFrames {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Scans
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> Result<Capture> {
        Ok(Capture::Scan(Box::new(read_frame(&self.files[index], &self.betas)?)))
    }

    fn betas(&self) -> &[f32] {
        &self.betas
    }

    fn gender(&self) -> Gender {
        self.gender
    }
}
