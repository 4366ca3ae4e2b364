//! Calibrations: the intrinsics and the pose of the camera in each frame of a sequence.
//!
//! A file of arrays, in npz, JSON or TOML, by the same names as X-Humans' `cameras.npz`:
//! `intrinsic` (3, 3) or (n, 3, 3), K = [fx 0 cx; 0 fy cy; 0 0 1] in pixels, and `extrinsic` (4, 4), (3, 4), (n, 4, 4) or
//! (n, 3, 4), [R t] world to camera in OpenCV's axes, metres. One matrix stands for all frames, n for one a frame. Or JSON of
//! Open3D, or poses as text, which are camera to world.

mod arrays;
mod open3d;
mod trajectory;

use std::path::{Path, PathBuf};

use glam::{Mat3, Mat4, Vec3};
use serde::{Deserialize, Serialize};

use xavatar_formats::{Error, Result, read_bytes};
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
    /// Reads a file with one camera's calibration: rows of K as text, or a camera file.
    ///
    /// # Errors
    /// [`Error::Missing`], [`Error::Malformed`] or [`Error::Refused`], naming the file.
    pub fn read(path: &Path, origin: PixelOrigin) -> Result<Self> {
        if !path.exists() {
            return Err(Error::Missing {
                path: path.into(),
                what: "the calibration".into(),
                remedy: "correct `intrinsics`, which names it".into(),
            });
        }
        let matrix = match is_text(path) {
            true => text_matrix(path)?,
            false => *Matrices::read(path)?
                .intrinsics
                .and_then(|matrices| matrices.first().copied())
                .as_ref()
                .ok_or_else(|| malformed(path, "intrinsic", "missing", "a 3 x 3 matrix in pixels"))?,
        };
        pinhole(path, &matrix, origin)
    }

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
                remedy:
                    "give `extrinsic` (world to camera) of each frame in an npz, JSON or TOML file, or poses as text"
                        .into(),
            });
        }
        let found = Matrices::read(path)?;
        let intrinsics = match (found.intrinsics, intrinsics) {
            (Some(matrices), _) => {
                matrices.iter().map(|matrix| pinhole(path, matrix, origin)).collect::<Result<_>>()?
            }
            (None, Some(known)) => vec![known],
            (None, None) => return Err(malformed(path, "intrinsic", "missing", "a 3 x 3 matrix in pixels")),
        };
        let Some(extrinsics) = found.extrinsics else {
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
        if !extrinsic.is_finite() {
            let expected = "finite numbers: where its pose was lost, leave the frame out";
            return Err(malformed(&self.path, format!("pose {row}"), "not finite", expected));
        }
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

/// The matrices in a file, as 4 x 4.
struct Matrices {
    /// K, in the upper left.
    intrinsics: Option<Vec<Mat4>>,
    /// World to camera; not finite where the camera's pose was lost.
    extrinsics: Option<Vec<Mat4>>,
}

impl Matrices {
    fn read(path: &Path) -> Result<Self> {
        if !is_text(path) {
            return arrays::read(path);
        }
        let poses = trajectory::read(path)?;
        let extrinsics = poses.iter().map(|pose| pose.camera_to_world.inverse().as_mat4()).collect();
        Ok(Self { intrinsics: None, extrinsics: Some(extrinsics) })
    }
}

/// Whether a file holds poses as text, by its extension.
fn is_text(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    extension.is_some_and(|extension| POSE_EXTENSIONS.contains(&extension.as_str()))
}

/// Extensions of files of poses as text, in lower case.
pub(super) const POSE_EXTENSIONS: [&str; 2] = ["txt", "log"];

/// The row of a file of poses that is nearest to each of these times, seconds, and no farther than `tolerance`; `None` if its poses
/// have no times.
///
/// # Errors
/// Those of reading a file of poses.
pub(super) fn rows_at(path: &Path, times: &[f64], tolerance: f64) -> Result<Option<Vec<Option<usize>>>> {
    if !is_text(path) || !path.is_file() {
        return Ok(None);
    }
    let poses = trajectory::read(path)?;
    let Some(mut known) = poses.iter().map(|pose| pose.time).collect::<Option<Vec<f64>>>() else { return Ok(None) };
    let mut rows: Vec<usize> = (0..known.len()).collect();
    rows.sort_by(|one, other| known[*one].total_cmp(&known[*other]));
    known.sort_by(f64::total_cmp);
    let nearest = |time: &f64| {
        let after = known.partition_point(|other| other < time);
        let around = after.saturating_sub(1)..(after + 1).min(known.len());
        let place = around.min_by(|one, other| (known[*one] - time).abs().total_cmp(&(known[*other] - time).abs()))?;
        ((known[place] - time).abs() <= tolerance).then_some(rows[place])
    };
    Ok(Some(times.iter().map(nearest).collect()))
}

/// The intrinsics in K, which may neither be skewed nor scaled.
fn pinhole(path: &Path, matrix: &Mat4, origin: PixelOrigin) -> Result<Intrinsics> {
    let [first, second, third] = [0, 1, 2].map(|row| matrix.row(row).truncate());
    if first.y != 0.0 || second.x != 0.0 || third != Vec3::Z {
        return Err(malformed(path, "intrinsic", matrix, "[fx 0 cx; 0 fy cy; 0 0 1]: no skew, undistorted pictures"));
    }
    Ok(Intrinsics::new([first.x, second.y, first.z, second.z], origin))
}

/// The matrix of a text file of 9, 12 or 16 numbers, row by row.
fn text_matrix(path: &Path) -> Result<Mat4> {
    let bytes = read_bytes(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let words = text.split(|c: char| c.is_ascii_whitespace() || c == ',').filter(|word| !word.is_empty());
    let numbers: Option<Vec<f32>> =
        words.map(|word| word.parse().ok().filter(|value: &f32| value.is_finite())).collect();
    match numbers {
        Some(numbers) if numbers.len() == 9 => Ok(arrays::filled(&numbers, 3)),
        Some(numbers) if matches!(numbers.len(), 12 | 16) => Ok(arrays::filled(&numbers, 4)),
        _ => Err(malformed(path, "the text", "no matrix of finite numbers", "3 x 3, 3 x 4 or 4 x 4")),
    }
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
    use xavatar_formats::{Array, ArrayData, write_npz};

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
        // Open3D: column after column; by the same names but in rows, as they look.
        let columns = "[600, 0, 0, 0, 610, 0, 320, 240, 1]";
        for (matrix, extrinsic) in [
            (columns, "[1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 1, 3, 1]"),
            ("[[600, 0, 320], [0, 610, 240], [0, 0, 1]]", rows),
        ] {
            let both = format!(r#"{{"width": 640, "intrinsic_matrix": {matrix}, "extrinsic": {extrinsic}}}"#);
            let nested = format!(
                r#"{{"class_name": "x", "intrinsic": {{"intrinsic_matrix": {matrix}}}, "extrinsic": {extrinsic}}}"#
            );
            let list = format!(r#"{{"parameters": [{nested}, {nested}]}}"#);
            for text in [both, nested, list] {
                assert_eq!(read("c.json", &text).unwrap().camera(0, [640, 480]).unwrap(), camera, "{text}");
            }
        }
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
