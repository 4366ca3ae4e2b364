//! Checked access to the arrays of an SMPL-X model file: every shape, index and number is verified before it is used.
//!
//! Errors name the file and the key; a model of another family is recognised by its skeleton and named.

use std::path::Path;

use super::skeleton::{JOINTS, PARENTS};
use xavatar_formats::{Array, ArrayMap};
use xavatar_formats::{Error, Result};

/// How far a convex combination read from a file may sum from 1: f32 rounding over 55 joints, with a margin.
const SUM_TOLERANCE: f64 = 1e-4;

/// The arrays of a model file and where they came from.
pub(super) struct ModelFile<'a> {
    pub(super) path: &'a Path,
    pub(super) arrays: &'a ArrayMap,
}

impl ModelFile<'_> {
    /// Recognises what is not SMPL-X by its number of joints, before anything else fails on it.
    pub(super) fn require_smplx(&self) -> Result<()> {
        let joints = match self.arrays.get("kintree_table").or_else(|| self.arrays.get("weights")) {
            Some(array) => array.shape.get(1).copied().unwrap_or(0),
            None => return Err(self.malformed("kintree_table", "absent", format!("(2, {JOINTS})"))),
        };
        let family = match joints {
            JOINTS => return Ok(()),
            24 => "an SMPL model (24 joints, no hands or face)",
            52 => "an SMPL+H model (52 joints, no face)",
            16 => "a MANO model (16 joints, one hand)",
            5 => "a FLAME model (5 joints, the head)",
            _ => &format!("a model with {joints} joints"),
        };
        Err(self.mismatch(
            family,
            format!("an SMPL-X model ({JOINTS} joints)"),
            "download SMPLX_{GENDER}.npz from https://smpl-x.is.tue.mpg.de",
        ))
    }

    /// The finite numbers of `key`, whose shape has to be `shape` (0 = any extent), and that shape.
    pub(super) fn floats(&self, key: &str, shape: &[usize]) -> Result<(Vec<f64>, &[usize])> {
        let array = self.array(key, shape)?;
        let values = array.to_f64().ok_or_else(|| self.malformed(key, "text", "numbers"))?;
        // f32 is what the values become; a number beyond it would silently turn infinite.
        self.require_sound(key, array, values.iter().map(|value| *value as f32))?;
        Ok((values, &array.shape))
    }

    /// As [`floats`](Self::floats), in half the memory: for the largest array.
    pub(super) fn floats_f32(&self, key: &str, shape: &[usize]) -> Result<Vec<f32>> {
        let array = self.array(key, shape)?;
        let values = array.to_f32().ok_or_else(|| self.malformed(key, "text", "numbers"))?;
        self.require_sound(key, array, values.iter().copied())?;
        Ok(values)
    }

    fn array(&self, key: &str, shape: &[usize]) -> Result<&Array> {
        let array = self.arrays.get(key).ok_or_else(|| self.malformed(key, "absent", shape_text(shape)))?;
        let fits = array.shape.len() == shape.len()
            && array.shape.iter().zip(shape).all(|(found, wanted)| *wanted == 0 || found == wanted);
        if !fits {
            return Err(self.malformed(key, array.description(), shape_text(shape)));
        }
        Ok(array)
    }

    /// As many elements as the shape says, all finite.
    fn require_sound(&self, key: &str, array: &Array, values: impl ExactSizeIterator<Item = f32>) -> Result<()> {
        let elements = array.shape.iter().try_fold(1usize, |product, extent| product.checked_mul(*extent));
        if elements != Some(values.len()) {
            return Err(self.malformed(key, format!("{} elements", values.len()), shape_text(&array.shape)));
        }
        match values.into_iter().position(|value| !value.is_finite()) {
            Some(at) => Err(self.malformed(key, format!("not a finite number at element {at}"), "finite numbers")),
            None => Ok(()),
        }
    }

    /// The faces `f` (F, 3), every index below `vertices`.
    pub(super) fn faces(&self, vertices: usize) -> Result<Vec<[u32; 3]>> {
        let (values, _) = self.floats("f", &[0, 3])?;
        let in_range = |value: f64| value >= 0.0 && value < vertices as f64 && value.fract() == 0.0;
        if let Some(at) = values.iter().position(|value| !in_range(*value)) {
            let expected = format!("vertex indices below {vertices}");
            return Err(self.malformed("f", format!("{} in face {}", values[at], at / 3), expected));
        }
        Ok(values.chunks_exact(3).map(|face| [face[0] as u32, face[1] as u32, face[2] as u32]).collect())
    }

    /// Requires the kinematic tree to be SMPL-X's; the root's parent is any number.
    pub(super) fn require_kinematic_tree(&self) -> Result<()> {
        let (values, _) = self.floats("kintree_table", &[2, JOINTS])?;
        let (parents, ids) = values.split_at(JOINTS);
        for joint in 0..JOINTS {
            if ids[joint] != joint as f64 {
                let place = format!("kintree_table[1][{joint}]");
                return Err(self.malformed(&place, ids[joint].to_string(), joint.to_string()));
            }
            if joint > 0 && parents[joint] != PARENTS[joint] as f64 {
                let place = format!("kintree_table[0][{joint}]");
                let expected = format!("{} (the parent in SMPL-X)", PARENTS[joint]);
                return Err(self.malformed(&place, parents[joint].to_string(), expected));
            }
        }
        Ok(())
    }

    /// Skinning weights (V, J): non-negative, each row summing to 1.
    pub(super) fn skinning_weights(&self, vertices: usize) -> Result<Vec<f32>> {
        let (values, _) = self.floats("weights", &[vertices, JOINTS])?;
        for (vertex, row) in values.chunks_exact(JOINTS).enumerate() {
            let sum: f64 = row.iter().sum();
            if (sum - 1.0).abs() > SUM_TOLERANCE || row.iter().any(|weight| *weight < -SUM_TOLERANCE) {
                let found =
                    format!("a row with sum {sum:.5} and minimum {:.5}", row.iter().copied().fold(f64::MAX, f64::min));
                return Err(self.malformed(&format!("weights[{vertex}]"), found, "non-negative numbers that sum to 1"));
            }
        }
        Ok(values.into_iter().map(|weight| weight as f32).collect())
    }

    /// The regressor of joints from vertices as (vertex, weight) of each joint, each summing to 1.
    pub(super) fn joint_regressor(&self, vertices: usize) -> Result<Vec<Vec<(usize, f64)>>> {
        let (values, _) = self.floats("J_regressor", &[JOINTS, vertices])?;
        let rows: Vec<Vec<(usize, f64)>> = values
            .chunks_exact(vertices)
            .map(|row| row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect())
            .collect();
        for (joint, row) in rows.iter().enumerate() {
            let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
            if (sum - 1.0).abs() > SUM_TOLERANCE {
                return Err(self.malformed(
                    &format!("J_regressor[{joint}]"),
                    format!("a row with sum {sum:.5}"),
                    "a sum of 1",
                ));
            }
        }
        Ok(rows)
    }

    /// That the file breaks the SMPL-X format at `place`.
    pub(super) fn malformed(&self, place: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Malformed {
            path: self.path.to_path_buf(),
            format: "SMPL-X model",
            place: place.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// That the file is valid but something else.
    pub(super) fn mismatch(&self, found: impl Into<String>, expected: impl Into<String>, remedy: &str) -> Error {
        let path = self.path.to_path_buf();
        Error::Mismatch { path, found: found.into(), expected: expected.into(), remedy: remedy.into() }
    }
}

fn shape_text(shape: &[usize]) -> String {
    let extents: Vec<String> =
        shape.iter().map(|extent| if *extent == 0 { "*".into() } else { extent.to_string() }).collect();
    format!("({})", extents.join(", "))
}
