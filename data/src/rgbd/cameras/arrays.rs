//! Cameras as named matrices: `intrinsic` and `extrinsic` in npz, JSON or TOML.

use std::path::Path;

use glam::{Mat4, Vec4};
use serde_json::{Map, Value};
use xavatar_formats::{Array, ArrayData, ArrayMap, Result, read_npz, read_text};

use super::{Matrices, malformed, open3d};

/// Reads the file; JSON and TOML by their extensions, others as npz.
pub(super) fn read(path: &Path) -> Result<Matrices> {
    let wrong = |error: &dyn std::fmt::Display| malformed(path, "the text", error, "a table of matrices");
    let table: Map<String, Value> =
        match path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("json") => serde_json::from_str(&read_text(path)?).map_err(|error| wrong(&error))?,
            Some("toml") => toml::from_str(&read_text(path)?).map_err(|error| wrong(&error.message()))?,
            _ => return of_arrays(path, &read_npz(path)?),
        };
    if let Some(found) = open3d::matrices(path, &table)? {
        return Ok(found);
    }
    let mut arrays = ArrayMap::new();
    for key in ["intrinsic", "extrinsic"] {
        if let Some(value) = table.get(key) {
            arrays.insert(key.to_owned(), array(path, key, value)?);
        }
    }
    of_arrays(path, &arrays)
}

fn of_arrays(path: &Path, arrays: &ArrayMap) -> Result<Matrices> {
    let of = |key: &str| arrays.get(key).map(|array| matrices(path, key, array)).transpose();
    Ok(Matrices { intrinsics: of("intrinsic")?, extrinsics: of("extrinsic")? })
}

/// The numbers of nested lists.
pub(super) fn array(path: &Path, key: &str, value: &Value) -> Result<Array> {
    let mut numbers = Vec::new();
    let shape = flatten(value, &mut numbers)
        .ok_or_else(|| malformed(path, key, "ragged or not of numbers", "rows of equally many numbers"))?;
    Ok(Array { shape, data: ArrayData::F64(numbers) })
}

/// Appends the numbers of nested lists and returns their extents; `None` if lists differ in length or hold something else.
fn flatten(value: &Value, numbers: &mut Vec<f64>) -> Option<Vec<usize>> {
    let Some(items) = value.as_array() else {
        numbers.push(value.as_f64()?);
        return Some(Vec::new());
    };
    let mut inner: Option<Vec<usize>> = None;
    for item in items {
        let shape = flatten(item, numbers)?;
        if inner.get_or_insert_with(|| shape.clone()) != &shape {
            return None;
        }
    }
    let mut shape = inner.unwrap_or_default();
    shape.insert(0, items.len());
    Some(shape)
}

/// Matrices of 3 or 4 rows and columns, each filled up to 4 x 4 with the identity.
pub(super) fn matrices(path: &Path, key: &str, array: &Array) -> Result<Vec<Mat4>> {
    let (rows, columns) = match array.shape[..] {
        [rows @ (3 | 4), columns @ (3 | 4)] | [_, rows @ (3 | 4), columns @ (3 | 4)] => (rows, columns),
        _ => return Err(malformed(path, key, array.description(), "one matrix, or one a frame")),
    };
    let values = array.to_f32().filter(|values| values.iter().all(|value| value.is_finite()));
    let values = values.ok_or_else(|| malformed(path, key, "not all finite", "finite numbers"))?;
    let matrices: Vec<Mat4> = values.chunks_exact(rows * columns).map(|entries| filled(entries, columns)).collect();
    if matrices.is_empty() {
        return Err(malformed(path, key, array.description(), "at least one matrix"));
    }
    Ok(matrices)
}

/// The matrix with these entries, row by row, and those of the identity where there are none.
pub(super) fn filled(entries: &[f32], columns: usize) -> Mat4 {
    let row = |row: usize| {
        let entry = |column: usize| match entries.get(row * columns + column) {
            Some(entry) if column < columns => *entry,
            _ => f32::from(u8::from(row == column)),
        };
        Vec4::from_array(std::array::from_fn(entry))
    };
    Mat4::from_cols(row(0), row(1), row(2), row(3)).transpose()
}
