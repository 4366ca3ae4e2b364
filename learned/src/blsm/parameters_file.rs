//! The file of parameters of a BLSM body, one frame or several: an npz of plain arrays.
//!
//! `global_orient` (T, 3) axis-angle and `transl` (T, 3) of the root, `angles` (T, A) of the atoms, radians, `bones` (T, K), `shape` (T, S).

use std::path::Path;

use glam::DVec3;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};
use xavatar_register::linear::so3;

use super::{BlsmBody, BlsmParameters};

const FORMAT: &str = "file of a BLSM body's parameters";
const ANGLES: &str = "angles";

impl BlsmBody {
    /// Whether arrays are those of parameters.
    pub fn has_parameters(arrays: &ArrayMap) -> bool {
        arrays.contains_key(ANGLES)
    }

    /// The parameters of each frame of a file, whose `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] for an array that is missing, not of this body, or not finite.
    pub fn parameters_of(&self, path: &Path, arrays: &ArrayMap) -> Result<Vec<BlsmParameters>> {
        let malformed = |name: &str, found: String, expected: String| Error::Malformed {
            path: path.into(),
            format: FORMAT,
            place: format!("`{name}`"),
            found,
            expected,
        };
        let frames = arrays.get(ANGLES).and_then(|array| array.shape.first()).copied().unwrap_or(0);
        let rows = |name: &str, width: usize| -> Result<Vec<Vec<f64>>> {
            let expected = || format!("{frames} rows of {width} finite numbers, for {} joints", self.names.len());
            let Some(array) = arrays.get(name) else { return Err(malformed(name, "missing".into(), expected())) };
            let numbers = array.to_f64().filter(|numbers| numbers.iter().all(|number| number.is_finite()));
            match numbers.filter(|_| array.shape == [frames, width]) {
                Some(numbers) if width > 0 => Ok(numbers.chunks_exact(width).map(<[f64]>::to_vec).collect()),
                Some(_) => Ok(vec![Vec::new(); frames]),
                None => Err(malformed(name, format!("an array {:?}", array.shape), expected())),
            }
        };
        let (turns, places) = (rows("global_orient", 3)?, rows("transl", 3)?);
        let angles = rows(ANGLES, self.atoms.count())?;
        let (bones, shapes) = (rows("bones", self.bone_basis.len())?, rows("shape", self.shape_basis.len())?);
        let of_frame = |frame: usize| BlsmParameters {
            turn: so3::exp(DVec3::from_slice(&turns[frame])),
            translation: DVec3::from_slice(&places[frame]),
            atoms: self.atoms.coordinates(&angles[frame]),
            bones: bones[frame].clone(),
            shape: shapes[frame].clone(),
        };
        Ok((0..frames).map(of_frame).collect())
    }

    /// The arrays of a file of these frames.
    pub fn parameter_arrays(&self, frames: &[BlsmParameters]) -> ArrayMap {
        let array = |name: &str, width: usize, row: fn(&Self, &BlsmParameters) -> Vec<f64>| {
            let data = ArrayData::F64(frames.iter().flat_map(|frame| row(self, frame)).collect());
            (name.to_owned(), Array { shape: vec![frames.len(), width], data })
        };
        ArrayMap::from([
            array("global_orient", 3, |_, of| so3::log(&of.turn).to_array().to_vec()),
            array("transl", 3, |_, of| of.translation.to_array().to_vec()),
            array(ANGLES, self.atoms.count(), |body, of| body.atoms.angles(&of.atoms)),
            array("bones", self.bone_basis.len(), |_, of| of.bones.clone()),
            array("shape", self.shape_basis.len(), |_, of| of.shape.clone()),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blsm::derivatives::tests::{parameters, reference_body};

    #[test]
    fn parameters_survive_their_file_and_others_are_refused() {
        let (body, golden) = reference_body();
        let frames: Vec<BlsmParameters> = (0..3).map(|row| parameters(&golden, row, "")).collect();
        let arrays = body.parameter_arrays(&frames);
        let found = body.parameters_of(Path::new("a.npz"), &arrays).unwrap();
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(&frames) {
            let (found, expected) = (body.posed(found).vertices, body.posed(expected).vertices);
            assert!(found.iter().zip(expected).all(|(found, expected)| found.distance(expected) < 1e-9));
        }
        for (name, array) in &arrays {
            let mut wrong = arrays.clone();
            let shape = vec![3, array.shape[1] + 1];
            wrong.insert(name.clone(), Array { data: ArrayData::F64(vec![0.0; shape.iter().product()]), shape });
            let message = body.parameters_of(Path::new("a.npz"), &wrong).unwrap_err().to_string();
            assert!(message.contains(&format!("`{name}`")), "{message}");
        }
    }
}
