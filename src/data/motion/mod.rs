//! Motions: sequences of SMPL-X parameters to animate an avatar with (docs/motion.md).
//!
//! Read from X-Humans `SMPLX` folders, AMASS and GRAB archives, and our own npz, which is also written. Each keeps the
//! hand convention of its source, as a type. T frames; radians, metres. AMASS and GRAB point Z up, unlike everything
//! else here: [`Motion::turned_from_z_up`].

mod amass;
mod frames;
mod grab;
mod own;

use std::path::{Path, PathBuf};

use glam::{Quat, Vec3};

use super::xhumans::{motion_files, parameters_of};
use super::{ArrayMap, read_npz, read_pickle_arrays};
use crate::body::{BodyParameters, PoseAxisAngle};
use crate::{Error, Result};

pub use own::write_motion;

/// A sequence of body parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// The parameters of each frame (T), at least one.
    pub frames: Vec<BodyParameters>,
    /// How fast the frames follow each other, if the source says.
    pub frames_per_second: Option<f32>,
    /// Where the motion is from: the path and the format it was read as.
    pub source: String,
    /// Parameters that the source does not have, so that they are zero in every frame.
    pub zeroed: Vec<String>,
}

impl Motion {
    /// The motion, made with Z up, in this library's Y up: rotated by -90 degrees about X.
    ///
    /// The whole motion is also shifted by the constant vector between the pelvis and its rotated position, less than
    /// half a metre: the rotation is about the body model's origin only once a model is known.
    #[must_use]
    pub fn turned_from_z_up(mut self) -> Self {
        let turn = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        for frame in &mut self.frames {
            let orientation = turn * Quat::from_scaled_axis(frame.global_orient.0);
            frame.global_orient = PoseAxisAngle(orientation.to_scaled_axis());
            frame.transl = Vec3::new(frame.transl.x, frame.transl.z, -frame.transl.y);
        }
        self
    }
}

/// Reads a motion: a folder of X-Humans frames (or a sequence's folder with `SMPLX` in it), one such frame, or an npz file.
///
/// # Errors
/// [`Error::Missing`] if nothing is there; [`Error::Mismatch`] listing each format and what it lacks if the file is in none;
/// [`Error::Malformed`] naming the array, or the frame's file, that breaks its format.
pub fn read_motion(path: impl AsRef<Path>) -> Result<Motion> {
    let path = path.as_ref();
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
        frames_per_second: None,
        source: format!("{} (X-Humans frames)", source.display()),
        zeroed: vec!["betas".into()],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Array, write_npz};

    // Lying on the back in Y up is standing in Z up: Z-up data of a standing body turns its Y axis to Z by +90 degrees.
    #[test]
    fn standing_in_z_up_is_standing_in_y_up() {
        let standing = BodyParameters {
            global_orient: PoseAxisAngle(Vec3::X * std::f32::consts::FRAC_PI_2),
            transl: Vec3::new(1.0, 2.0, 3.0),
            ..Default::default()
        };
        let motion = Motion { frames: vec![standing], frames_per_second: None, source: String::new(), zeroed: vec![] };
        let turned = motion.turned_from_z_up();
        assert!(turned.frames[0].global_orient.0.length() < 1e-6);
        assert_eq!(turned.frames[0].transl, Vec3::new(1.0, 3.0, -2.0));
    }

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
