//! A frame's registration in a file: pickle, npz or JSON, told by its first bytes; parameters by every name that motions know.
//!
//! Rotations are vectors or matrices, hands 45 numbers, matrices or PCA coefficients (smplx's default, relative to the mean
//! hand). THuman2 adds `scale` and `translation`: its scans are scale * body + translation.

use std::path::Path;

use glam::Vec3;

use crate::json::read_json_arrays;
use crate::motion::{has_named, read_named};
use crate::xhumans::parameters_of;
use xavatar_body::{Gender, smplx};
use xavatar_formats::{Array, ArrayMap, Error, Result, open_file, read_npz, read_pickle_arrays};

/// A frame's registration, as its file has it.
pub(super) struct Fit {
    /// The file's own shape included.
    pub parameters: smplx::Parameters,
    /// Whether the file has a shape.
    pub has_betas: bool,
    /// The scan's size by the body's, and the shift of the scan, metres of the scan.
    pub scaled: Option<(f32, Vec3)>,
    pub gender: Option<Gender>,
    /// Parameters that the file does not have.
    pub absent: Vec<String>,
}

/// Reads a frame's registration.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`], [`Error::Refused`]; [`Error::Mismatch`] for a registration of SMPL or SMPL+H, or of
/// several frames.
pub(super) fn read_fit(path: &Path) -> Result<Fit> {
    let arrays = read_arrays(path)?;
    refuse_other_families(path, &arrays)?;
    let gender = arrays.get("gender").and_then(Array::text).and_then(|text| text.parse().ok());
    let scaled = scaling(path, &arrays)?;
    let has_betas = arrays.keys().any(|key| matches!(leaf(key), "betas" | "shape"));
    // All parameters under smplx's names, as X-Humans has them; or under other names, or some of them.
    let motion = match parameters_of(path, &arrays) {
        Ok(parameters) => {
            let parameters = smplx::Parameters { betas: own_betas(&arrays).unwrap_or_default(), ..parameters };
            return Ok(Fit { parameters, has_betas, scaled, gender, absent: Vec::new() });
        }
        Err(_) if has_named(&arrays).is_ok() => read_named(path, &arrays)?,
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
    Ok(Fit { parameters, has_betas, scaled, gender, absent: motion.zeroed })
}

fn read_arrays(path: &Path) -> Result<ArrayMap> {
    let mut start = Vec::new();
    let file = open_file(path)?;
    std::io::Read::read_to_end(&mut std::io::Read::take(file, 2), &mut start).map_err(Error::io(path))?;
    match start.as_slice() {
        b"PK" => read_npz(path),
        [0x80, ..] => read_pickle_arrays(path),
        [first, ..] if b"{ \n\r\t".contains(first) => read_json_arrays(path),
        _ if path.extension().is_some_and(|extension| extension == "pkl") => read_pickle_arrays(path),
        _ => Err(Error::Mismatch {
            path: path.into(),
            found: "neither a pickle nor npz nor JSON".into(),
            expected: "a registration (SMPL-X parameters of one frame)".into(),
            remedy: "docs/formats.md has the names and shapes".into(),
        }),
    }
}

/// Shape and joints of other models mean other things, so their registrations would put the body beside the scan.
fn refuse_other_families(path: &Path, arrays: &ArrayMap) -> Result<()> {
    let family = arrays.iter().find_map(|(key, array)| {
        let count: usize = array.shape.iter().product();
        match (leaf(key), count) {
            ("pose" | "poses" | "smpl_pose" | "full_pose" | "thetas", 72) | ("body_pose", 69) => {
                Some(("SMPL", key, count))
            }
            ("pose" | "poses" | "full_pose", 156) => Some(("SMPL+H", key, count)),
            _ => None,
        }
    });
    let Some((family, key, count)) = family else { return Ok(()) };
    Err(Error::Mismatch {
        path: path.into(),
        found: format!("a registration of {family} (`{key}` of {count} numbers)"),
        expected: "one of SMPL-X: its shape coefficients and joints are others".into(),
        remedy: "fit SMPL-X to the scan, or convert with smplx's transfer_model".into(),
    })
}

/// THuman2's similarity, if the file has one.
fn scaling(path: &Path, arrays: &ArrayMap) -> Result<Option<(f32, Vec3)>> {
    let numbers = |key: &str| arrays.get(key).and_then(Array::to_f32);
    let Some(scale) = numbers("scale") else { return Ok(None) };
    let malformed = |place: &str, found: String, expected: &str| Error::Malformed {
        path: path.into(),
        format: "registration",
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

/// The name after the last dot.
fn leaf(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}
