//! A model moved to another mesh, against double-precision references and back on its own.

use std::path::Path;

use glam::DVec3;
use xavatar_body::{BodyModel, Pose, PoseAxisAngle, ShapeSpace, SurfaceMap, moved};
use xavatar_formats::{Array, ArrayData, ArrayMap};
use xavatar_mesh::TriangleMesh;

use super::reference::numbers;

fn points(values: &[f64]) -> Vec<DVec3> {
    values.as_chunks::<3>().0.iter().map(|point| DVec3::from(*point)).collect()
}

#[test]
fn closest_points_carry_what_is_on_the_surface() {
    let golden = numbers("reparameterisation");
    let faces: Vec<[u32; 3]> =
        golden["faces_1"].as_chunks::<3>().0.iter().map(|face| face.map(|corner| corner as u32)).collect();
    let map = SurfaceMap::new(&points(&golden["points_2"]), &points(&golden["points_1"]), &faces, None).unwrap();
    let far = |found: &[f64], name: &str| -> f64 {
        assert_eq!(found.len(), golden[name].len(), "{name}");
        found.iter().zip(&golden[name]).map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max)
    };
    assert!(far(&map.apply(&golden["blendshapes_1"], 36), "blendshapes_2") < 1e-9);
    assert!(far(&map.apply(&golden["weights_1"], 4), "weights_2") < 1e-9);
    let on_surface = map.apply(&golden["points_1"], 3);
    let gap: Vec<f64> = golden["points_2"].iter().zip(&on_surface).map(|(point, found)| point - found).collect();
    assert!(far(&gap, "mean_gap") < 1e-9);
}

#[test]
fn faces_without_an_area_are_points_or_edges() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::X, DVec3::X];
    let faces = [[0, 1, 2], [1, 3, 4]];
    let map = SurfaceMap::new(&[DVec3::new(0.5, 1.0, 0.0), DVec3::new(5.0, 0.0, 0.0)], &corners, &faces, None).unwrap();
    let flat: Vec<f64> = corners.iter().flat_map(|corner| corner.to_array()).collect();
    assert!(map.apply(&flat, 3).iter().all(|value| value.is_finite()));
    assert!(map.corners.iter().all(|(_, coordinates)| (coordinates.iter().sum::<f64>() - 1.0).abs() < 1e-12));
}

/// A bar of rings with three joints along it, as the arrays of a FLAME-like file have it: five joints.
fn bar(rings: usize) -> (ArrayMap, TriangleMesh) {
    const SECTORS: usize = 12;
    let mut vertices = Vec::new();
    for ring in 0..=rings {
        for sector in 0..SECTORS {
            let angle = std::f64::consts::TAU * sector as f64 / SECTORS as f64;
            vertices.push(DVec3::new(0.1 * angle.cos(), ring as f64 / rings as f64, 0.1 * angle.sin()));
        }
    }
    let mut faces = Vec::new();
    for (ring, sector) in (0..rings).flat_map(|ring| (0..SECTORS).map(move |sector| (ring, sector))) {
        let index = |ring: usize, sector: usize| (ring * SECTORS + sector % SECTORS) as u32;
        let [a, b, c, d] =
            [index(ring, sector), index(ring, sector + 1), index(ring + 1, sector), index(ring + 1, sector + 1)];
        faces.extend([[a, c, b], [b, c, d]]);
    }
    let count = vertices.len();
    let array = |shape: &[usize], values: Vec<f64>| Array { shape: shape.to_vec(), data: ArrayData::F64(values) };
    // Weights and joints at even heights, linear between them.
    let weight = |vertex: &DVec3, joint: usize| (1.0 - (vertex.y * 4.0 - joint as f64).abs()).max(0.0);
    let row = |joint: usize| {
        let near: Vec<f64> =
            vertices.iter().map(|vertex| f64::from(u8::from((vertex.y * 4.0 - joint as f64).abs() < 1e-9))).collect();
        let sum: f64 = near.iter().sum();
        near.into_iter().map(move |value| value / sum)
    };
    let shapes = (0..3 * count * 400)
        .map(|at| if at % 400 == 0 { 0.1 * vertices[at / 1200].to_array()[at / 400 % 3] } else { 0.0 });
    let arrays = ArrayMap::from([
        ("v_template".to_owned(), array(&[count, 3], vertices.iter().flat_map(|vertex| vertex.to_array()).collect())),
        ("f".to_owned(), array(&[faces.len(), 3], faces.iter().flatten().map(|corner| f64::from(*corner)).collect())),
        (
            "weights".to_owned(),
            array(
                &[count, 5],
                vertices.iter().flat_map(|vertex| (0..5).map(move |joint| weight(vertex, joint))).collect(),
            ),
        ),
        ("J_regressor".to_owned(), array(&[5, count], (0..5).flat_map(row).collect())),
        ("kintree_table".to_owned(), array(&[2, 5], vec![-1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 2.0, 3.0, 4.0])),
        ("shapedirs".to_owned(), array(&[count, 3, 400], shapes.collect())),
        ("posedirs".to_owned(), array(&[count, 3, 36], vec![0.0; count * 108])),
    ]);
    let mesh = TriangleMesh {
        vertices: vertices.iter().map(|vertex| vertex.as_vec3()).collect(),
        faces,
        ..TriangleMesh::default()
    };
    (arrays, mesh)
}

