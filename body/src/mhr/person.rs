//! A person that SAM 3D Body found in a picture, as its results are written: an npz with MHR's parameters.

use std::path::Path;

use xavatar_formats::{Array, Error, Result, read_npz};

/// A person's parameters.
pub(super) struct Person {
    /// Coefficients of identity.
    pub identity: Vec<f64>,
    /// Pose, then scales of the skeleton.
    pub parameters: Vec<f64>,
}

impl Person {
    /// Reads a result, given how many coefficients and parameters the model has.
    ///
    /// # Errors
    /// [`Error::Mismatch`] naming the array that is not there or has another length.
    pub fn read(path: &Path, identity: usize, parameters: usize) -> Result<Self> {
        let arrays = read_npz(path)?;
        let numbers = |name: &str, count: usize| {
            let array = arrays.get(name);
            let numbers = array.and_then(Array::to_f64).filter(|numbers| numbers.len() == count);
            numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())).ok_or_else(|| Error::Mismatch {
                path: path.into(),
                found: format!("`{name}`: {}", array.map_or("nothing of this name".into(), Array::description)),
                expected: format!("{count} finite numbers"),
                remedy: "give the npz of one person that SAM 3D Body wrote".into(),
            })
        };
        Ok(Self { identity: numbers("shape_params", identity)?, parameters: numbers("mhr_model_params", parameters)? })
    }
}
