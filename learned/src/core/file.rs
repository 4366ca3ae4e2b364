//! A trained body as the arrays of a file: STAR's layout for SMPL's joints, the common one (SUPR's) for any others.

use std::path::Path;

use glam::DVec3;
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Correctives, JointBasis};
use xavatar_formats::{Array, ArrayData, ArrayMap, Result};

use super::Shapes;

/// Coefficients that STAR's readers expect at least.
const STAR_SHAPES: usize = 10;

/// What a trained body is a file of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// SMPL's 24 joints; its second coefficient of shape is how heavy a body is for its height.
    Star,
    /// Any joints.
    Supr,
}

/// The arrays of a body that began as `model`: with its skeleton, weights, hands and expressions, and these shapes, rows of the joint regressor
/// (J, V) and quaternion correctives.
///
/// # Errors
/// Those of [`BodyModel::assemble`].
pub fn trained_arrays(model: &BodyModel, shapes: &Shapes, rows: &[Vec<f64>], family: Family) -> Result<ArrayMap> {
    let anatomy = model.anatomy();
    let old = anatomy.shape_coefficients();
    let single = |direction: &Vec<DVec3>| direction.iter().flat_map(|offset| offset.as_vec3().to_array()).collect();
    let mut directions: Vec<Vec<f32>> = shapes.directions.iter().map(single).collect();
    if family == Family::Star && directions.len() < STAR_SHAPES {
        directions.resize(STAR_SHAPES, Vec::new());
    }
    let joints_of = |points: &dyn Fn(usize) -> DVec3| -> Vec<DVec3> {
        let place = |row: &Vec<f64>| {
            let entries = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            entries.map(|(vertex, weight)| points(vertex) * *weight).sum()
        };
        rows.iter().map(place).collect()
    };
    let at = |direction: &[f32], vertex: usize| match direction.get(3 * vertex..3 * vertex + 3) {
        Some(offset) => glam::Vec3::from_slice(offset).as_dvec3(),
        None => DVec3::ZERO,
    };
    if family == Family::Supr {
        directions.extend(anatomy.shapes.directions().skip(old).map(<[f32]>::to_vec));
    }
    let of_directions = directions.iter().map(|direction| joints_of(&|vertex| at(direction, vertex))).collect();
    let trained = Anatomy {
        template: shapes.mean.iter().map(|place| place.as_vec3()).collect(),
        expressions: if family == Family::Supr { anatomy.expressions } else { 0 },
        joints: JointBasis { template: joints_of(&|vertex| shapes.mean[vertex]), directions: of_directions },
        shapes: BlendShapes::from_directions(directions),
        ..anatomy.clone()
    };
    let (vertices, joints) = (trained.template.len(), rows.len());
    let correctives = trained.correctives.clone();
    let mut arrays = BodyModel::assemble(Path::new("the trained body"), trained)?.to_arrays();
    let mut set =
        |key: &str, shape: &[usize], data| arrays.insert(key.to_owned(), Array { shape: shape.to_vec(), data });
    match family {
        Family::Supr => set("J_regressor", &[3 * joints, 3 * vertices + 1], ArrayData::F64(by_coordinates(rows))),
        Family::Star => {
            set(
                "posedirs",
                &[vertices, 3, 4 * (joints - 1) + 1],
                ArrayData::F32(with_coefficient(&correctives, vertices)),
            );
            set("J_regressor", &[joints, vertices], ArrayData::F64(rows.concat()))
        }
    };
    if family == Family::Star {
        ["joint_names", "expressions"].iter().for_each(|key| drop(arrays.remove(*key)));
    }
    Ok(arrays)
}

