//! A personal body in the layout of the file that it was made from, so that what reads that reads it.
//!
//! Template, correctives and joint regressor are replaced, the rest stays. A regressor's row R becomes R + d, d the shortest change on the vertices nearest
//! to the joint with d T = J - R T and a sum that makes the row's 1. V vertices, J joints; metres.

use glam::DVec3;
use nalgebra::{Matrix4, Vector4};
use xavatar_body::{BodyModel, Correctives};
use xavatar_formats::{Array, ArrayData, ArrayMap};

/// Vertices that a row changes on.
const NEAREST: usize = 100;

/// The arrays of `file` with the template, joints and correctives of `body`; none if the file's regressor is none of joints from vertices, or its
/// correctives are others.
pub(super) fn in_layout_of(file: &ArrayMap, body: &BodyModel) -> Option<ArrayMap> {
    let (vertices, joints) = (body.vertex_count(), body.skeleton().joints.len());
    let regressor = file.get("J_regressor").filter(|array| array.shape == [joints, vertices])?.to_f64()?;
    let (Correctives::RotationEntries(shapes) | Correctives::Quaternions { shapes, .. }) = body.correctives() else {
        return None;
    };
    file.get("posedirs").filter(|array| array.shape.last() == Some(&shapes.count()))?;
    let columns: Vec<&[f32]> = shapes.directions().collect();
    let entry = |at: usize| columns.iter().map(move |column| column.get(at).copied().unwrap_or(0.0));
    let template: Vec<DVec3> = body.template().iter().map(|vertex| vertex.as_dvec3()).collect();
    let rows = regressor.chunks_exact(vertices).zip(&body.anatomy().joints.template);
    let rows: Vec<f64> = rows.flat_map(|(row, joint)| moved_row(row, *joint, &template)).collect();
    let mut arrays = file.clone();
    let mut set =
        |key: &str, shape: &[usize], data| arrays.insert(key.to_owned(), Array { shape: shape.to_vec(), data });
    set("v_template", &[vertices, 3], ArrayData::F64(template.iter().flat_map(|place| place.to_array()).collect()));
    set("posedirs", &[vertices, 3, columns.len()], ArrayData::F32((0..3 * vertices).flat_map(entry).collect()));
    set("J_regressor", &[joints, vertices], ArrayData::F64(rows));
    Some(arrays)
}

/// A row that finds the joint in this template.
fn moved_row(row: &[f64], joint: DVec3, template: &[DVec3]) -> Vec<f64> {
    let homogeneous = |place: DVec3| Vector4::new(place.x, place.y, place.z, 1.0);
    let found: Vector4<f64> = row.iter().zip(template).map(|(weight, place)| homogeneous(*place) * *weight).sum();
    let mut nearest: Vec<usize> = (0..template.len()).collect();
    nearest.sort_by(|one, other| {
        template[*one].distance_squared(joint).total_cmp(&template[*other].distance_squared(joint))
    });
    nearest.truncate(NEAREST);
    // About the joint, so that nothing cancels.
    let about = |vertex: usize| homogeneous(template[vertex] - joint);
    let gram: Matrix4<f64> = nearest.iter().map(|vertex| about(*vertex) * about(*vertex).transpose()).sum();
    // d (T - J) = J sum(R) - R T and d 1 = 1 - sum(R).
    let short = joint * found.w - DVec3::new(found.x, found.y, found.z);
    let wanted = Vector4::new(short.x, short.y, short.z, 1.0 - found.w);
    let mut moved = row.to_vec();
    if let Some(shares) = gram.try_inverse().map(|inverse| inverse * wanted) {
        nearest.iter().for_each(|vertex| moved[*vertex] += about(*vertex).dot(&shares));
    }
    moved
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use xavatar_body::{Anatomy, Coefficients, PoseAxisAngle};
    use xavatar_formats::read_npz;

    use super::*;
    use crate::core::{Identity, with_identity};

    #[test]
    fn the_file_of_a_family_is_the_person() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/body/tiny_smpl.npz");
        let file = read_npz(&path).unwrap();
        let start = BodyModel::from_arrays(&path, &file).unwrap();
        let rest = Identity::of(&start);
        let identity = Identity {
            template: rest.template.iter().map(|place| *place * DVec3::new(1.1, 0.9, 1.2)).collect(),
            joints: rest.joints.iter().map(|place| *place + DVec3::new(0.01, -0.02, 0.005)).collect(),
        };
        let person = with_identity(&start, &identity).unwrap();
        let correctives = match start.correctives() {
            Correctives::RotationEntries(shapes) => {
                let twice = shapes.directions().map(|row| row.iter().map(|value| 2.0 * value).collect());
                Correctives::RotationEntries(xavatar_body::BlendShapes::from_directions(twice.collect()))
            }
            other => other.clone(),
        };
        let person = BodyModel::assemble(&path, Anatomy { correctives, ..person.anatomy().clone() }).unwrap();
        let read =
            BodyModel::from_arrays_with(&path, &in_layout_of(&file, &person).unwrap(), Coefficients::Usual).unwrap();
        assert_eq!(read.skeleton().family, "SMPL");
        let mut pose = start.skeleton().rest_pose();
        pose.rotations.iter_mut().for_each(|turn| *turn = PoseAxisAngle(glam::Vec3::new(0.3, -0.2, 0.5)));
        let (found, expected) = (read.pose(&pose).unwrap(), person.pose(&pose).unwrap());
        for (found, expected) in found.vertices.iter().zip(&expected.vertices) {
            assert!(found.distance(*expected) < 1e-5, "{found} {expected}");
        }
        assert!(in_layout_of(&person.to_arrays(), &person).is_none());
    }
}
