//! Calibrations: the intrinsics and the pose of the camera in each frame of a sequence.
//!
//! A file of arrays, in npz, JSON or TOML, by the same names as X-Humans' `cameras.npz`:
//! `intrinsic` (3, 3) or (n, 3, 3), K = [fx 0 cx; 0 fy cy; 0 0 1] in pixels, and `extrinsic` (4, 4), (3, 4), (n, 4, 4) or
//! (n, 3, 4), [R t] world to camera in OpenCV's axes, metres. One matrix stands for all frames, n for one a frame.

use std::path::{Path, PathBuf};

use glam::{Mat3, Mat4, Vec3, Vec4};
use serde::{Deserialize, Serialize};

use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result, read_npz, read_text};
use xavatar_mesh::camera::PinholeCamera;

const FORMAT: &str = "camera file";

/// Where a calibration's picture coordinates have their origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PixelOrigin {
    /// The centre of the upper left pixel, as in OpenCV and the calibrations that sensors report.
    #[default]
    Centre,
    /// The upper left corner of the picture, as in OpenGL, renderers and X-Humans.
    Corner,
}

/// K, with the principal point as in [`PinholeCamera`]: from the picture's corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Intrinsics {
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
}

impl Intrinsics {
    /// Focal lengths and principal point of a calibration, pixels.
    pub fn new([fx, fy, cx, cy]: [f32; 4], origin: PixelOrigin) -> Self {
        let shift = match origin {
            PixelOrigin::Centre => 0.5,
            PixelOrigin::Corner => 0.0,
        };
        Self { fx, fy, cx: cx + shift, cy: cy + shift }
    }
}

/// The calibration of a sequence.
#[derive(Clone, Debug)]
pub(super) struct CameraTable {
    path: PathBuf,
    intrinsics: Vec<Intrinsics>,
    extrinsics: Vec<Mat4>,
}

impl CameraTable {
    /// Reads a camera file. `intrinsics` is used where the file has none.
    ///
    /// # Errors
    /// [`Error::Missing`], [`Error::Malformed`] or [`Error::Refused`], naming the file and the array.
    pub fn read(path: &Path, origin: PixelOrigin, intrinsics: Option<Intrinsics>) -> Result<Self> {
        if !path.exists() {
            return Err(Error::Missing {
                path: path.into(),
                what: "the cameras of the sequence".into(),
                remedy: "give `extrinsic` (world to camera) of each frame in an npz, JSON or TOML file".into(),
            });
        }
        let arrays = read_arrays(path)?;
        let file = |key: &str| matrices(path, key, &arrays);
        let intrinsics = match (file("intrinsic")?, intrinsics) {
            (Some(matrices), _) => {
                matrices.iter().map(|matrix| pinhole(path, matrix, origin)).collect::<Result<_>>()?
            }
            (None, Some(known)) => vec![known],
            (None, None) => return Err(malformed(path, "intrinsic", "missing", "a 3 x 3 matrix in pixels")),
        };
        let Some(extrinsics) = file("extrinsic")? else {
            return Err(malformed(path, "extrinsic", "missing", "a 4 x 4 matrix a frame, world to camera"));
        };
        Ok(Self { path: path.into(), intrinsics, extrinsics })
    }

    /// How many poses the file has.
    pub fn poses(&self) -> usize {
        self.extrinsics.len()
    }

    /// The camera of the frame at `row`, with a picture of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`Error::Malformed`] if there is no such row, or if it is no camera.
    pub fn camera(&self, row: usize, [width, height]: [u32; 2]) -> Result<PinholeCamera> {
        let Intrinsics { fx, fy, cx, cy } = *self.row("intrinsic", &self.intrinsics, row)?;
        let extrinsic = *self.row("extrinsic", &self.extrinsics, row)?;
        let camera = PinholeCamera { width, height, fx, fy, cx, cy, rotation: Mat3::IDENTITY, translation: Vec3::ZERO };
        camera.posed(extrinsic).map_err(|error| match error {
            Error::Value { name, found, expected } => malformed(&self.path, format!("{name} {row}"), found, expected),
            other => other,
        })
    }

