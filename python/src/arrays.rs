//! Between the library's rows and numpy's arrays: outwards the memory is handed over, inwards it is read in place where it is contiguous
//! and of the type that is wanted.

use glam::Vec3;
use numpy::{
    Element, IntoPyArray, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
    dtype,
};
use pyo3::prelude::*;

use crate::errors::refused;

/// Points (N, 3), whose memory the array takes over.
pub fn array_of_points(py: Python<'_>, points: Vec<Vec3>) -> PyResult<Bound<'_, PyArray2<f32>>> {
    // Collected in place: the same memory, without a copy.
    array_of_rows(py, points.into_iter().map(|point| point.to_array()).collect())
}

/// Rows (N, M), whose memory the array takes over.
pub fn array_of_rows<T: Element, const M: usize>(
    py: Python<'_>,
    rows: Vec<[T; M]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    rows.into_flattened().into_pyarray(py).reshape([count, M])
}

/// Rows of frames (B, N, M), whose memory the array takes over.
pub fn array_of_frames<T: Element, const M: usize>(
    py: Python<'_>,
    rows: Vec<[T; M]>,
    frames: usize,
) -> PyResult<Bound<'_, PyArray3<T>>> {
    let count = rows.len() / frames.max(1);
    rows.into_flattened().into_pyarray(py).reshape([frames, count, M])
}

/// Numbers that were given, contiguous and of type T.
pub struct Numbers<'py, T: Element>(PyReadonlyArrayDyn<'py, T>);

impl<'py, T: Element> Numbers<'py, T> {
    /// Those of an array, a tensor or a list.
    pub fn of(given: &Bound<'py, PyAny>) -> PyResult<Self> {
        let py = given.py();
        let array = py.import("numpy")?.call_method1("ascontiguousarray", (given, dtype::<T>(py)))?;
        Ok(Self(array.cast_into::<PyArrayDyn<T>>()?.readonly()))
    }

    /// The shape.
    pub fn shape(&self) -> &[usize] {
        self.0.shape()
    }

    /// All numbers, row by row.
    pub fn values(&self) -> PyResult<&[T]> {
        Ok(self.0.as_slice()?)
    }

    /// The numbers in rows of M, if the shape is some rows of `per_frame` numbers; the shape is (B, ...).
    pub fn frames(&self, name: &str, per_frame: usize, expected: &str) -> PyResult<usize> {
        match self.shape() {
            [frames, rest @ ..] if !rest.is_empty() && rest.iter().product::<usize>() == per_frame => Ok(*frames),
            found => Err(refused(name, format!("of shape {found:?}"), expected)),
        }
    }

    /// The numbers as rows of M.
    pub fn rows<const M: usize>(&self, name: &str) -> PyResult<&[[T; M]]> {
        match self.values()?.as_chunks::<M>() {
            (rows, []) => Ok(rows),
            _ => Err(refused(name, format!("of shape {:?}", self.shape()), format!("rows of {M}"))),
        }
    }
}

/// Points (N, 3) that were given.
pub fn points(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Vec3>> {
    Ok(Numbers::<f32>::of(given)?.rows(name)?.iter().copied().map(Vec3::from_array).collect())
}
