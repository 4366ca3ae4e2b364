//! What was captured of a subject at one moment, whatever with, and who hands it out: one file a kind.

mod folder;
mod rgbd;
mod scan;

pub use folder::CapturedSubject;
pub use rgbd::RgbdCapture;
pub use scan::{ScanFrame, ScanFrames};

use serde::{Deserialize, Serialize};
use xavatar_body::{BodyModel, BodyParameters, Gender, Pose};
use xavatar_formats::{Error, Result};
use xavatar_mesh::Note;

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

/// The frames to learn from, and those to measure on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// To learn from.
    Train,
    /// Unseen poses, to measure on.
    Test,
}

impl Split {
    /// `train` or `test`, as folders and frames are named.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

/// What a subject is captured with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaptureKind {
    /// Textured scans.
    Scans,
    /// Pictures of an RGB-D camera.
    Rgbd,
}

/// One frame in memory, with the body registered to it.
#[derive(Clone, Debug)]
pub enum Capture {
    /// A scan.
    Scan(Box<ScanFrame>),
    /// A picture of an RGB-D camera, with the points that it shows.
    Rgbd(Box<RgbdCapture>),
}

impl Capture {
    /// What it was captured with.
    pub fn kind(&self) -> CaptureKind {
        match self {
            Self::Scan(_) => CaptureKind::Scans,
            Self::Rgbd(_) => CaptureKind::Rgbd,
        }
    }

    /// Which frame.
    pub fn id(&self) -> &FrameId {
        match self {
            Self::Scan(frame) => &frame.id,
            Self::Rgbd(capture) => &capture.frame.id,
        }
    }

    /// The registered body; its shape is the subject's.
    pub fn parameters(&self) -> &BodyParameters {
        match self {
            Self::Scan(frame) => &frame.parameters,
            Self::Rgbd(capture) => &capture.frame.parameters,
        }
    }

    /// What reading the frame's files lost.
    pub fn notes(&self) -> &[Note] {
        match self {
            Self::Scan(frame) => &frame.notes,
            Self::Rgbd(_) => &[],
        }
    }

    /// The frame with the pose that its parameters mean on `body`.
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, if the parameters do not fit the body model.
    pub fn resolved(self, body: &BodyModel) -> Result<Self> {
        let resolved = body.resolve(self.parameters()).map_err(|error| error.in_frame(self.id().to_string()));
        Ok(self.posed(resolved?))
    }

    /// The frame with another pose of the body.
    #[must_use]
    pub fn posed(mut self, pose: Pose) -> Self {
        let parameters = BodyParameters::from(pose);
        match &mut self {
            Self::Scan(frame) => frame.parameters = parameters,
            Self::Rgbd(capture) => capture.frame.parameters = parameters,
        }
        self
    }

    /// The scan.
    ///
    /// # Errors
    /// [`Error::Value`] names the frame if it is something else.
    pub fn into_scan(self) -> Result<ScanFrame> {
        match self {
            Self::Scan(frame) => Ok(*frame),
            Self::Rgbd(capture) => {
                let (name, found) = ("the captured frame".into(), "a picture of an RGB-D camera".into());
                let refused = Error::Value { name, found, expected: "a scan".into() };
                Err(refused.in_frame(capture.frame.id.to_string()))
            }
        }
    }
}

/// The frames of one split of a subject, in order, read on demand.
pub trait Source: Sync {
    /// What all of its frames were captured with.
    fn kind(&self) -> CaptureKind;

    /// The frames there are.
    fn ids(&self) -> &[FrameId];

    /// Reads the frame at `index` of [`Source::ids`], which is of [`Source::kind`].
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, if a file is missing or broken.
    fn read(&self, index: usize) -> Result<Capture>;

    /// The subject's shape.
    fn betas(&self) -> &[f32];

    /// The subject's gender.
    fn gender(&self) -> Gender;

    /// Reads the scan at `index`.
    ///
    /// # Errors
    /// As [`Source::read`], and if it is no scan.
    fn scan(&self, index: usize) -> Result<ScanFrame> {
        self.read(index)?.into_scan()
    }

    /// The place of the frame of this name (`split/sequence/number`), if there is one.
    fn place(&self, name: &str) -> Option<usize> {
        self.ids().iter().position(|id| id.to_string() == name)
    }
}
