//! A frame's registration in a file of arrays: pickle, npz, JSON ...; parameters by every name that motions know.
//!
//! Rotations are vectors or matrices, hands 45 numbers, matrices or PCA coefficients (smplx's default, relative to the mean
//! hand). One array with all joints of SMPL or SMPL+H is a pose of that family. THuman2 adds `scale` and `translation`: its
//! scans are scale * body + translation.

use std::path::Path;

use glam::Vec3;

use crate::motion::{has_named, read_named};
use crate::xhumans::parameters_of;
use xavatar_body::{BodyParameters, Gender, Pose, PoseAxisAngle, Skeleton, smpl, smplh, smplx};
use xavatar_formats::{Array, ArrayFile, ArrayMap, Error, Result};

const FORMAT: &str = "registration";
/// Names of one array with all rotations of a frame.
const WHOLE_POSE: [&str; 6] = ["pose", "poses", "smpl_pose", "smplh_pose", "full_pose", "thetas"];
const TRANSLATION: [&str; 4] = ["transl", "trans", "translation", "Th"];

/// A frame's registration, as its file has it.
pub(super) struct Fit {
    /// The shape is left out.
    pub parameters: BodyParameters,
    /// The file's own shape, if it has one.
    pub betas: Option<Vec<f32>>,
    /// The skeleton that the parameters are of.
    pub skeleton: &'static Skeleton,
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
    let fit = |parameters, betas, skeleton, absent| Fit { parameters, betas, skeleton, scaled, gender, absent };
    if let Some((skeleton, pose)) = whole_pose(path, arrays)? {
        return Ok(fit(pose.into(), own_betas(arrays), skeleton, Vec::new()));
    }
    // All parameters under smplx's names, as X-Humans has them; or under other names, or some of them.
    let motion = match parameters_of(path, arrays) {
        Ok(parameters) => return Ok(fit(parameters.into(), own_betas(arrays), smplx::skeleton(), Vec::new())),
        Err(_) if has_named(arrays).is_ok() => read_named(path, arrays)?,
        Err(error) => return Err(error),
    };
    let count = motion.frames.len();
    let [mut parameters] = <[smplx::Parameters; 1]>::try_from(motion.frames).map_err(|_| Error::Mismatch {
        path: path.into(),
        found: format!("the registrations of {count} frames"),
        expected: "one frame's".into(),
        remedy: "write one file a frame".into(),
    })?;
    if scaled.is_some() && !arrays.contains_key("transl") {
        // `translation` is the scan's, not the body's.
        parameters.transl = Vec3::ZERO;
    }
    let betas = std::mem::take(&mut parameters.betas);
    let betas = (!betas.is_empty() && !motion.zeroed.iter().any(|name| name == "betas")).then_some(betas);
    Ok(fit(parameters.into(), betas, smplx::skeleton(), motion.zeroed))
}

/// The pose of a file with all joints of SMPL or SMPL+H in one array, or SMPL's with the root in another.
fn whole_pose(path: &Path, arrays: &ArrayMap) -> Result<Option<(&'static Skeleton, Pose)>> {
    let numbers = |key: &str| arrays.get(key).and_then(Array::to_f32);
    let whole = WHOLE_POSE.iter().find_map(|name| numbers(name));
    let in_two = || Some([numbers("global_orient")?, numbers("body_pose").filter(|body| body.len() == 69)?].concat());
    let Some(values) = whole.or_else(in_two) else { return Ok(None) };
    let families = [smpl::skeleton(), smplh::skeleton()];
    let Some(skeleton) = families.into_iter().find(|skeleton| 3 * skeleton.joints.len() == values.len()) else {
        return Ok(None);
    };
    let translation = TRANSLATION.iter().find_map(|name| numbers(name)).unwrap_or_else(|| vec![0.0; 3]);
    let translation: [f32; 3] = translation.try_into().map_err(|found: Vec<f32>| Error::Malformed {
        path: path.into(),
        format: FORMAT,
        place: "the translation".into(),
        found: format!("{} numbers", found.len()),
        expected: "3 numbers".into(),
    })?;
    let rotations = values.as_chunks::<3>().0.iter().map(|&vector| PoseAxisAngle(vector.into())).collect();
    Ok(Some((skeleton, Pose { rotations, translation: translation.into(), ..Pose::default() })))
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
