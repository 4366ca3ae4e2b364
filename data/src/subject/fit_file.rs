//! A frame's registration in a file of arrays: pickle, npz, JSON ...; parameters by every name that motions know.
//!
//! Rotations are vectors or matrices, hands 45 numbers, matrices or PCA coefficients (smplx's default, relative to the mean
//! hand). All joints of SMPL, SMPL+H, MANO, FLAME or SUPR are a pose of that family. THuman2 adds `scale` and `translation`: its
//! scans are scale * body + translation.

use std::path::Path;

use glam::Vec3;

use crate::motion::{has_named, read_named};
use crate::whole_poses::{joints_of_frame, read_whole_poses};
use crate::xhumans::parameters_of;
use xavatar_body::{BodyParameters, Gender, mano, smplx};
use xavatar_formats::{Array, ArrayFile, ArrayMap, Error, Result};

const FORMAT: &str = "registration";
/// Families whose whole poses are told by their number of joints.
const FAMILIES: [(usize, &str); 4] = [(24, "SMPL"), (52, "SMPL+H"), (mano::JOINTS, "MANO"), (5, "FLAME")];

/// Whose joints a registration turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Registered {
    pub family: &'static str,
    pub joints: usize,
}

/// SMPL-X's.
const SMPLX: Registered = Registered { family: "SMPL-X", joints: smplx::joint::COUNT };

/// A frame's registration, as its file has it.
pub(super) struct Fit {
    /// The shape is left out.
    pub parameters: BodyParameters,
    /// The file's own shape, if it has one.
    pub betas: Option<Vec<f32>>,
    /// The skeleton that the parameters are of.
    pub registered: Registered,
    /// The scan's size by the body's, and the shift of the scan, metres of the scan.
    pub scaled: Option<(f32, Vec3)>,
    pub gender: Option<Gender>,
    /// Parameters that the file does not have.
    pub absent: Vec<String>,
}

/// Reads a frame's registration.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`], [`Error::Refused`]; [`Error::Mismatch`] for a file of something else, or of several frames.
pub(super) fn read_fit(path: &Path) -> Result<Fit> {
    let file = ArrayFile::read(path)?.ok_or_else(|| Error::Mismatch {
        path: path.into(),
        found: "none of a pickle, npz or JSON".into(),
        expected: "a registration (parameters of one frame)".into(),
        remedy: "docs/formats.md has the names and shapes".into(),
    })?;
    let arrays = &file.arrays;
    let scaled = scaling(path, arrays)?;
    let gender = arrays.get("gender").and_then(Array::text).and_then(|text| text.parse().ok());
    let fit = |parameters, betas, registered, absent| Fit { parameters, betas, registered, scaled, gender, absent };
    if let Some((registered, parameters)) = whole_pose(path, arrays)? {
        return Ok(fit(parameters, own_betas(arrays), registered, Vec::new()));
    }
    // All parameters under smplx's names, as X-Humans has them; or under other names, or some of them.
    let motion = match parameters_of(path, arrays) {
        Ok(parameters) => return Ok(fit(parameters.into(), own_betas(arrays), SMPLX, Vec::new())),
        Err(_) if has_named(arrays).is_ok() => read_named(path, arrays)?,
        Err(error) => return Err(error),
    };
    let count = motion.frames.len();
    let [mut parameters] = <[smplx::Parameters; 1]>::try_from(motion.frames).map_err(|_| several(path, count))?;
    if scaled.is_some() && !arrays.contains_key("transl") {
        // `translation` is the scan's, not the body's.
        parameters.transl = Vec3::ZERO;
    }
    let betas = std::mem::take(&mut parameters.betas);
    let betas = (!betas.is_empty() && !motion.zeroed.iter().any(|name| name == "betas")).then_some(betas);
    Ok(fit(parameters.into(), betas, SMPLX, motion.zeroed))
}

/// The pose of a file with the rotations of all joints of a family, or of a number of joints that no family has a name for.
fn whole_pose(path: &Path, arrays: &ArrayMap) -> Result<Option<(Registered, BodyParameters)>> {
    let known = joints_of_frame(arrays, &FAMILIES.map(|(joints, _)| joints));
    let registered = match known.and_then(|known| FAMILIES.iter().find(|(joints, _)| *joints == known)) {
        Some((joints, family)) => Registered { family, joints: *joints },
        None if has_named(arrays).is_err() => match arrays.get("pose").and_then(Array::to_f32) {
            Some(pose) if !pose.is_empty() && pose.len() % 3 == 0 => {
                Registered { family: "another body", joints: pose.len() / 3 }
            }
            _ => return Ok(None),
        },
        None => return Ok(None),
    };
    let frames = read_whole_poses(path, arrays, registered.joints)?.unwrap_or_default();
    let [parameters] = <[BodyParameters; 1]>::try_from(frames).map_err(|frames| several(path, frames.len()))?;
    Ok(Some((registered, parameters)))
}

fn several(path: &Path, count: usize) -> Error {
    Error::Mismatch {
        path: path.into(),
        found: format!("the registrations of {count} frames"),
        expected: "one frame's".into(),
        remedy: "write one file a frame".into(),
    }
}

/// THuman2's similarity, if the file has one.
fn scaling(path: &Path, arrays: &ArrayMap) -> Result<Option<(f32, Vec3)>> {
    let numbers = |key: &str| arrays.get(key).and_then(Array::to_f32);
    let Some(scale) = numbers("scale") else { return Ok(None) };
    let malformed = |place: &str, found: String, expected: &str| Error::Malformed {
        path: path.into(),
        format: FORMAT,
        place: format!("`{place}`"),
        found,
        expected: expected.into(),
    };
    let &[scale] = scale.as_slice() else {
        return Err(malformed("scale", format!("{} numbers", scale.len()), "one number"));
    };
    if !(scale.is_finite() && scale > 0.0) {
        return Err(malformed("scale", scale.to_string(), "a positive number"));
    }
    let shift = numbers("translation").unwrap_or_else(|| vec![0.0; 3]);
    match <[f32; 3]>::try_from(shift) {
        Ok(shift) if shift.iter().all(|value| value.is_finite()) => Ok(Some((scale, shift.into()))),
        _ => Err(malformed("translation", "no shift".into(), "3 finite numbers")),
    }
}

/// The frame's own shape coefficients, as many as are used.
fn own_betas(arrays: &ArrayMap) -> Option<Vec<f32>> {
    let mut values = arrays.get("betas")?.to_f32()?;
    values.truncate(smplx::SHAPES);
    values.iter().all(|value| value.is_finite()).then_some(values)
}
