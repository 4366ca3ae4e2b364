//! One frame of a subject: where its files are, and reading them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::fit_file::{Fit, read_fit};
use super::rules::Rules;
use super::scan_file::read_scan;
use crate::{FrameId, ScanFrame};
use glam::Vec3;
use xavatar_body::{BodyParameters, mano, smplx};
use xavatar_formats::{Choice, Error, Remedy, Result};
use xavatar_mesh::ReadMesh;

/// A file of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameFile {
    /// It is there.
    At(PathBuf),
    /// It is not where files of its kind are.
    Missing {
        /// Where they are.
        folder: PathBuf,
        /// What it would be called.
        name: String,
    },
}

/// A frame that exists on disk but is not read yet.
#[derive(Clone, Debug)]
pub struct FrameFiles {
    /// Which frame.
    pub id: FrameId,
    /// The scan.
    pub scan: FrameFile,
    /// The registration's parameters.
    pub parameters: FrameFile,
    pub(super) rules: Arc<Rules>,
}

impl FrameFile {
    /// The file, if it is there.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::At(path) => Some(path),
            Self::Missing { .. } => None,
        }
    }

    pub(super) fn require(&self, what: &str) -> Result<&Path> {
        let (path, what) = match self {
            Self::At(path) if path.exists() => return Ok(path),
            Self::At(path) => (path, what.to_owned()),
            Self::Missing { folder, name } => (folder, format!("{what} ({name})")),
        };
        Err(Error::Missing {
            path: path.clone(),
            what,
            remedy: Remedy::choosing(Choice::SkipBadFrames, "complete the data set, or leave the frame out"),
        })
    }
}

impl FrameFiles {
    /// The frame's registration with the subject's shape `betas`.
    ///
    /// # Errors
    /// Those of the file: missing, malformed, refused, or of another model; without the frame's name.
    pub fn read_parameters(&self, betas: &[f32]) -> Result<BodyParameters> {
        Ok(self.read_registration(betas)?.0)
    }

    /// The registration, and the scan's size by the body's with its shift, if the file has them.
    fn read_registration(&self, betas: &[f32]) -> Result<(BodyParameters, Option<(f32, Vec3)>)> {
        let Fit { parameters, scaled, .. } = read_fit(self.parameters.require("the frame's registration")?)?;
        let parameters = match parameters {
            BodyParameters::Absolute(pose) => pose.in_shape(betas).into(),
            BodyParameters::Smplx(parameters) => smplx::Parameters {
                betas: betas.to_vec(),
                left_hand_pose: self.rules.hand(0, parameters.left_hand_pose)?,
                right_hand_pose: self.rules.hand(1, parameters.right_hand_pose)?,
                ..*parameters
            }
            .into(),
            BodyParameters::Mano(parameters) => mano::Parameters {
                betas: betas.to_vec(),
                hand_pose: self.rules.hand(0, parameters.hand_pose)?,
                ..*parameters
            }
            .into(),
        };
        Ok((parameters, scaled))
    }
}

/// Reads a frame: its scan with texture or vertex colours, and its parameters with the subject's shape `betas`.
///
/// Every number is finite, every index in range and every length consistent in what is returned; the scan is in metres, where
/// its body is, by what the layout and the subject's [`ScanPlacement`](crate::ScanPlacement) say.
///
/// # Errors
/// [`Error::Frame`] naming the frame and, inside, the file: [`Error::Missing`], [`Error::Malformed`],
/// [`Error::Mismatch`] for an empty scan or a registration of another model, or [`Error::Refused`].
pub fn read_frame(files: &FrameFiles, betas: &[f32]) -> Result<ScanFrame> {
    let read = || {
        let ReadMesh { mesh: mut scan, notes } = read_scan(files.scan.require("the frame's scan")?)?;
        let (parameters, scaled) = files.read_registration(betas)?;
        if let Some((scale, shift)) = scaled {
            scan.vertices.iter_mut().for_each(|vertex| *vertex = (*vertex - shift) / scale);
        }
        for placement in &files.rules.placements {
            placement.apply(&mut scan, files.rules.place_of(placement.origin, &parameters)?);
        }
        let unseen_parts = files.rules.unseen.get(&files.id.to_string()).cloned().unwrap_or_default();
        Ok(ScanFrame { id: files.id.clone(), scan, parameters, unseen_parts, notes })
    };
    read().map_err(|error: Error| error.in_frame(files.id.to_string()))
}