    fn row<'a, T>(&self, key: &str, rows: &'a [T], row: usize) -> Result<&'a T> {
        let found = if rows.len() == 1 { rows.first() } else { rows.get(row) };
        found.ok_or_else(|| {
            let expected = format!("one matrix for all frames, or one a frame (this one is number {row} from 0)");
            malformed(&self.path, key, format!("{} matrices", rows.len()), expected)
        })
    }
}

/// The arrays of an npz, or of the nested lists of numbers in a JSON or TOML table.
fn read_arrays(path: &Path) -> Result<ArrayMap> {
    let wrong = |error: &dyn std::fmt::Display| malformed(path, "the text", error, "a table of matrices");
    let table: serde_json::Map<String, serde_json::Value> =
        match path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("json") => serde_json::from_str(&read_text(path)?).map_err(|error| wrong(&error))?,
            Some("toml") => toml::from_str(&read_text(path)?).map_err(|error| wrong(&error.message()))?,
            _ => return read_npz(path),
        };
    let numbers = |(key, value): (String, serde_json::Value)| {
        let mut array = Vec::new();
        let shape = flatten(&value, &mut array)
            .ok_or_else(|| malformed(path, &key, "ragged or not of numbers", "rows of equally many numbers"))?;
        Ok((key, Array { shape, data: ArrayData::F64(array) }))
    };
    table.into_iter().map(numbers).collect()
}

