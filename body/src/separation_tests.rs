//! Parts equal the whole on their vertices, of references and of every kind of corrective.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::*;
use crate::{BlendShapes, Role};

#[path = "../tests/it/reference.rs"]
mod reference;

const JOINTS: usize = 12;

fn body(golden: &HashMap<String, Vec<f64>>, correctives: Correctives) -> BodyModel {
    let parents =
        [None, Some(0), Some(1), Some(2), Some(3), Some(4), Some(2), Some(6), Some(7), Some(1), Some(9), Some(10)];
    let all: Vec<usize> = (0..JOINTS).collect();
    let group =
        PartGroup { name: "body".into(), role: Role::Body, joints: all.clone(), starts: all.clone(), detail: None };
    let points = golden["v_template"].as_chunks::<3>().0;
    let regress = |value: &dyn Fn(usize) -> DVec3| -> Vec<DVec3> {
        let rows = golden["J_regressor"].chunks_exact(points.len());
        rows.map(|row| row.iter().enumerate().map(|(vertex, weight)| value(vertex) * *weight).sum()).collect()
    };
    let direction = |vertex: usize, column: usize| {
        DVec3::from_array([0, 1, 2].map(|axis| golden["shapedirs"][(3 * vertex + axis) * 6 + column]))
    };
    let anatomy = Anatomy {
        skeleton: Skeleton {
            family: "reference".into(),
            joints: (0..JOINTS).map(|joint| format!("joint_{joint}")).collect(),
            parents: parents.into(),
            parts: vec![group],
            starts: all.clone(),
            canonical: vec![PoseAxisAngle::default(); JOINTS],
            conditioning: all[1..].into(),
        },
        template: points.iter().map(|point| DVec3::from(*point).as_vec3()).collect(),
        faces: (0..points.len() as u32 - 2).map(|first| [first, first + 1, first + 2]).collect(),
        skinning_weights: golden["weights"].chunks_exact(JOINTS).flat_map(exact_weights).collect(),
        shapes: BlendShapes::from_columns(&golden["shapedirs"], 6, 0..6),
        expressions: 0,
        joints: JointBasis {
            template: regress(&|vertex| points[vertex].into()),
            directions: (0..6).map(|column| regress(&|vertex| direction(vertex, column))).collect(),
        },
        correctives,
        hands: Vec::new(),
    };
    BodyModel::assemble(Path::new("reference"), anatomy).unwrap()
}

/// A row in single precision whose sum is exactly 1: what it is off by would move a part and the whole by different amounts.
fn exact_weights(row: &[f64]) -> Vec<f32> {
    const UNIT: f64 = 1.0 / (1 << 23) as f64;
    let mut row: Vec<f64> = row.iter().map(|weight| (weight / UNIT).round() * UNIT).collect();
    let rest = 1.0 - row.iter().sum::<f64>();
    let largest = (0..JOINTS).max_by(|one, other| row[*one].total_cmp(&row[*other])).unwrap();
    row[largest] += rest;
    row.into_iter().map(|weight| weight as f32).collect()
}

fn quaternions(golden: &HashMap<String, Vec<f64>>) -> Correctives {
    let shapes = BlendShapes::from_columns(&golden["posedirs"], 44, 0..44);
    Correctives::Quaternions { first_joint: 1, coefficient: None, shapes }
}

fn batch(golden: &HashMap<String, Vec<f64>>) -> PoseBatch<f64> {
    PoseBatch {
        rotations: golden["pose"].as_chunks().0.to_vec(),
        coefficients: golden["betas"].clone(),
        translations: vec![[0.1, -0.2, 0.3]; 4],
    }
}

fn indices(values: &[f64]) -> Vec<usize> {
    values.iter().map(|value| *value as usize).collect()
}

/// How far the part is from the whole on its vertices at most.
fn difference(whole: &BodyModel, part: &BodyPart, batch: &PoseBatch<f64>) -> f64 {
    let posed = whole.pose_batch(batch).unwrap().vertices;
    let own = part.model.pose_batch(&part.poses(whole, batch).unwrap()).unwrap().vertices;
    let pairs = own.chunks_exact(part.vertices.len()).zip(posed.chunks_exact(whole.vertex_count()));
    let distance = |(own, posed): (&[[f64; 3]], &[[f64; 3]])| {
        let of_vertex = |(place, vertex): (&[f64; 3], &usize)| DVec3::from(*place).distance(posed[*vertex].into());
        own.iter().zip(&part.vertices).map(of_vertex).fold(0.0, f64::max)
    };
    pairs.map(distance).fold(0.0, f64::max)
}

