//! How a scan's coordinates become those of its registered body: x_body = s R x_scan + t + o.
//!
//! s is the scan's unit in metres, R a turn (a mirror image too where det R < 0), t a shift in metres, o the point that the
//! scan's coordinates count from. A folder may hold one, in [`ScanPlacement::FILE`], which reading applies to every scan; the
//! scans' own files stay as they are.

use std::io::Write;
use std::path::{Path, PathBuf};

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use xavatar_formats::write_atomically;
use xavatar_formats::{Error, Result, read_text};
use xavatar_mesh::{TriangleMesh, without_surroundings};

const FORMAT: &str = "placement of scans";
/// Rows of a turn times its transpose differ from the identity by less.
const ORTHONORMAL: f32 = 1e-3;

/// The point that a scan's coordinates count from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The world's, as the body's coordinates do.
    #[default]
    World,
    /// The frame's `transl`, which somebody subtracted.
    Translation,
    /// The pelvis of the frame's body.
    Pelvis,
}

/// How scans are brought onto their bodies. `Default` leaves them where they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScanPlacement {
    /// Metres in one unit of the scan.
    pub scale: f32,
    /// The rows of R.
    pub turn: [[f32; 3]; 3],
    /// t, metres.
    pub shift: [f32; 3],
    /// Where o is.
    pub origin: Origin,
    /// Whether faces are seen from inside and are to be turned over.
    pub reverse_faces: bool,
    /// Whether what scans show besides the person, ground and what floats, is left out.
    pub person_alone: bool,
}

impl Default for ScanPlacement {
    fn default() -> Self {
        let turn = Mat3::IDENTITY.to_cols_array_2d();
        Self { scale: 1.0, turn, shift: [0.0; 3], origin: Origin::World, reverse_faces: false, person_alone: false }
    }
}

impl ScanPlacement {
    /// The file of a subject's folder that holds its placement.
    pub const FILE: &str = "mended.toml";

    /// R.
    #[must_use]
    pub fn rotation(&self) -> Mat3 {
        Mat3::from_cols_array_2d(&self.turn).transpose()
    }

    /// The placement in a subject's folder, if there is one.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the line or the value that makes no placement; [`Error::Io`].
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(Self::FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = read_text(&path)?;
        let placement: Self = toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            malformed(&path, format!("line {line}"), error.message(), "a placement as a check records it")
        })?;
        placement.checked(&path)?;
        Ok(Some(placement))
    }

    /// That the numbers are a placement; `path` is the file they are from.
    pub(super) fn checked(&self, path: &Path) -> Result<()> {
        if !(self.scale.is_finite() && self.scale > 0.0) {
            return Err(malformed(path, "`scale`".into(), &self.scale.to_string(), "a positive number of metres"));
        }
        let turn = self.rotation();
        if !(turn * turn.transpose()).abs_diff_eq(Mat3::IDENTITY, ORTHONORMAL) {
            return Err(malformed(path, "`turn`".into(), &format!("{:?}", self.turn), "the rows of a rotation"));
        }
        if !Vec3::from(self.shift).is_finite() {
            return Err(malformed(path, "`shift`".into(), &format!("{:?}", self.shift), "finite metres"));
        }
        Ok(())
    }

    /// Writes the placement into a subject's folder that has none yet; returns the file.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if there is one; [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(Self::FILE);
        if path.exists() {
            return Err(Error::Mismatch {
                path,
                found: "a placement that was recorded before".into(),
                expected: "none yet".into(),
                remedy: "remove the file to have the scans measured as they are".into(),
            });
        }
        let head = "# Recorded by a check: x_body = scale * turn * x_scan + shift, applied to every scan when it is read.\n\
                    # The scans' files are unchanged. Remove this file to undo it.\n";
        let text = toml::to_string(self).map_err(|error| Error::Value {
            name: Self::FILE.into(),
            found: error.to_string(),
            expected: "numbers that TOML can hold".into(),
        })?;
        write_atomically(&path, |writer| write!(writer, "{head}{text}"))?;
        Ok(path)
    }

    /// Moves a scan; `origin` is o, in the body's coordinates.
    pub(super) fn apply(&self, scan: &mut TriangleMesh, origin: Vec3) {
        if *self == Self::default() {
            return;
        }
        if self.person_alone
            && let Some((person, _)) = without_surroundings(scan)
        {
            *scan = person;
        }
        let turn = self.rotation();
        let shift = Vec3::from(self.shift) + origin;
        scan.vertices.iter_mut().for_each(|vertex| *vertex = turn * *vertex * self.scale + shift);
        if let Some(normals) = &mut scan.normals {
            normals.iter_mut().for_each(|normal| *normal = turn * *normal);
        }
        if self.reverse_faces {
            scan.faces.iter_mut().for_each(|face| face.swap(1, 2));
            // Those of a scan that is inside out may point either way.
            scan.normals = None;
        }
    }
}

fn malformed(path: &Path, place: String, found: &str, expected: &str) -> Error {
    Error::Malformed { path: path.into(), format: FORMAT, place, found: found.into(), expected: expected.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upright() -> ScanPlacement {
        ScanPlacement {
            scale: 0.001,
            turn: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
            shift: [0.5, 0.0, -0.25],
            ..ScanPlacement::default()
        }
    }

    #[test]
    fn a_placement_is_read_as_it_was_written_and_never_written_over() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(ScanPlacement::read(folder.path()).unwrap(), None);
        upright().write(folder.path()).unwrap();
        assert_eq!(ScanPlacement::read(folder.path()).unwrap(), Some(upright()));
        let error = ScanPlacement::default().write(folder.path()).unwrap_err().to_string();
        assert!(error.contains("mended.toml") && error.contains("remove the file"), "{error}");
    }

    #[test]
    fn scans_are_scaled_turned_and_shifted_with_their_normals() {
        let mut scan = TriangleMesh {
            vertices: vec![Vec3::new(100.0, 200.0, 300.0)],
            normals: Some(vec![Vec3::Z]),
            ..TriangleMesh::default()
        };
        upright().apply(&mut scan, Vec3::X);
        assert!(scan.vertices[0].abs_diff_eq(Vec3::new(1.6, 0.3, -0.45), 1e-6), "{:?}", scan.vertices);
        assert_eq!(scan.normals.unwrap(), [Vec3::Y]);
    }

    #[test]
    fn numbers_that_are_no_placement_are_named() {
        let folder = tempfile::tempdir().unwrap();
        for (text, word) in [
            ("scale = 0", "`scale`"),
            ("turn = [[1, 0, 0], [1, 0, 0], [0, 0, 1]]", "`turn`"),
            ("shift = [nan, 0, 0]", "`shift`"),
            ("scale = 1\nsize = 2", "line 2"),
        ] {
            std::fs::write(folder.path().join(ScanPlacement::FILE), text).unwrap();
            let error = ScanPlacement::read(folder.path()).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("mended.toml"), "{error}");
        }
    }
}
