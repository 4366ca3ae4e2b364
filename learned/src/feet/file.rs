//! Feet among the arrays of a body's file.
//!
//! `foot.left.vertices` (F) and `foot.left.joints` (J) of the body, `foot.left.mean` (F, 3) and `foot.left.directions` (2, F, 3) of its shape,
//! `foot.left.0.W`, `foot.left.0.b` and on of its network; `foot.right.*` alike.

use std::path::Path;

use candle_core::DType;
use xavatar_body::BodyModel;
use xavatar_formats::{ArrayMap, Result};

use super::foot::{FootShape, SHAPES, SIDES, features};
use super::network::layers;
use super::{Feet, Foot};
use crate::descent::{Parameters, of_tensors};
use crate::named_arrays::{NamedArrays, array, flat, points_of, whole};

const PREFIX: &str = "foot.";

impl Feet {
    /// Whether arrays hold feet.
    pub fn are_in(arrays: &ArrayMap) -> bool {
        SIDES.iter().any(|(side, _)| arrays.contains_key(&format!("{PREFIX}{side}.vertices")))
    }

    /// Their arrays.
    ///
    /// # Errors
    /// candle's.
    pub fn to_arrays(&self) -> Result<ArrayMap> {
        let mut arrays = self.parameters.to_arrays(PREFIX).map_err(of_tensors)?;
        for ((side, _), Foot { vertices, joints, shape, .. }) in SIDES.iter().zip(&self.feet) {
            let count = vertices.len();
            for (name, own) in [
                ("vertices", whole(vertices.iter().copied())),
                ("joints", whole(joints.iter().copied())),
                ("mean", array(&[count, 3], flat(&shape.mean))),
                ("directions", array(&[SHAPES, count, 3], flat(shape.directions.iter().flatten()))),
            ] {
                arrays.insert(format!("{PREFIX}{side}.{name}"), own);
            }
        }
        Ok(arrays)
    }

    /// The feet of a body of the same file; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`](xavatar_formats::Error::Malformed) naming the array that is missing, has another shape, or holds numbers that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap, model: &BodyModel) -> Result<Self> {
        let mut parameters = Parameters::new(0, DType::F32);
        let file = NamedArrays { path, arrays, format: "file of a body's feet" };
        let mut foot = |side: &str| {
            let name = |name: &str| format!("{PREFIX}{side}.{name}");
            let places = |of: &str, limit: usize| {
                let places = file.places(&name(of), limit)?;
                let ascend = !places.is_empty() && places.is_sorted_by(|one, other| one < other);
                if ascend { Ok(places) } else { Err(file.wrong(&name(of), "numbers that ascend")) }
            };
            let vertices = places("vertices", model.vertex_count())?;
            let joints = places("joints", model.skeleton().joints.len())?;
            let count = vertices.len();
            let mean = file.points(&name("mean"), count)?;
            let directions = file.numbers(&name("directions"), &[SHAPES, count, 3])?;
            let directions = directions.chunks_exact(3 * count).map(points_of).collect();
            // As wide as the file has it, so that no memory is taken for what is not in it.
            let mut widths = vec![features(joints.len(), count)];
            let next = |widths: &[usize]| name(&format!("{}.W", widths.len() - 1));
            while arrays.contains_key(&next(&widths)) {
                let [outputs, inputs] = file.extents(&next(&widths));
                let expected = widths.last().copied().unwrap_or_default();
                if inputs != expected || outputs == 0 {
                    return Err(file.wrong(&next(&widths), format_args!("rows of {expected} columns")));
                }
                widths.push(outputs);
            }
            if widths.len() == 1 || widths.last() != Some(&(3 * count)) {
                return Err(file.wrong(&next(&widths), format_args!("layers up to one of {} rows", 3 * count)));
            }
            let layers = layers(&mut parameters, side, &widths).map_err(of_tensors)?;
            Ok(Foot { vertices, joints, shape: FootShape { mean, directions }, layers })
        };
        let [left, right] = SIDES.map(|(side, _)| foot(side));
        let feet = [left?, right?];
        parameters.set(path, arrays, PREFIX)?;
        Ok(Self { feet, parameters })
    }
}
