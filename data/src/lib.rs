//! What users have, as typed frames: subjects' scans and pictures with their registrations, motions.
//!
//! Files -> arrays -> frames. Nothing here knows about training.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod check;
mod fields;
mod motion;
mod notes;
mod placement;
mod rgbd;
mod subject;
mod xhumans;

pub use check::{
    CheckReport, CheckedFrames, Defect, DistanceReport, Finding, HandReport, SequenceReport, UnusableFrame, check,
};
pub use motion::{
    Clip, Coordinates, HandConvention, Motion, MotionOptions, RestPose, Translation, UpAxis, Warning, read_motion,
    write_motion,
};
pub use notes::FrameNotes;
pub use placement::{Origin, ScanPlacement};
pub use rgbd::{
    BACKGROUND, DepthFormat, DepthPicture, FARTHEST_DEPTH, NO_MEASUREMENT, PointCloud, RgbdCheckReport, RgbdFiles,
    RgbdFrame, RgbdFrames, RgbdLayout, RgbdSource, RgbdSubject, check_rgbd, parse_depth, read_depth, write_depth,
    write_rgbd_subject,
};
pub use subject::{FrameFile, FrameFiles, HandZero, Layout, Subject, read_frame};
pub use xhumans::write_subject;

use xavatar_body::BodyParameters;
use xavatar_mesh::{Note, TriangleMesh};

/// Where a frame stands in its subject, displayed as `train/Take1/f00001`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId {
    /// `train` or `test`.
    pub split: String,
    /// The sequence's folder name.
    pub sequence: String,
    /// The number in the file names.
    pub number: u32,
}

impl std::fmt::Display for FrameId {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}/{}/f{:05}", self.split, self.sequence, self.number)
    }
}

/// The frames of one split of a subject, in order, read on demand.
pub trait FrameSource: Sync {
    /// The frames there are.
    fn ids(&self) -> &[FrameId];

    /// Reads the frame at `index` of [`FrameSource::ids`].
    ///
    /// # Errors
    /// [`xavatar_formats::Error::Frame`] naming the frame, if a file is missing or broken.
    fn read(&self, index: usize) -> xavatar_formats::Result<ScanFrame>;

    /// The subject's shape.
    fn betas(&self) -> &[f32];

    /// The subject's gender.
    fn gender(&self) -> xavatar_body::Gender;
}

/// A frame in memory: a coloured scan and the body registered to it.
#[derive(Clone, Debug)]
pub struct ScanFrame {
    /// Which frame.
    pub id: FrameId,
    /// The scan in world coordinates (the registration's `transl` not subtracted), metres.
    pub scan: TriangleMesh,
    /// Its parameters; the shape is the subject's mean shape.
    pub parameters: BodyParameters,
    /// What the scan's file says that is not in `scan`.
    pub notes: Vec<Note>,
}
