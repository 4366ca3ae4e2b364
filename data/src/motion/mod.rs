//! Motions: sequences of SMPL-X parameters to animate an avatar with (docs/motion.md).
//!
//! Read from X-Humans `SMPLX` folders, AMASS and GRAB archives, what pose estimators write, BVH, and our own npz, which is
//! also written. A [`Motion`] is what
//! its source says, in the source's conventions, which are types; a [`Clip`] is what any avatar can be animated with. T frames;
//! radians, metres.

mod amass;
mod bvh;
mod clip;
mod conventions;
mod detect;
mod folder;
mod frames;
mod grab;
mod legs;
mod own;
mod parameters;
mod posed;
mod rest;
mod timing;
mod upright;

use std::collections::BTreeMap;
use std::path::Path;

use xavatar_body::smplx;
use xavatar_formats::{Choice, Result};

pub use clip::{Clip, MotionOptions};
pub use conventions::{Coordinates, HandConvention, Translation, UpAxis};
pub use legs::onto_legs;
pub use own::write_motion;
pub(crate) use parameters::{read_named, recognised as has_named};
pub use posed::PosedClip;
pub use rest::RestPose;

/// A sequence of body parameters, as its source has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// The parameters of each frame (T), at least one.
    pub frames: Vec<smplx::Parameters>,
    /// How fast the frames follow each other, if the source says.
    pub frames_per_second: Option<f32>,
    /// The axis that points up.
    pub up: UpAxis,
    /// Whether format or file leave no doubt about `up`, so that a body that lies down is not taken for a world that does.
    pub up_is_certain: bool,
    /// How `up` is known: "by the format" if empty.
    pub up_reason: String,
    /// What the numbers are relative to, where that is known.
    pub coordinates: Option<Coordinates>,
    /// Where the motion is from: the path and the format it was read as.
    pub source: String,
    /// Parameters that the source does not have, so that they are zero in every frame.
    pub zeroed: Vec<String>,
    /// What else the reader has to say, a line each.
    pub notes: Vec<String>,
    /// What may be wrong, a line each.
    pub warnings: Vec<Warning>,
}

/// What may be wrong with a motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// What it is, with the figure.
    pub message: String,
    /// What a caller can choose where it is wrong.
    pub choice: Option<Choice>,
}

impl Warning {
    fn plain(message: impl Into<String>) -> Self {
        Self { message: message.into(), choice: None }
    }

    fn choosing(choice: Choice, message: impl Into<String>) -> Self {
        Self { message: message.into(), choice: Some(choice) }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(&self.message)
    }
}

/// Reads a motion of any format (docs/motion.md): a file, or a folder of one file a frame.
///
/// # Errors
/// [`Error::Missing`](xavatar_formats::Error::Missing) if nothing is there; [`Error::Unrecognised`](xavatar_formats::Error::Unrecognised) listing the formats and why the file is in none;
/// [`Error::Malformed`](xavatar_formats::Error::Malformed) naming the place that breaks the file's format;
/// [`Error::Refused`](xavatar_formats::Error::Refused) for a pickle that would run code.
pub fn read_motion(path: impl AsRef<Path>) -> Result<Motion> {
    detect::read(path.as_ref(), &Wanted { rest: &RestPose::default(), bone_map: None, coordinates: None })
}

/// What a reader is to make of a file that leaves it open.
struct Wanted<'a> {
    /// SMPL-X's skeleton at rest, onto which motions of other skeletons (BVH) are turned.
    rest: &'a RestPose,
    /// Which bone is which joint, where the bones' names do not say.
    bone_map: Option<&'a BTreeMap<String, String>>,
    /// Which of the motions that a file has, the camera's or the world's.
    coordinates: Option<Coordinates>,
}
