//! A model as the arrays of a file, whatever its family: SUPR's layout, whose affine regressor holds any joints exactly (METHOD-BODY section 1).
//!
//! A joint is R [T_S | 1] for the shaped vertices T_S = T + D c, and moves by J_s with each coefficient: R D_s = J_s for all s, R the shortest such
//! on the vertices nearest to the joint, and the bias what is left at rest. V vertices, J joints, K directions; metres.

use glam::DVec3;
use rayon::prelude::*;
use xavatar_formats::{Array, ArrayData, ArrayMap};

use super::families::supr::{EXPRESSIONS, HANDS, JOINT_NAMES, scalar};
use super::symmetric::eigen;
use super::{BodyModel, Correctives};

/// Vertices that may place a joint, at least.
const NEAREST: usize = 100;
/// Combinations of directions that move them less than this share of the most are not told apart.
const FLAT: f64 = 1e-10;

impl BodyModel {
    /// The arrays of a file that reads as this model, with all its coefficients.
    ///
    /// Joints are exact where the vertices near them tell the coefficients apart. A corrective that a coefficient drives (STAR's) becomes part of that
    /// coefficient's shape, which is the same.
    pub fn to_arrays(&self) -> ArrayMap {
        let anatomy = &*self.anatomy;
        let (vertices, joints) = (anatomy.template.len(), anatomy.skeleton.joints.len());
        let directions = self.driven_directions();
        let mut arrays = ArrayMap::new();
        let mut set =
            |key: &str, shape: &[usize], data| arrays.insert(key.to_owned(), Array { shape: shape.to_vec(), data });
        let template = anatomy.template.iter().flat_map(|vertex| vertex.to_array()).collect();
        set("v_template", &[vertices, 3], ArrayData::F32(template));
        let corners = anatomy.faces.iter().flatten().map(|corner| i64::from(*corner)).collect();
        set("f", &[anatomy.faces.len(), 3], ArrayData::I64(corners));
        set("weights", &[vertices, joints], ArrayData::F32(anatomy.skinning_weights.clone()));
        let parents = anatomy.skeleton.parents.iter().map(|parent| parent.map_or(-1, |parent| parent as i64));
        set("kintree_table", &[2, joints], ArrayData::I64(parents.chain(0..joints as i64).collect()));
        set("shapedirs", &[vertices, 3, directions.len()], ArrayData::F32(interleaved(&directions, 3 * vertices)));
        if let Some(shapes) = anatomy.correctives.shapes() {
            let rows: Vec<Vec<f32>> = shapes.directions().take(self.turned_features()).map(<[f32]>::to_vec).collect();
            set("posedirs", &[vertices, 3, rows.len()], ArrayData::F32(interleaved(&rows, 3 * vertices)));
        }
        set("J_regressor", &[3 * joints, 3 * vertices + 1], ArrayData::F64(self.affine_regressor(&directions)));
        for ([mean, components], hand) in HANDS.iter().zip(&anatomy.hands) {
            set(mean, &[hand.mean.len()], ArrayData::F32(hand.mean.to_vec()));
            let rows = hand.components.as_flattened().to_vec();
            set(components, &[hand.components.len(), hand.mean.len()], ArrayData::F32(rows));
        }
        arrays.insert(JOINT_NAMES.into(), Array::from_text(anatomy.skeleton.joints.join("\n")));
        arrays.insert(EXPRESSIONS.into(), scalar(anatomy.expressions));
        arrays
    }

    /// Features of the correctives that turns drive.
    fn turned_features(&self) -> usize {
        let driven = matches!(self.anatomy.correctives, Correctives::Quaternions { coefficient: Some(_), .. });
        self.anatomy.correctives.count() - usize::from(driven)
    }

    /// The directions (K) of (V, 3), with the corrective of a coefficient in its own.
    fn driven_directions(&self) -> Vec<Vec<f32>> {
        let numbers = 3 * self.anatomy.template.len();
        let full = |row: &[f32]| if row.is_empty() { vec![0.0; numbers] } else { row.to_vec() };
        let mut directions: Vec<Vec<f32>> = self.anatomy.shapes.directions().map(full).collect();
        if let Correctives::Quaternions { coefficient: Some(index), shapes, .. } = &self.anatomy.correctives
            && let Some(driven) = shapes.directions().last()
        {
            directions[*index].iter_mut().zip(driven).for_each(|(sum, offset)| *sum += offset);
        }
        directions
    }

    /// (3 J, 3 V + 1).
    fn affine_regressor(&self, directions: &[Vec<f32>]) -> Vec<f64> {
        let anatomy = &*self.anatomy;
        let count = NEAREST.max(2 * directions.len()).min(anatomy.template.len());
        let joint = |joint: usize| {
            let place = anatomy.joints.template[joint];
            let distance = |vertex: usize| anatomy.template[vertex].as_dvec3().distance_squared(place);
            let mut nearest: Vec<usize> = (0..anatomy.template.len()).collect();
            nearest.sort_by(|one, other| distance(*one).total_cmp(&distance(*other)).then(one.cmp(other)));
            nearest.truncate(count);
            let moves: Vec<DVec3> = anatomy.joints.directions.iter().map(|direction| direction[joint]).collect();
            rows_of_joint(place, &moves, &nearest, &anatomy.template, directions)
        };
        (0..anatomy.skeleton.joints.len()).into_par_iter().flat_map_iter(joint).collect()
    }
}

/// The three rows of a joint, by the vertices `nearest`.
fn rows_of_joint(
    place: DVec3,
    moves: &[DVec3],
    nearest: &[usize],
    template: &[glam::Vec3],
    directions: &[Vec<f32>],
) -> Vec<f64> {
    let columns: Vec<usize> = nearest.iter().flat_map(|vertex| 3 * vertex..3 * vertex + 3).collect();
    let local: Vec<Vec<f64>> =
        directions.iter().map(|row| columns.iter().map(|column| f64::from(row[*column])).collect()).collect();
    let product = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(one, other)| one * other).sum::<f64>();
    let gram: Vec<Vec<f64>> = local.iter().map(|one| local.iter().map(|other| product(one, other)).collect()).collect();
    let (values, vectors) = eigen(gram);
    let least = FLAT * values.first().copied().unwrap_or_default();
    let width = 3 * template.len() + 1;
    let mut rows = vec![0.0; 3 * width];
    for (axis, row) in rows.chunks_exact_mut(width).enumerate() {
        let wanted: Vec<f64> = moves.iter().map(|moved| moved[axis]).collect();
        let mut shares = vec![0.0; moves.len()];
        for (value, vector) in values.iter().zip(&vectors).filter(|(value, _)| **value > least) {
            let along = product(vector, &wanted) / value;
            shares.iter_mut().zip(vector).for_each(|(share, entry)| *share += along * entry);
        }
        let mut left = place[axis];
        for (at, column) in columns.iter().enumerate() {
            let weight: f64 = shares.iter().zip(&local).map(|(share, direction)| share * direction[at]).sum();
            row[*column] = weight;
            left -= weight * f64::from(template[column / 3][column % 3]);
        }
        row[width - 1] = left;
    }
    rows
}

/// Rows (K) of numbers (N), or empty, as (N, K).
fn interleaved(rows: &[Vec<f32>], numbers: usize) -> Vec<f32> {
    (0..numbers).flat_map(|at| rows.iter().map(move |row| row.get(at).copied().unwrap_or(0.0))).collect()
}
