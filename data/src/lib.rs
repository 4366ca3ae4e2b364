//! What users have, as typed frames: X-Humans subjects, motions, body-model files.
//!
//! Files -> arrays -> frames. Nothing here knows about training.

mod check;
mod fields;
mod motion;
mod rgbd;
mod xhumans;

pub use check::{CheckReport, DistanceReport, HandReport, SequenceReport, UnusableFrame, check};
pub use motion::{
    Clip, Coordinates, HandConvention, Motion, MotionOptions, RestPose, Translation, UpAxis, read_motion, write_motion,
};
pub use rgbd::{
    BACKGROUND, DepthFormat, DepthPicture, FARTHEST_DEPTH, NO_MEASUREMENT, PointCloud, RgbdCheckReport, RgbdFiles,
    RgbdFrame, RgbdFrames, RgbdLayout, RgbdSource, RgbdSubject, check_rgbd, read_depth, write_depth,
    write_rgbd_subject,
};
pub use xhumans::{Subject, read_frame, write_subject};

use std::path::PathBuf;

use xavatar_body::BodyParameters;
use xavatar_mesh::TriangleMesh;

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
    fn betas(&self) -> [f32; 10];

    /// The subject's gender.
    fn gender(&self) -> xavatar_body::Gender;
}

/// A frame in memory: a coloured scan and the SMPL-X parameters registered to it.
#[derive(Clone, Debug)]
pub struct ScanFrame {
    /// Which frame.
    pub id: FrameId,
    /// The scan in world coordinates (the registration's `transl` not subtracted), metres.
    pub scan: TriangleMesh,
    /// Parameters; `betas` already replaced by the subject's mean shape.
    pub parameters: BodyParameters,
}
