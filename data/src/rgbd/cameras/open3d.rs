//! Cameras as Open3D writes them: JSON with `intrinsic_matrix` (9 numbers) and `extrinsic` (16), column after column; as others write
//! them by the same names, in rows.
//!
//! A PinholeCameraIntrinsic is a camera without a place; PinholeCameraParameters have both, world to camera; a
//! PinholeCameraTrajectory is a list of these.

use std::path::Path;

use glam::Mat4;
use serde_json::{Map, Value};
use xavatar_formats::Result;

use super::arrays::{array, matrices as matrices_in};
use super::{Matrices, malformed};

/// The cameras of a table; `None` if it is none of Open3D's.
pub(super) fn matrices(path: &Path, table: &Map<String, Value>) -> Result<Option<Matrices>> {
    if let Some(list) = table.get("parameters").and_then(Value::as_array) {
        let cameras = list.iter().map(|camera| {
            let table = camera.as_object().and_then(|table| matrices(path, table).transpose()).transpose()?;
            match table {
                Some(Matrices { intrinsics: Some(intrinsics), extrinsics: Some(extrinsics) }) => {
                    Ok(intrinsics.into_iter().zip(extrinsics))
                }
                _ => Err(malformed(path, "parameters", "a list of other things", "PinholeCameraParameters")),
            }
        });
        let cameras: Vec<_> = cameras.collect::<Result<_>>()?;
        let (intrinsics, extrinsics) = cameras.into_iter().flatten().unzip();
        return Ok(Some(Matrices { intrinsics: Some(intrinsics), extrinsics: Some(extrinsics) }));
    }
    let inner = table.get("intrinsic").and_then(Value::as_object);
    let Some(intrinsic) = inner.unwrap_or(table).get("intrinsic_matrix") else { return Ok(None) };
    Ok(Some(Matrices {
        intrinsics: Some(of_key(path, "intrinsic_matrix", intrinsic)?),
        extrinsics: table.get("extrinsic").map(|extrinsic| of_key(path, "extrinsic", extrinsic)).transpose()?,
    }))
}

/// The matrix in a list of numbers, column after column; the matrices in nested lists, row after row.
fn of_key(path: &Path, key: &str, value: &Value) -> Result<Vec<Mat4>> {
    let mut array = array(path, key, value)?;
    let side = match array.shape[..] {
        [9] => 3,
        [16] => 4,
        _ => return matrices_in(path, key, &array),
    };
    array.shape = vec![side, side];
    let transposed = matrices_in(path, key, &array)?;
    Ok(transposed.iter().map(Mat4::transpose).collect())
}
