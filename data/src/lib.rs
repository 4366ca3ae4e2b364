//! What users have, as typed frames: X-Humans subjects, motions, body-model files.
//!
//! Files -> arrays -> frames. Nothing here knows about training.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod capture;
mod check;
mod fields;
mod motion;
mod notes;
mod rgbd;
mod xhumans;

pub use capture::{
    Capture, CaptureKind, FrameId, RgbdCapture, ScanFrame, ScanFrames, Source, Split, has_only_rgbd, training_captures,
};
pub use check::{CheckReport, DistanceReport, HandReport, SequenceReport, UnusableFrame, check};
pub use motion::{
    Clip, HandConvention, Motion, MotionOptions, RestPose, Translation, UpAxis, read_motion, write_motion,
};
pub use notes::FrameNotes;
pub use rgbd::{
    BACKGROUND, DepthFormat, DepthPicture, FARTHEST_DEPTH, NO_MEASUREMENT, PointCloud, RgbdCheckReport, RgbdFiles,
    RgbdFrame, RgbdFrames, RgbdLayout, RgbdSubject, check_rgbd, parse_depth, read_depth, write_depth,
    write_rgbd_subject,
};
pub use xhumans::{Subject, read_frame, write_subject};

use std::path::PathBuf;

/// A frame that exists on disk but is not read yet.
#[derive(Clone, Debug)]
pub struct FrameFiles {
    /// Which frame.
    pub id: FrameId,
    /// The scan: `meshes_pkl/mesh-fXXXXX.pkl` or `meshes_ply/mesh-fXXXXX.ply`.
    pub scan: PathBuf,
    /// The texture atlas of a raw scan.
    pub atlas: Option<PathBuf>,
    /// The registration's parameters.
    pub parameters: PathBuf,
}
