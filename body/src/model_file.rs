//! Checked access to the arrays of a body model's file: every shape, index and number is verified before it is used.
//!
//! Errors name the file and the key. V vertices, J joints.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::hands::HAND_COMPONENTS;
use super::{BlendShapes, Coefficients, HandSpace, JointBasis};
use xavatar_formats::{Array, ArrayMap};
use xavatar_formats::{Error, Result};

/// How far a convex combination read from a file may sum from 1: f32 rounding over the joints, with a margin.
const SUM_TOLERANCE: f64 = 1e-4;

/// The arrays of a model file and where they came from.
pub(super) struct ModelFile<'a> {
    pub(super) path: &'a Path,
    pub(super) arrays: &'a ArrayMap,
    /// What the file is called in messages: `SMPL-X model`.
    pub(super) format: &'static str,
}

impl ModelFile<'_> {
    /// J, by which families are told apart; none if no array says it.
    pub(super) fn joints(&self) -> Option<usize> {
        let tree = self.arrays.get("kintree_table").or_else(|| self.arrays.get("weights"))?;
        Some(tree.shape.get(1).copied().unwrap_or(0))
    }

    /// V; none if there is no template.
    pub(super) fn vertices(&self) -> Option<usize> {
        self.shape("v_template")?.first().copied()
    }

    /// The extents of an array; none if it is absent.
    pub(super) fn shape(&self, key: &str) -> Option<&[usize]> {
        self.arrays.get(key).map(|array| array.shape.as_slice())
    }

    /// The last extent of an array.
    pub(super) fn columns(&self, key: &str) -> Option<usize> {
        self.shape(key)?.last().copied()
    }

    /// How many columns of `shapedirs` are used: `usual`, or all that there are.
    pub(super) fn used_columns(&self, usual: usize, coefficients: Coefficients) -> Result<usize> {
        let found = self.columns("shapedirs").ok_or_else(|| self.malformed("shapedirs", "absent", "(V, 3, shapes)"))?;
        match coefficients {
            Coefficients::All => Ok(found),
            Coefficients::Usual if found >= usual => Ok(usual),
            Coefficients::Usual => {
                Err(self.malformed("shapedirs", format!("{found} columns"), format!("at least {usual}")))
            }
        }
    }

    /// The parent of each joint (J), from a tree whose joints come after their parents.
    pub(super) fn kinematic_tree(&self) -> Result<Vec<Option<usize>>> {
        let (values, shape) = self.floats("kintree_table", &[2, 0])?;
        let joints = shape[1];
        let parent = |joint: usize| {
            let value = values[joint];
            if value >= 0.0 && value < joint as f64 && value.fract() == 0.0 {
                return Ok(Some(value as usize));
            }
            let place = format!("kintree_table[0][{joint}]");
            Err(self.malformed(&place, value.to_string(), format!("a joint below {joint}")))
        };
        std::iter::once(Ok(None)).chain((1..joints).map(parent)).collect()
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

    /// The extents of an array, which have to be `shape` (0 = any).
    pub(super) fn extents(&self, key: &str, shape: &[usize]) -> Result<&[usize]> {
        Ok(&self.array(key, shape)?.shape)
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

    /// Requires the kinematic tree of `family` with these parents (J); the root's parent is any number.
    pub(super) fn require_kinematic_tree(&self, expected: &[Option<usize>], family: &str) -> Result<()> {
        let joints = expected.len();
        let (values, _) = self.floats("kintree_table", &[2, joints])?;
        let (parents, ids) = values.split_at(joints);
        for joint in 0..joints {
            if ids[joint] != joint as f64 {
                let place = format!("kintree_table[1][{joint}]");
                return Err(self.malformed(&place, ids[joint].to_string(), joint.to_string()));
            }
            if let Some(parent) = expected[joint].filter(|parent| parents[joint] != *parent as f64) {
                let place = format!("kintree_table[0][{joint}]");
                let expected = format!("{parent} (the parent in {family})");
                return Err(self.malformed(&place, parents[joint].to_string(), expected));
            }
        }
        Ok(())
    }

    /// Skinning weights (V, J): non-negative, each row summing to 1.
    pub(super) fn skinning_weights(&self, vertices: usize, joints: usize) -> Result<Vec<f32>> {
        let (values, _) = self.floats("weights", &[vertices, joints])?;
        for (vertex, row) in values.chunks_exact(joints).enumerate() {
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
    pub(super) fn joint_regressor(&self, vertices: usize, joints: usize) -> Result<JointRegressor> {
        let (values, _) = self.floats("J_regressor", &[joints, vertices])?;
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
        Ok(JointRegressor { rows })
    }

    /// The template `v_template` (V, 3), at least one vertex.
    pub(super) fn template(&self) -> Result<Vec<f64>> {
        let (template, shape) = self.floats("v_template", &[0, 3])?;
        match shape[0] {
            0 => Err(self.malformed("v_template", "empty", "at least one vertex")),
            _ => Ok(template),
        }
    }

    /// The pose correctives `posedirs` (V, 3, F) or (3 V, F).
    pub(super) fn correctives(&self, vertices: usize, features: usize) -> Result<BlendShapes> {
        let is_flat = self.shape("posedirs").is_some_and(|shape| shape.len() == 2);
        let shape: &[usize] = if is_flat { &[3 * vertices, features] } else { &[vertices, 3, features] };
        Ok(BlendShapes::from_columns(&self.floats_f32("posedirs", shape)?, features, 0..features))
    }

    /// The pose space of one hand.
    pub(super) fn hand_space(&self, mean: &str, components: &str) -> Result<HandSpace> {
        let row = |values: &[f64]| std::array::from_fn(|component| values[component] as f32);
        let (mean, _) = self.floats(mean, &[HAND_COMPONENTS])?;
        let (components, _) = self.floats(components, &[0, HAND_COMPONENTS])?;
        Ok(HandSpace { mean: row(&mean), components: components.chunks_exact(HAND_COMPONENTS).map(row).collect() })
    }

    /// That the file breaks its format at `place`.
    pub(super) fn malformed(&self, place: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Malformed {
            path: self.path.to_path_buf(),
            format: self.format,
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

/// Joints as weighted means of vertices: (vertex, weight) of each joint (J).
pub(super) struct JointRegressor {
    rows: Vec<Vec<(usize, f64)>>,
}

impl JointRegressor {
    /// The joints of the `template` (V, 3) and of `columns` of the shape `directions` (V, 3, `stride`).
    pub(super) fn basis(
        &self,
        template: &[f64],
        directions: &[f64],
        stride: usize,
        columns: impl Iterator<Item = usize>,
    ) -> JointBasis {
        let column = |column: usize| self.regress(|vertex, axis| directions[(vertex * 3 + axis) * stride + column]);
        JointBasis {
            template: self.regress(|vertex, axis| template[vertex * 3 + axis]),
            directions: columns.map(column).collect(),
        }
    }

    /// The joints (J) of a field over vertices, in f64 as in the reference.
    fn regress(&self, value: impl Fn(usize, usize) -> f64) -> Vec<DVec3> {
        let joint = |row: &Vec<(usize, f64)>| {
            let axis = |axis| row.iter().map(|(vertex, weight)| weight * value(*vertex, axis)).sum::<f64>();
            DVec3::new(axis(0), axis(1), axis(2))
        };
        self.rows.iter().map(joint).collect()
    }
}

/// Points of f64 rows as vectors.
pub(super) fn points(rows: &[f64]) -> Vec<Vec3> {
    rows.chunks_exact(3).map(|point| Vec3::new(point[0] as f32, point[1] as f32, point[2] as f32)).collect()
}

fn shape_text(shape: &[usize]) -> String {
    let extents: Vec<String> =
        shape.iter().map(|extent| if *extent == 0 { "*".into() } else { extent.to_string() }).collect();
    format!("({})", extents.join(", "))
}
