//! What users have, as typed frames: subjects' scans and pictures with their registrations, motions.
//!
//! Files -> arrays -> frames. Nothing here knows about training.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod capture;
mod check;
mod fields;
mod motion;
mod notes;
mod placement;
mod rgbd;
mod subject;
mod whole_poses;
mod xhumans;

pub use capture::{Capture, CaptureKind, CapturedSubject, FrameId, RgbdCapture, ScanFrame, ScanFrames, Source, Split};
pub use check::{
    CheckReport, CheckedFrames, Defect, DistanceReport, Finding, HandReport, LimbCheck, SequenceReport, UnusableFrame,
    check,
};
pub use motion::{
    Clip, Coordinates, HandConvention, Motion, MotionOptions, PosedClip, RestPose, Translation, UpAxis, Warning,
    onto_legs, read_motion, write_motion,
};
pub use notes::FrameNotes;
pub use placement::{Origin, ScanPlacement};
pub use rgbd::{
    BACKGROUND, DepthFormat, DepthPicture, FARTHEST_DEPTH, NO_MEASUREMENT, PointCloud, RgbdCheckReport, RgbdFiles,
    RgbdFrame, RgbdFrames, RgbdLayout, RgbdPictures, RgbdSubject, check_rgbd, parse_depth, read_depth,
    remove_rgbd_frame, write_depth, write_rgbd_subject,
};
pub use subject::{FrameFile, FrameFiles, HandZero, Layout, Scans, Subject, read_frame};
pub use xhumans::{FrameFolder, write_common, write_subject};
