//! Motions: sequences of SMPL-X parameters to animate an avatar with (docs/motion.md).
//!
//! Read from X-Humans `SMPLX` folders, AMASS and GRAB archives, and our own npz, which is also written. A [`Motion`] is what
//! its source says, in the source's conventions, which are types; a [`Clip`] is what any avatar can be animated with. T frames;
//! radians, metres.

mod amass;
mod clip;
mod conventions;
mod dance;
mod frames;
mod grab;
mod own;
mod rest;
mod timing;

use std::path::{Path, PathBuf};

use super::xhumans::{motion_files, parameters_of};
use super::{ArrayMap, read_npz, read_pickle_arrays};
use crate::body::BodyParameters;
use crate::{Error, Result};

pub use clip::{Clip, MotionOptions};
pub use conventions::{HandConvention, Translation, UpAxis};
pub use own::write_motion;
pub use rest::RestPose;

/// A sequence of body parameters, as its source has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// The parameters of each frame (T), at least one.
    pub frames: Vec<BodyParameters>,
    /// How fast the frames follow each other, if the source says.
    pub frames_per_second: Option<f32>,
    /// The axis that points up.
    pub up: UpAxis,
    /// Whether the format leaves no doubt about `up`, so that a body that lies down is not taken for a world that does.
    pub up_is_certain: bool,
    /// Where the motion is from: the path and the format it was read as.
    pub source: String,
    /// Parameters that the source does not have, so that they are zero in every frame.
    pub zeroed: Vec<String>,
    /// What else the reader has to say, a line each.
    pub notes: Vec<String>,
}

/// Reads a motion: a folder of X-Humans frames (or a sequence's folder with `SMPLX` in it), one such frame, or an npz file.
///
/// # Errors
/// [`Error::Missing`] if nothing is there; [`Error::Mismatch`] listing each format and what it lacks if the file is in none;
/// [`Error::Malformed`] naming the array, or the frame's file, that breaks its format.
pub fn read_motion(path: impl AsRef<Path>) -> Result<Motion> {
    read_motion_onto(path.as_ref(), &RestPose::default())
}

/// Reads a motion for a body with this skeleton, onto which motions of other skeletons are turned.
fn read_motion_onto(path: &Path, _rest: &RestPose) -> Result<Motion> {
    if path.is_dir() {
        return read_folder(path);
    }
    if path.is_file() && path.extension().is_some_and(|extension| extension == "pkl") {
        return read_frames(path, &[path.into()]);
    }
    if !path.is_file() {
        return Err(Error::Missing {
            path: path.into(),
            what: "a motion".into(),
            remedy: "give an npz file, or a folder of X-Humans SMPLX/*.pkl or one of them".into(),
        });
    }
    let arrays = read_npz(path)?;
    for (recognised, read) in FORMATS {
        if recognised(&arrays).is_ok() {
            return read(path, &arrays);
        }
    }
    let lacks: Vec<&str> = FORMATS.iter().filter_map(|(recognised, _)| recognised(&arrays).err()).collect();
    Err(Error::Mismatch {
        path: path.into(),
        found: format!("arrays {}", arrays.keys().map(String::as_str).collect::<Vec<_>>().join(", ")),
        expected: format!("a motion ({})", lacks.join("; ")),
        remedy: "see docs/motion.md for the formats".into(),
    })
}

/// Whether arrays are in a format, or what they lack; and its reader.
type Format = (fn(&ArrayMap) -> std::result::Result<(), &'static str>, fn(&Path, &ArrayMap) -> Result<Motion>);

const FORMATS: [Format; 3] =
    [(own::recognised, own::read), (amass::recognised, amass::read), (grab::recognised, grab::read)];

fn read_folder(folder: &Path) -> Result<Motion> {
    let files = motion_files(folder)?;
    if files.is_empty() {
        return Err(Error::Missing {
            path: folder.into(),
            what: "a frame (mesh-f00001_smplx.pkl)".into(),
            remedy: "give the SMPLX folder of an X-Humans sequence, or an npz file".into(),
        });
    }
    read_frames(folder, &files)
}

/// The frames of X-Humans parameter files.
fn read_frames(source: &Path, files: &[PathBuf]) -> Result<Motion> {
    let frame = |file: &Path| parameters_of(file, &read_pickle_arrays(file)?);
    let frames = files.iter().map(|file| frame(file)).collect::<Result<_>>()?;
    Ok(Motion {
        frames,
        source: format!("{} (X-Humans frames)", source.display()),
        zeroed: vec!["betas".into()],
        up_is_certain: true,
        ..Motion::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Array, write_npz};

    #[test]
    fn a_file_in_no_format_is_told_what_each_lacks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.npz");
        write_npz(&path, &ArrayMap::from([("lin0".into(), Array::from_f32(&[1], vec![0.0]))])).unwrap();
        let message = read_motion(&path).unwrap_err().to_string();
        for word in ["lin0", "body_pose", "poses", "body.params", "AMASS", "GRAB"] {
            assert!(message.contains(word), "{message}");
        }
    }
}
