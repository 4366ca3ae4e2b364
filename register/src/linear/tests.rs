//! Every column against finite differences, and places against the body's own, for every family.

use std::path::Path;

use glam::{DMat3, DVec3};
use xavatar_body::{BodyModel, Coefficients, PoseBatch};
use xavatar_formats::read_npz;

use super::*;

fn model(name: &str) -> BodyModel {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/golden/body/tiny_{name}.npz"));
    BodyModel::from_arrays_with(&path, &read_npz(&path).unwrap(), Coefficients::Usual).unwrap()
}

/// A pose in which nothing is special, and a shape.
fn some_pose(extents: Extents) -> (FramePose, Vec<f64>) {
    let wave = |index: usize, step: f64| (index as f64 * step).sin();
    let turns = (0..extents.joints)
        .map(|joint| (joint, DVec3::new(wave(joint, 1.3), wave(joint, 2.1), wave(joint, 0.7)) * 0.6));
    let mut pose = FramePose::turned(extents, turns);
    pose.translation = DVec3::new(0.3, -0.2, 1.1);
    pose.expression.iter_mut().enumerate().for_each(|(index, value)| *value = wave(index + 1, 1.7));
    (pose, (0..extents.shapes).map(|index| wave(index + 2, 0.9)).collect())
}

const FAMILIES: [&str; 6] = ["smpl", "smplh", "smplx", "mano", "flame", "star"];

#[test]
fn places_are_those_of_the_body() {
    for name in FAMILIES {
        let model = model(name);
        let linkage = Linkage::of(&model);
        let (pose, shape) = some_pose(linkage.extents());
        let all: Vec<usize> = (0..model.vertex_count()).collect();
        let points = BodyPoints::of(&model, &linkage, &all);
        let chain = linkage.posed(&pose, &shape);
        let posed = points.posed(&linkage, &chain);
        let batch = PoseBatch {
            rotations: pose.rotations.iter().map(|rotation| so3::log(rotation).to_array()).collect(),
            coefficients: shape.iter().chain(&pose.expression).copied().collect(),
            translations: vec![pose.translation.to_array()],
        };
        let expected = model.pose_batch(&batch).unwrap();
        let far = |found: &[DVec3], expected: &[[f64; 3]]| {
            found.iter().zip(expected).map(|(a, b)| a.distance((*b).into())).fold(0.0, f64::max)
        };
        let joints: Vec<DVec3> = (0..linkage.extents().joints).map(|joint| chain.joint(joint)).collect();
        assert!(far(&joints, &expected.joints) < 1e-12, "{name}");
        // Correctives that are not differentiated are not applied either.
        assert!(
            far(&posed.positions, &expected.vertices) < 1e-4,
            "{name}: {}",
            far(&posed.positions, &expected.vertices)
        );
    }
}

/// Where each bone takes a point, times its weight, and the weight.
fn pulls(chain: &PosedChain) -> Vec<(DVec3, f64)> {
    let point = DVec3::new(0.2, 0.9, -0.1);
    let joints = chain.turns.len() as f64;
    let pull = |(joint, (turn, shift)): (usize, (&DMat3, &DVec3))| {
        let weight = (2.0 + joint as f64) / joints.powi(2);
        ((*turn * point + *shift) * weight, weight)
    };
    chain.turns.iter().zip(&chain.shifts).enumerate().map(pull).collect()
}

/// All entries of a row, of which it keeps those that are not zero.
fn entries(unknowns: &Unknowns, row: &Row) -> Vec<f64> {
    let mut whole = vec![0.0; unknowns.count()];
    row.entries().for_each(|(place, value)| whole[place] = value);
    whole
}

#[test]
fn every_column_is_that_of_finite_differences() {
    const STEP: f64 = 1e-5;
    for name in FAMILIES {
        let model = model(name);
        let linkage = Linkage::of(&model);
        let extents = linkage.extents();
        let (pose, shape) = some_pose(extents);
        let some: Vec<usize> = (0..model.vertex_count()).step_by(3).collect();
        let points = BodyPoints::of(&model, &linkage, &some);
        let joints: Vec<usize> = (0..extents.joints).collect();
        let unknowns = Unknowns::new(extents, &joints, Besides { translation: true, expression: true, shape: true });
        let n = DVec3::new(0.36, -0.48, 0.8);
        let heights = |pose: &FramePose, shape: &[f64]| -> Vec<f64> {
            let chain = linkage.posed(pose, shape);
            let vertices = points.posed(&linkage, &chain).positions;
            vertices
                .into_iter()
                .chain(joints.iter().map(|joint| chain.joint(*joint)))
                .map(|place| n.dot(place))
                .collect()
        };
        let moved = |column: usize, by: f64| {
            let mut step = vec![0.0; extents.count()];
            step[column] = by;
            let shape: Vec<f64> = shape.iter().zip(&step[extents.shape()]).map(|(value, step)| value + step).collect();
            heights(&pose.moved(extents, &step), &shape)
        };
        let chain = linkage.posed(&pose, &shape);
        let posed = points.posed(&linkage, &chain);
        let basis = Basis { linkage: &linkage, chain: &chain, unknowns: &unknowns };
        let mut row = Row::default();
        let mut rows = Vec::new();
        let mut keep = |row: &Row| rows.push(entries(&unknowns, row));
        for index in 0..points.len() {
            points.row(basis, &posed, index, n, &mut row);
            keep(&row);
        }
        for joint in &joints {
            basis.joint_row(*joint, n, &mut row);
            keep(&row);
        }
        basis.skinned_row(&mut pulls(&chain), n, &mut row);
        let of_bones = entries(&unknowns, &row);
        for column in (0..3 * extents.joints).chain(extents.translation()) {
            let height = |by: f64| {
                let mut step = vec![0.0; extents.count()];
                step[column] = by;
                let moved = pose.moved(extents, &step);
                let chain = linkage.posed(&moved, &shape);
                n.dot(pulls(&chain).iter().map(|(pull, _)| *pull).sum::<DVec3>() + moved.translation)
            };
            let numeric = (height(STEP) - height(-STEP)) / (2.0 * STEP);
            let exact = of_bones[unknowns.place(column).unwrap()];
            assert!((numeric - exact).abs() < 1e-8, "{name}, column {column} of bones: {numeric} {exact}");
        }
        for column in 0..extents.count() {
            let (ahead, behind) = (moved(column, STEP), moved(column, -STEP));
            let place = unknowns.place(column).unwrap();
            for (index, row) in rows.iter().enumerate() {
                let numeric = (ahead[index] - behind[index]) / (2.0 * STEP);
                assert!(
                    (numeric - row[place]).abs() < 1e-8,
                    "{name}, column {column}, row {index}: {numeric} {}",
                    row[place]
                );
            }
        }
    }
}