#[test]
fn vertices_are_those_that_a_joint_and_what_hangs_on_it_move_most() {
    let golden = reference::numbers("part_separation");
    let whole = body(&golden, Correctives::None);
    let found = whole.vertices_from("joint_3").unwrap();
    for (vertex, row) in golden["weights"].chunks_exact(JOINTS).enumerate() {
        assert_eq!(found.contains(&vertex), row[3] + row[4] + row[5] > 0.5, "{vertex}");
    }
    let message = whole.vertices_from("head").unwrap_err().to_string();
    assert!(message.contains("head, expected one of joint_0, joint_1"), "{message}");
}

#[test]
fn the_part_of_the_reference_has_its_joints_and_equals_the_whole() {
    let golden = reference::numbers("part_separation");
    let whole = body(&golden, quaternions(&golden));
    let part = whole.separated(&indices(&golden["part_vertices"]), 0.0).unwrap();
    assert_eq!(part.joints, indices(&golden["kept"]));
    let parents: Vec<Option<usize>> =
        golden["kept_parents"].iter().map(|parent| (*parent >= 0.0).then_some(*parent as usize)).collect();
    assert_eq!(part.model.skeleton().parents, parents);
    let mut batch = batch(&golden);
    assert!(difference(&whole, &part, &batch) < 1e-12);
    // The model is in single precision, the reference is not.
    batch.translations = vec![[0.0; 3]; 4];
    let own = part.model.pose_batch(&part.poses(&whole, &batch).unwrap()).unwrap();
    let far = own.vertices.as_flattened().iter().zip(&golden["full_vertices"]).map(|(own, full)| (own - full).abs());
    assert!(far.fold(0.0, f64::max) < 1e-6);
    assert!(whole.separated(&[], 0.0).is_err() && whole.separated(&[60], 0.0).is_err());
}

// A root whose own rotation corrects the part would lose that; its parent is the root then.
#[test]
fn parts_equal_the_whole_whatever_drives_the_correctives() {
    let golden = reference::numbers("part_separation");
    let dense: Vec<f32> = (0..60 * 3 * 99).map(|at| ((at * 37 % 101) as f32 / 101.0 - 0.5) * 0.01).collect();
    let entries = Correctives::RotationEntries(BlendShapes::from_columns(&dense, 99, 0..99));
    let with_root = Correctives::Quaternions {
        first_joint: 0,
        coefficient: Some(1),
        shapes: BlendShapes::from_columns(&dense, 99, 0..49),
    };
    let vertices = indices(&golden["part_vertices"]);
    for correctives in [Correctives::None, quaternions(&golden), entries, with_root] {
        let whole = body(&golden, correctives);
        for vertices in [&vertices[..], &vertices[..1], &(0..60).collect::<Vec<_>>()] {
            let part = whole.separated(vertices, 0.0).unwrap();
            assert!(difference(&whole, &part, &batch(&golden)) < 1e-12);
        }
        // So does what is read again of the part's file.
        let part = whole.separated(&vertices, 0.0).unwrap();
        let arrays = part.model.to_arrays();
        let read = BodyModel::from_arrays_with(Path::new("part"), &arrays, crate::Coefficients::All).unwrap();
        assert!(difference(&whole, &BodyPart { model: read, ..part }, &batch(&golden)) < 1e-5);
        // A tolerance costs what it says: joints without weight go.
        let part = whole.separated(&vertices, 1.0).unwrap();
        assert!(part.joints.len() <= 7 && difference(&whole, &part, &batch(&golden)) < 0.5);
    }
    assert_eq!(
        body(&golden, Correctives::None).separated(&[3], 0.0).unwrap().model.template()[0],
        Vec3::from_array(golden["v_template"].as_chunks::<3>().0[3].map(|value| value as f32))
    );
}
