//! From the coordinates of scans' files to metres with Y up: x = s R x_file. Landmarks are in the files' coordinates, too.

use glam::{DMat3, DVec3, Vec3};
use serde::{Deserialize, Serialize};
use xavatar_data::FrameFiles;
use xavatar_formats::{Error, Result};
use xavatar_mesh::TriangleMesh;

/// The largest side of a person, metres.
pub(super) const SIZES: std::ops::RangeInclusive<f64> = 0.4..=2.6;

/// Frames that are looked at for the unit.
pub(super) const MEASURED: usize = 5;

/// The axis of the files that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// Y, as in X-Humans.
    #[default]
    Y,
    /// -Y, as in cameras' coordinates.
    #[serde(rename = "-y")]
    MinusY,
    /// Z, as in Blender.
    Z,
}

/// What the numbers in scans' files mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileCoordinates {
    /// Metres in one unit.
    pub scale: f64,
    /// The axis that points up.
    pub up: Up,
}

impl FileCoordinates {
    /// With the unit that makes a person of scans with these extents (x, y, z in the files' units): metres, centimetres or millimetres.
    ///
    /// # Errors
    /// [`Error::Unfit`] naming the size if no unit does.
    pub fn of_extents(extents: &[DVec3], up: Up) -> Result<Self> {
        let mut sizes: Vec<f64> = extents.iter().map(|extent| extent.max_element()).collect();
        sizes.sort_by(f64::total_cmp);
        let size = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        let scale = [1.0, 0.01, 0.001].into_iter().find(|scale| SIZES.contains(&(size * scale)));
        let scale = scale.ok_or_else(|| Error::Unfit {
            message: format!("the scans are {size:.3} units tall: no person in metres, centimetres or millimetres"),
            remedy: "scale the scans to metres".into(),
        })?;
        Ok(Self { scale, up })
    }

    /// As [`of_extents`](Self::of_extents), of some of a subject's scans, evenly spread.
    ///
    /// # Errors
    /// [`Error::Unfit`] likewise; those of reading a scan.
    pub fn of_scans(files: &[&FrameFiles], up: Up) -> Result<Self> {
        let stride = files.len().div_ceil(MEASURED).max(1);
        let extent = |files: &&FrameFiles| {
            let vertices = files.read_scan()?.mesh.vertices;
            let fold = |of: fn(Vec3, Vec3) -> Vec3| vertices.iter().copied().reduce(of).unwrap_or_default();
            Ok((fold(Vec3::max) - fold(Vec3::min)).as_dvec3())
        };
        Self::of_extents(&files.iter().step_by(stride).map(extent).collect::<Result<Vec<_>>>()?, up)
    }

    /// A place in metres, Y up, as the files have it.
    pub fn place_in_file(self, place: DVec3) -> DVec3 {
        self.turn().transpose() * place / self.scale
    }

    /// A place of the files in metres, Y up.
    pub fn place(self, place: DVec3) -> DVec3 {
        self.turn() * place * self.scale
    }

    /// Whether files need no change.
    pub fn is_plain(self) -> bool {
        self.scale == 1.0 && self.up == Up::Y
    }

    /// Moves a scan.
    pub fn apply(self, scan: &mut TriangleMesh) {
        if self.is_plain() {
            return;
        }
        scan.vertices.iter_mut().for_each(|vertex| *vertex = self.place(vertex.as_dvec3()).as_vec3());
        let turn = self.turn();
        if let Some(normals) = &mut scan.normals {
            normals.iter_mut().for_each(|normal| *normal = (turn * normal.as_dvec3()).as_vec3());
        }
    }

    /// From the axes of the files to those with Y up.
    pub(super) fn turn(self) -> DMat3 {
        match self.up {
            Up::Y => DMat3::IDENTITY,
            Up::MinusY => DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
            Up::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_told_by_the_size_of_a_person() {
        let scale =
            |height: f64| FileCoordinates::of_extents(&[DVec3::new(0.1, height, 0.2)], Up::Y).map(|found| found.scale);
        assert_eq!((scale(1.7).unwrap(), scale(168.0).unwrap(), scale(1850.0).unwrap()), (1.0, 0.01, 0.001));
        assert!(scale(17.0).unwrap_err().to_string().contains("17.000 units tall"));
    }

    #[test]
    fn every_turn_is_a_rotation_that_puts_up_upwards() {
        for (up, axis) in [(Up::Y, DVec3::Y), (Up::MinusY, DVec3::NEG_Y), (Up::Z, DVec3::Z)] {
            let coordinates = FileCoordinates { scale: 0.001, up };
            assert!(coordinates.place(axis * 1000.0).abs_diff_eq(DVec3::Y, 1e-12));
            assert!(coordinates.place_in_file(DVec3::Y).abs_diff_eq(axis * 1000.0, 1e-9));
            assert!((coordinates.turn().determinant() - 1.0).abs() < 1e-12);
        }
    }
}