/// Appends the numbers of nested lists and returns their extents; `None` if lists differ in length or hold something else.
fn flatten(value: &serde_json::Value, numbers: &mut Vec<f64>) -> Option<Vec<usize>> {
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

/// The matrices under a key, each filled up to 4 x 4 with the identity; `None` if there is no such key.
fn matrices(path: &Path, key: &str, arrays: &ArrayMap) -> Result<Option<Vec<Mat4>>> {
    let Some(array) = arrays.get(key) else { return Ok(None) };
    let (rows, columns) = match array.shape[..] {
        [rows @ (3 | 4), columns @ (3 | 4)] | [_, rows @ (3 | 4), columns @ (3 | 4)] => (rows, columns),
        _ => return Err(malformed(path, key, array.description(), "one matrix, or one a frame")),
    };
    let values = array.to_f32().filter(|values| values.iter().all(|value| value.is_finite()));
    let values = values.ok_or_else(|| malformed(path, key, "not all finite", "finite numbers"))?;
    let matrix = |entries: &[f32]| {
        let row = |row: usize| {
            let entry = |column: usize| {
                let identity = f32::from(u8::from(row == column));
                if row < rows && column < columns { entries[row * columns + column] } else { identity }
            };
            Vec4::from_array(std::array::from_fn(entry))
        };
        Mat4::from_cols(row(0), row(1), row(2), row(3)).transpose()
    };
    let matrices: Vec<Mat4> = values.chunks_exact(rows * columns).map(matrix).collect();
    if matrices.is_empty() {
        return Err(malformed(path, key, array.description(), "at least one matrix"));
    }
    Ok(Some(matrices))
}

/// The intrinsics in K, which may neither be skewed nor scaled.
fn pinhole(path: &Path, matrix: &Mat4, origin: PixelOrigin) -> Result<Intrinsics> {
    let [first, second, third] = [0, 1, 2].map(|row| matrix.row(row).truncate());
    if first.y != 0.0 || second.x != 0.0 || third != Vec3::Z {
        return Err(malformed(path, "intrinsic", matrix, "[fx 0 cx; 0 fy cy; 0 0 1]: no skew, undistorted pictures"));
    }
    Ok(Intrinsics::new([first.x, second.y, first.z, second.z], origin))
}

fn malformed(path: &Path, place: impl Into<String>, found: impl ToString, expected: impl Into<String>) -> Error {
    Error::Malformed {
        path: path.into(),
        format: FORMAT,
        place: format!("`{}`", place.into()),
        found: found.to_string(),
        expected: expected.into(),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use xavatar_formats::write_npz;

    const K: [f64; 9] = [600.0, 0.0, 320.0, 0.0, 610.0, 240.0, 0.0, 0.0, 1.0];
    /// A camera 3 m before the origin that looks along -Z, in a world with Y up.
    const POSE: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, -1.0, 3.0, 0.0, 0.0, 0.0, 1.0];

    fn array(shape: &[usize], values: &[f64]) -> Array {
        Array { shape: shape.to_vec(), data: ArrayData::F64(values.to_vec()) }
    }

    fn read(name: &str, text: &str) -> Result<CameraTable> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        CameraTable::read(&path, PixelOrigin::Corner, None)
    }

    #[test]
    fn npz_json_and_toml_say_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cameras.npz");
        let arrays = [("intrinsic", array(&[3, 3], &K)), ("extrinsic", array(&[1, 4, 4], &POSE))];
        write_npz(&path, &arrays.map(|(key, array)| (key.to_owned(), array)).into()).unwrap();
        let npz = CameraTable::read(&path, PixelOrigin::Corner, None).unwrap();
        let rows = "[[[1, 0, 0, 0.0], [0, -1.0, 0, 1], [0, 0, -1, 3]]]";
        let json = format!(r#"{{"intrinsic": [[600, 0, 320], [0, 610, 240], [0, 0, 1]], "extrinsic": {rows}}}"#);
        let toml = format!("intrinsic = [[600, 0, 320], [0, 610, 240], [0, 0, 1]]\nextrinsic = {rows}");
        let camera = npz.camera(0, [640, 480]).unwrap();
        assert_eq!(read("c.json", &json).unwrap().camera(7, [640, 480]).unwrap(), camera, "one matrix for all frames");
        assert_eq!(read("c.toml", &toml).unwrap().camera(0, [640, 480]).unwrap(), camera);
        assert_eq!(camera.position(), Vec3::new(0.0, 1.0, 3.0));
        assert_eq!(camera.project(Vec3::Y), (Vec2::new(320.0, 240.0), 3.0));
    }

    #[test]
    fn opencv_counts_from_the_centre_of_the_first_pixel() {
        let values = [600.0, 610.0, 319.5, 239.5];
        assert_eq!(
            Intrinsics::new(values, PixelOrigin::Centre),
            Intrinsics { cx: 320.0, cy: 240.0, ..Intrinsics::new(values, PixelOrigin::Corner) }
        );
    }

    #[test]
    fn what_is_no_calibration_is_named() {
        let pose = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]";
        for (text, words) in [
            (r#"{"extrinsic": POSE}"#, ["`intrinsic`", "missing"]),
            (r#"{"intrinsic": [[1, 0, 2], [0, 1, 2], [0, 0, 1]]}"#, ["`extrinsic`", "world to camera"]),
            (r#"{"intrinsic": [[1, 0, 2], [0, 1], [0, 0, 1]], "extrinsic": POSE}"#, ["`intrinsic`", "ragged"]),
            (r#"{"intrinsic": [[1, 4, 2], [0, 1, 2], [0, 0, 1]], "extrinsic": POSE}"#, ["`intrinsic`", "skew"]),
            (r#"{"intrinsic": [1, 2, 3], "extrinsic": POSE}"#, ["`intrinsic`", "(3)"]),
            (r#"{"intrinsic": [[1, 0, 2], [0, 1, 2], [0, 0, 1]], "extrinsic": []}"#, ["`extrinsic`", "(0)"]),
            ("{", ["the text", "EOF"]),
        ] {
            let error = read("cameras.json", &text.replace("POSE", pose)).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)) && error.contains("cameras.json"), "{error}");
        }
        let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(read("c.json", &format!(r#"{{"extrinsic": {deep}}}"#)).is_err());
        assert!(read("c.toml", &format!("extrinsic = {deep}")).is_err());
        assert!(read("c.npz", "").is_err());
    }

    #[test]
    fn frames_beyond_the_table_have_no_camera() {
        let pose = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]";
        let text = format!("intrinsic = [[1, 0, 2], [0, 1, 2], [0, 0, 1]]\nextrinsic = [{pose}, {pose}]");
        let table = read("c.toml", &text).unwrap();
        assert!(table.camera(1, [8, 8]).is_ok());
        assert!(table.camera(2, [8, 8]).unwrap_err().to_string().contains("2 matrices"));
    }
}
