//! Every family against double-precision references: vertices, joints, and the gradient of a function of both.
//!
//! The references hold loss = sum c_vertices . vertices + sum c_joints . joints and its derivatives by pose, coefficients, translation.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensors};
use xavatar_body::{BodyModel, Coefficients, PoseBatch};
use xavatar_formats::read_npz;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/body").join(name)
}

/// The f64 tensors of a reference file.
fn tensors(name: &str) -> HashMap<String, Vec<f64>> {
    let bytes = std::fs::read(golden(&format!("{name}.safetensors"))).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let read = |(name, view): (String, safetensors::tensor::TensorView)| {
        assert_eq!(view.dtype(), Dtype::F64, "{name}");
        (name, view.data().as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    };
    file.tensors().into_iter().map(read).collect()
}

fn triples(values: &[f64]) -> Vec<[f64; 3]> {
    values.as_chunks().0.to_vec()
}

fn largest_difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max)
}

/// The tiny model of a family, and its reference.
fn family(name: &str) -> (BodyModel, HashMap<String, Vec<f64>>) {
    let path = golden(&format!("tiny_{name}.npz"));
    let model = BodyModel::from_arrays_with(&path, &read_npz(&path).unwrap(), Coefficients::Usual).unwrap();
    (model, tensors(&format!("forward_{name}")))
}

fn batch(golden: &HashMap<String, Vec<f64>>) -> PoseBatch<f64> {
    PoseBatch {
        rotations: triples(&golden["pose"]),
        coefficients: golden["coefficients"].clone(),
        translations: triples(&golden["transl"]),
    }
}

#[test]
fn bodies_and_gradients_of_every_family_are_those_of_the_references() {
    for name in ["smpl", "smplh", "smplx", "mano", "flame", "star"] {
        let (model, golden) = family(name);
        let batch = batch(&golden);
        let posed = model.pose_batch(&batch).unwrap();
        assert!(largest_difference(posed.vertices.as_flattened(), &golden["vertices"]) < 1e-12, "{name}");
        assert!(largest_difference(posed.joints.as_flattened(), &golden["joints"]) < 1e-12, "{name}");
        // The same cotangents for every frame.
        let vertices = triples(&golden["c_vertices"]).repeat(batch.frames());
        let joints = triples(&golden["c_joints"]).repeat(batch.frames());
        let cotangent = posed.pullback(&model, &batch, &vertices, &joints).unwrap();
        for (found, expected) in [
            (cotangent.rotations.as_flattened(), "d_pose"),
            (&cotangent.coefficients, "d_coefficients"),
            (cotangent.translations.as_flattened(), "d_transl"),
        ] {
            let difference = largest_difference(found, &golden[expected]);
            assert!(difference < 1e-10, "{name} {expected}: {difference}");
        }
    }
}

#[test]
fn single_precision_agrees_and_one_frame_is_one_of_many() {
    let (model, golden) = family("smplx");
    let wide = batch(&golden);
    let narrow = PoseBatch {
        rotations: wide.rotations.iter().map(|r| r.map(|value| value as f32)).collect(),
        coefficients: wide.coefficients.iter().map(|value| *value as f32).collect(),
        translations: wide.translations.iter().map(|t| t.map(|value| value as f32)).collect(),
    };
    let posed = model.pose_batch(&narrow).unwrap();
    let found: Vec<f64> = posed.vertices.as_flattened().iter().map(|value| f64::from(*value)).collect();
    assert!(largest_difference(&found, &golden["vertices"]) < 1e-5);

    let (joints, coefficients) = (wide.rotations.len() / wide.frames(), wide.coefficients.len() / wide.frames());
    let last = PoseBatch {
        rotations: wide.rotations[wide.rotations.len() - joints..].to_vec(),
        coefficients: wide.coefficients[wide.coefficients.len() - coefficients..].to_vec(),
        translations: wide.translations[wide.frames() - 1..].to_vec(),
    };
    let alone = model.pose_batch(&last).unwrap();
    let of_all = model.pose_batch(&wide).unwrap();
    let tail = &of_all.vertices[of_all.vertices.len() - model.vertex_count()..];
    assert!(largest_difference(alone.vertices.as_flattened(), tail.as_flattened()) < 1e-14);
}

#[test]
fn the_single_pose_and_the_batch_agree() {
    use xavatar_body::{Pose, PoseAxisAngle};
    for name in ["smpl", "smplh", "smplx", "mano", "flame", "star"] {
        let (model, _) = family(name);
        let joints = model.skeleton().joints.len();
        let turn = |joint: usize| PoseAxisAngle(glam::Vec3::new(0.3, -0.2, 0.1) * (joint as f32 + 1.0) / joints as f32);
        let pose = Pose {
            rotations: (0..joints).map(turn).collect(),
            shape: vec![0.5, -1.0, 0.25],
            expression: Vec::new(),
            translation: glam::Vec3::new(0.1, 1.0, -0.5),
        };
        let single = model.pose(&pose).unwrap();
        let batch = PoseBatch::<f64>::of(&model, [&pose]).unwrap();
        let many = model.pose_batch(&batch).unwrap();
        for (single, many) in [(&single.vertices, &many.vertices), (&single.joints, &many.joints)] {
            let single: Vec<f64> = single.iter().flat_map(|v| v.to_array()).map(f64::from).collect();
            assert!(largest_difference(&single, many.as_flattened()) < 1e-5, "{name}");
        }
    }
}

#[test]
fn families_are_told_by_their_arrays() {
    let named = |name: &str| family(name).0.skeleton().family.clone();
    assert_eq!(["smpl", "smplh", "smplx", "flame", "star"].map(named), ["SMPL", "SMPL+H", "SMPL-X", "FLAME", "STAR"]);
    assert!(named("mano").starts_with("MANO "));
}

#[test]
fn batches_that_do_not_fit_are_errors() {
    let (model, golden) = family("smpl");
    let mut wrong = batch(&golden);
    wrong.coefficients.pop();
    assert!(model.pose_batch(&wrong).unwrap_err().to_string().contains("coefficients is 49, expected 50"));
    let right = batch(&golden);
    let posed = model.pose_batch(&right).unwrap();
    assert!(posed.pullback(&model, &right, &[], &posed.joints).is_err());
}