/// The regressor of vertices (J, V) as one of their coordinates and a bias (3 J, 3 V + 1).
fn by_coordinates(rows: &[Vec<f64>]) -> Vec<f64> {
    let width = 3 * rows.first().map_or(0, Vec::len) + 1;
    let row = |(row, axis): (&Vec<f64>, usize)| {
        let mut spread = vec![0.0; width];
        row.iter().enumerate().for_each(|(vertex, weight)| spread[3 * vertex + axis] = *weight);
        spread
    };
    rows.iter().flat_map(|of_joint| [0, 1, 2].map(|axis| (of_joint, axis))).flat_map(row).collect()
}

/// Correctives (V, 3, F + 1) with one more column, of STAR's coefficient. A linear drive by a coefficient is a direction of shape, where it is already.
fn with_coefficient(correctives: &Correctives, vertices: usize) -> Vec<f32> {
    let Correctives::Quaternions { shapes, .. } = correctives else { return Vec::new() };
    let columns: Vec<&[f32]> = shapes.directions().collect();
    let value = |at: usize, column: &[f32]| column.get(at).copied().unwrap_or(0.0);
    (0..3 * vertices).flat_map(|at| columns.iter().map(move |column| value(at, column)).chain([0.0])).collect()
}

#[cfg(test)]
mod tests {
    use xavatar_body::{Coefficients, Pose, PoseAxisAngle};
    use xavatar_formats::read_npz;

    use super::*;
    use crate::core::{Identity, joint_rows, shapes_of, weight_rows, with_identity, with_skin};
    use crate::sparse::SparseCorrectives;

    /// SMPL's smallest, with correctives of the knees, and three people who differ in height and width.
    fn people() -> (BodyModel, Vec<Identity>) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/body/tiny_smpl.npz");
        let model = BodyModel::from_arrays(&path, &read_npz(&path).unwrap()).unwrap();
        let block = [0.01, 0.02, -0.01, 0.03].map(DVec3::splat);
        let vertices = (0..model.vertex_count()).map(|vertex| vec![(3 + vertex % 2, block)]).collect();
        let model = with_skin(&model, &weight_rows(&model), SparseCorrectives { vertices }.to_body(24)).unwrap();
        let rest = Identity::of(&model);
        let scaled = |scale: DVec3| Identity {
            template: rest.template.iter().map(|place| *place * scale).collect(),
            joints: rest.joints.iter().map(|place| *place * scale).collect(),
        };
        let people = [(1.0, 1.0), (1.1, 1.2), (0.9, 1.05)].map(|(x, y)| scaled(DVec3::new(x, y, 1.0)));
        (model, people.to_vec())
    }

    #[test]
    fn a_person_at_rest_in_either_file_is_the_person() {
        let (model, people) = people();
        let shapes = shapes_of(&people, 10);
        let rows = joint_rows(&people, &shapes);
        let rotations: Vec<PoseAxisAngle> =
            (0..24).map(|joint| PoseAxisAngle(glam::Vec3::new(0.3, -0.2, 0.1 * joint as f32 - 1.0))).collect();
        for (family, name, expected) in [(Family::Star, "STAR", 10), (Family::Supr, "SUPR", 2)] {
            let arrays = trained_arrays(&model, &shapes, &rows, family).unwrap();
            let trained = BodyModel::from_arrays_with(Path::new("trained"), &arrays, Coefficients::All).unwrap();
            assert_eq!((trained.skeleton().family.as_str(), trained.shape_coefficients()), (name, expected));
            assert_eq!(trained.skeleton().joints, model.skeleton().joints);
            for (person, coefficients) in people.iter().zip(&shapes.coefficients) {
                let shape = coefficients.iter().map(|value| *value as f32).collect();
                let pose = Pose { rotations: rotations.clone(), shape, ..Pose::default() };
                let rest = trained.rest_vertices(&pose).unwrap();
                let own = with_identity(&model, person).unwrap();
                let expected = own.rest_vertices(&Pose { shape: Vec::new(), ..pose }).unwrap();
                for (found, expected) in rest.iter().zip(expected) {
                    assert!(found.distance(expected) < 1e-5, "{name}: {found} {expected}");
                }
            }
        }
    }
}
