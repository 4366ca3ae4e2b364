//! What an SMPL-X file has to hold, and its skeleton.

use std::path::Path;

use super::*;
use crate::BodyModel;
use xavatar_formats::{Array, ArrayData, ArrayMap};

const VERTICES: usize = 4;
const POSE_FEATURES: usize = (joint::COUNT - 1) * 9;

/// A model of `vertices`, all bound to the root.
fn arrays_of(vertices: usize) -> ArrayMap {
    let zeros = |shape: &[usize]| (shape.to_vec(), vec![0.0; shape.iter().product()]);
    let first_in_rows = |rows: usize, columns: usize| {
        let values = (0..rows * columns).map(|at| f64::from(u8::from(at % columns == 0))).collect();
        (vec![rows, columns], values)
    };
    let parents = skeleton().parents.iter().map(|parent| parent.map_or(4_294_967_295.0, |parent| parent as f64));
    [
        ("v_template", (vec![vertices, 3], (0..3 * vertices).map(|value| value as f64).collect())),
        ("f", (vec![2, 3], vec![0.0, 1.0, 2.0, 0.0, 2.0, (vertices - 1) as f64])),
        ("weights", first_in_rows(vertices, joint::COUNT)),
        ("J_regressor", first_in_rows(joint::COUNT, vertices)),
        (
            "kintree_table",
            (vec![2, joint::COUNT], parents.chain((0..joint::COUNT).map(|joint| joint as f64)).collect()),
        ),
        ("shapedirs", zeros(&[vertices, 3, 20])),
        ("posedirs", zeros(&[vertices, 3, POSE_FEATURES])),
        ("hands_meanl", zeros(&[45])),
        ("hands_meanr", zeros(&[45])),
        ("hands_componentsl", zeros(&[45, 45])),
        ("hands_componentsr", zeros(&[45, 45])),
    ]
    .into_iter()
    .map(|(key, (shape, values))| (key.to_owned(), Array { shape, data: ArrayData::F64(values) }))
    .collect()
}

fn arrays() -> ArrayMap {
    arrays_of(VERTICES)
}

/// A model with these skinning weights (V, J).
pub(crate) fn model_of_weights(weights: Vec<f32>) -> BodyModel {
    let mut arrays = arrays_of(weights.len() / joint::COUNT);
    arrays.insert("weights".into(), Array::from_f32(&[weights.len() / joint::COUNT, joint::COUNT], weights));
    read(&arrays).unwrap()
}

fn read(arrays: &ArrayMap) -> Result<BodyModel> {
    BodyModel::from_arrays(Path::new("SMPLX_MALE.npz"), arrays)
}

/// The message after `key` became an array of `shape`, filled with `value`.
fn message_with(key: &str, shape: &[usize], value: f64) -> String {
    let mut arrays = arrays();
    let data = ArrayData::F64(vec![value; shape.iter().product()]);
    arrays.insert(key.into(), Array { shape: shape.to_vec(), data });
    read(&arrays).expect_err(key).to_string()
}

#[test]
fn models_of_other_families_are_named() {
    for (joints, name) in [(24, "SMPL model"), (52, "SMPL+H model"), (16, "MANO model"), (7, "7 joints")] {
        let message = message_with("kintree_table", &[2, joints], 0.0);
        assert!(message.contains(name) && message.contains("SMPLX_MALE.npz"), "{message}");
    }
    assert!(message_with("shapedirs", &[VERTICES, 3, 16], 0.0).contains("16 shape columns"));
}

#[test]
fn every_missing_or_misshapen_array_is_named() {
    for key in arrays().keys() {
        let mut without = arrays();
        without.remove(key);
        assert!(read(&without).unwrap_err().to_string().contains(&format!("{key} is absent")), "{key}");
        let message = message_with(key, &[3, 5], 0.0);
        assert!(message.contains(key.as_str()) || message.contains("5 joints"), "{message}");
    }
}

#[test]
fn numbers_that_cannot_be_are_refused() {
    assert!(
        message_with("v_template", &[VERTICES, 3], f64::NAN).contains("v_template is not a finite number at element 0")
    );
    assert!(message_with("posedirs", &[VERTICES, 3, POSE_FEATURES], 1e300).contains("posedirs is"));
    assert!(message_with("weights", &[VERTICES, joint::COUNT], 0.5).contains("weights[0] is a row with sum 27.5"));
    assert!(message_with("J_regressor", &[joint::COUNT, VERTICES], 0.0).contains("J_regressor[0]"));
    assert!(message_with("f", &[1, 3], 4.0).contains("4 in face 0, expected vertex indices below 4"));
    assert!(message_with("f", &[1, 3], -1.0).contains("-1 in face 0"));
    assert!(message_with("v_template", &[0, 3], 0.0).contains("at least one vertex"));
    assert!(message_with("kintree_table", &[2, joint::COUNT], 0.0).contains("kintree_table[1][1] is 0, expected 1"));
}

#[test]
fn a_tree_out_of_order_is_refused() {
    let mut arrays = arrays();
    let Some(Array { data: ArrayData::F64(tree), .. }) = arrays.get_mut("kintree_table") else { unreachable!() };
    tree[4] = 7.0;
    let message = read(&arrays).unwrap_err().to_string();
    assert!(message.contains("kintree_table[0][4] is 7, expected 1 (the parent in SMPL-X)"), "{message}");
}

// An extent and a length that disagree must not reach the slicing.
#[test]
fn arrays_shorter_than_their_shape_are_refused() {
    for key in arrays().keys() {
        let mut arrays = arrays();
        if let Some(Array { data: ArrayData::F64(values), .. }) = arrays.get_mut(key) {
            values.pop();
        }
        assert!(read(&arrays).unwrap_err().to_string().contains(key.as_str()), "{key}");
    }
}

#[test]
fn expression_columns_of_the_full_release_start_at_300() {
    let mut arrays = arrays();
    let mut values = vec![0.0; VERTICES * 3 * 400];
    values[300] = 2.0;
    values[10] = 5.0;
    let data = ArrayData::F64(values);
    arrays.insert("shapedirs".into(), Array { shape: vec![VERTICES, 3, 400], data });
    let pose = Pose { expression: vec![1.0], ..skeleton().rest_pose() };
    let offsets = read(&arrays).unwrap().vertex_offsets(&pose).unwrap();
    assert_eq!(offsets, [Vec3::X * 2.0, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO]);
}

#[test]
fn a_search_starts_from_joints_that_move_its_own_part() {
    let skeleton = skeleton();
    let parts = skeleton.parts_of_joints();
    for (part, group) in skeleton.parts() {
        assert!(group.starts.iter().all(|joint| parts[*joint] == part), "{}", group.name);
    }
    let started = skeleton.parts().filter(|(_, group)| group.role != Role::Face).flat_map(|(_, group)| &group.starts);
    assert!(started.into_iter().all(|joint| skeleton.starts.contains(joint)));
    assert_eq!(skeleton.starts.len(), 45);
    assert_eq!((&skeleton.starts[9..12], skeleton.starts[44]), (&[19, 20, 21][..], 54));
}

#[test]
fn a_pose_becomes_parameters_and_comes_back() {
    let mut pose = skeleton().canonical_pose(&[0.5, -1.0]);
    pose.rotations.iter_mut().enumerate().for_each(|(joint, turn)| turn.0.y = joint as f32);
    (pose.expression, pose.translation) = (vec![0.25; 10], Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(Parameters::from(&pose).absolute().unwrap(), pose);
}