#[test]
fn a_model_poses_alike_on_a_finer_mesh_and_back() {
    let path = Path::new("bar.npz");
    let ((coarse, coarse_mesh), (_, fine_mesh)) = (bar(8), bar(40));
    let there = moved(path, &coarse, &fine_mesh).unwrap();
    assert!(there.gap[1] < 1e-6 && there.joint_error < 1e-6, "{:?} {}", there.gap, there.joint_error);
    let back = moved(path, &there.arrays, &coarse_mesh).unwrap();
    let model = |arrays: &ArrayMap| BodyModel::from_arrays(path, arrays).unwrap();
    let (whole, fine, again) = (model(&coarse), model(&there.arrays), model(&back.arrays));
    let mut pose = Pose { shape: vec![1.5], ..whole.skeleton().rest_pose() };
    pose.rotations[1] = PoseAxisAngle(glam::Vec3::new(0.0, 0.0, 0.5));
    let posed = whole.pose(&pose).unwrap();
    for (found, expected) in again.pose(&pose).unwrap().vertices.iter().zip(&posed.vertices) {
        assert!(found.distance(*expected) < 1e-4);
    }
    for (found, expected) in fine.pose(&pose).unwrap().joints.iter().zip(&posed.joints) {
        assert!(found.distance(*expected) < 1e-4);
    }
    assert!(
        there.arrays["weights"]
            .to_f64()
            .unwrap()
            .chunks_exact(5)
            .all(|row| (row.iter().sum::<f64>() - 1.0).abs() < 1e-9)
    );
    let mut elsewhere = fine_mesh;
    elsewhere.vertices.iter_mut().for_each(|vertex| vertex.x += 1.0);
    assert!(moved(path, &coarse, &elsewhere).unwrap_err().to_string().contains("align it first"));
}

/// Columns of a row-major matrix as rows.
fn columns(values: &[f64], count: usize) -> Vec<Vec<f64>> {
    (0..count).map(|column| values.iter().skip(column).step_by(count).copied().collect()).collect()
}

#[test]
fn a_space_of_shapes_moves_with_its_misfit_and_is_measured() {
    let golden = numbers("reparameterisation");
    let faces: Vec<[u32; 3]> =
        golden["faces_1"].as_chunks::<3>().0.iter().map(|face| face.map(|corner| corner as u32)).collect();
    let map = SurfaceMap::new(&points(&golden["points_2"]), &points(&golden["points_1"]), &faces, None).unwrap();
    let space = ShapeSpace {
        mean: golden["points_1"].clone(),
        basis: columns(&golden["basis_1"], 8),
        variance: golden["variance_1"].clone(),
    };
    let moved = space.moved(&map, golden["points_2"].clone(), true);
    let near = |found: &[f64], expected: &[f64], name: &str| {
        assert_eq!(found.len(), expected.len(), "{name}");
        let far = found.iter().zip(expected).map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max);
        assert!(far < 1e-9, "{name}: {far}");
    };
    near(&moved.variance, &golden["variance_2"], "variance");
    for (found, expected) in moved.basis.iter().zip(columns(&golden["basis_2"], 9)) {
        near(found, &expected, "basis");
    }
    near(&moved.compactness(), &golden["compactness"], "compactness");
    let tests: Vec<Vec<f64>> = golden["test_shapes"].chunks_exact(126).map(<[f64]>::to_vec).collect();
    near(&moved.generalisation(&tests), &golden["generalisation"], "generalisation");
    let samples: Vec<Vec<f64>> =
        golden["samples"].chunks_exact(9).map(|coefficients| moved.shape(coefficients)).collect();
    near(&samples.concat(), &golden["sample_shapes"], "samples");
    let specific: Vec<f64> = samples.iter().map(|sample| ShapeSpace::specificity(sample, &tests)).collect();
    near(&specific, &golden["specificity"], "specificity");
    // Without the misfit there is one direction less.
    assert_eq!(space.moved(&map, golden["points_2"].clone(), false).variance.len(), 8);
}
