//! Arrays of a file by their names: of the shape that is expected, or an error that names the one that is not.

use std::path::Path;

use glam::DVec3;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};

/// Arrays, and where they are from.
#[derive(Clone, Copy)]
pub(crate) struct NamedArrays<'a> {
    pub path: &'a Path,
    pub arrays: &'a ArrayMap,
    /// What the file is, for messages.
    pub format: &'static str,
}

impl<'a> NamedArrays<'a> {
    /// Of what a training keeps.
    pub fn of_state(path: &'a Path, arrays: &'a ArrayMap) -> Self {
        Self { path, arrays, format: "state of a training" }
    }

    pub fn wrong(self, name: &str, expected: impl std::fmt::Display) -> Error {
        let found = self.arrays.get(name).map_or("missing".into(), Array::description);
        let (path, place) = (self.path.into(), format!("`{name}`"));
        Error::Malformed { path, format: self.format, place, found, expected: expected.to_string() }
    }

    /// The extents of an array; all zero if it has not so many, or is missing.
    pub fn extents<const D: usize>(self, name: &str) -> [usize; D] {
        let shape = self.arrays.get(name).map(|array| array.shape.as_slice());
        shape.and_then(|shape| shape.try_into().ok()).unwrap_or([0; D])
    }

    /// Finite numbers of this shape.
    pub fn numbers(self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let array = self.arrays.get(name).filter(|array| array.shape == shape);
        let numbers = array.and_then(Array::to_f64).filter(|numbers| numbers.iter().all(|number| number.is_finite()));
        numbers.ok_or_else(|| self.wrong(name, format_args!("finite numbers of shape {shape:?}")))
    }

    /// Finite numbers, however many.
    pub fn list(self, name: &str) -> Result<Vec<f64>> {
        let [count] = self.extents(name);
        self.numbers(name, &[count])
    }

    /// So many points, (N, 3).
    pub fn points(self, name: &str, count: usize) -> Result<Vec<DVec3>> {
        Ok(points_of(&self.numbers(name, &[count, 3])?))
    }

    /// Whole numbers below a limit, however many.
    pub fn places(self, name: &str, limit: usize) -> Result<Vec<usize>> {
        let places = self.arrays.get(name).and_then(|array| array.to_indices(limit));
        let places = places.ok_or_else(|| self.wrong(name, format_args!("whole numbers below {limit}")))?;
        Ok(places.into_iter().map(|place| place as usize).collect())
    }
}

/// Three numbers a point.
pub(crate) fn points_of(numbers: &[f64]) -> Vec<DVec3> {
    numbers.as_chunks::<3>().0.iter().map(|point| DVec3::from_array(*point)).collect()
}

/// Points as numbers.
pub(crate) fn flat<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Vec<f64> {
    points.into_iter().flat_map(|point| point.to_array()).collect()
}

/// Numbers in double precision.
pub(crate) fn array(shape: &[usize], numbers: Vec<f64>) -> Array {
    Array { shape: shape.to_vec(), data: ArrayData::F64(numbers) }
}

/// Whole numbers.
pub(crate) fn whole(numbers: impl IntoIterator<Item = usize>) -> Array {
    let numbers: Vec<i64> = numbers.into_iter().map(|number| number as i64).collect();
    Array { shape: vec![numbers.len()], data: ArrayData::I64(numbers) }
}
