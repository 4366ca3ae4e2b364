//! Every family against double-precision references: vertices, joints, and the gradient of a function of both.
//!
//! The references hold loss = sum c_vertices . vertices + sum c_joints . joints and its derivatives by pose, coefficients, translation.

use std::collections::HashMap;

use xavatar_body::{
    BodyModel, Coefficients, ConstrainedBatch, Gender, HandPose, HingeConvention, JointConstraints, JointFreedom,
    Limits, PoseAxisAngle, PoseBatch, mano,
};
use xavatar_formats::{Array, ArrayData, ArrayMap, read_npz};

use super::reference::{golden, numbers};

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
    (model, numbers(&format!("forward_{name}")))
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
    use xavatar_body::Pose;
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

#[test]
fn supr_is_read_from_its_npy_and_agrees_with_the_reference() {
    let model = BodyModel::load(&golden("tiny_supr.npy"), Gender::Neutral).unwrap();
    assert_eq!((model.skeleton().family.as_str(), model.correctives().count()), ("SUPR", 4 * 12));
    let golden = numbers("forward_supr");
    let batch = batch(&golden);
    let posed = model.pose_batch(&batch).unwrap();
    assert!(largest_difference(posed.vertices.as_flattened(), &golden["vertices"]) < 1e-12);
    assert!(largest_difference(posed.joints.as_flattened(), &golden["joints"]) < 1e-12);
    let vertices = triples(&golden["c_vertices"]).repeat(batch.frames());
    let joints = triples(&golden["c_joints"]).repeat(batch.frames());
    let cotangent = posed.pullback(&model, &batch, &vertices, &joints).unwrap();
    assert!(largest_difference(cotangent.rotations.as_flattened(), &golden["d_pose"]) < 1e-10);
    assert!(largest_difference(&cotangent.coefficients, &golden["d_coefficients"]) < 1e-10);
}

// hand = mean + pca components, as MANO's files mean it.
#[test]
fn hands_in_components_are_resolved_with_their_model() {
    let (model, _) = family("mano");
    let golden = numbers("forward_mano_pca");
    let row = |name: &str, frame: usize, width: usize| -> Vec<f32> {
        golden[name][frame * width..(frame + 1) * width].iter().map(|value| *value as f32).collect()
    };
    let vector = |name: &str, frame: usize| glam::Vec3::from_slice(&row(name, frame, 3));
    for frame in 0..3 {
        let parameters = mano::Parameters {
            betas: row("betas", frame, 10),
            global_orient: PoseAxisAngle(vector("global_orient", frame)),
            hand_pose: HandPose::Pca(row("pca", frame, 6)),
            transl: vector("transl", frame),
        };
        let pose = model.resolve(&parameters.into()).unwrap();
        let found = model.pose(&pose).unwrap();
        let found: Vec<f64> = found.vertices.iter().flat_map(|vertex| vertex.to_array()).map(f64::from).collect();
        assert!(largest_difference(&found, &golden["vertices"][frame * 120..(frame + 1) * 120]) < 1e-5);
    }
}

#[test]
fn shapes_that_were_not_mirrored_with_a_left_hand_are_known_and_mended() {
    let (right, _) = family("mano");
    let path = golden("tiny_mano.npz");
    let read = |arrays: &ArrayMap| BodyModel::from_arrays(&path, arrays).unwrap();
    let mut arrays = read_npz(&path).unwrap();
    // A hand that grows, and its mirror image.
    let template = arrays["v_template"].to_f64().unwrap();
    let columns = arrays["shapedirs"].shape[2];
    let mut shapes = arrays["shapedirs"].to_f64().unwrap();
    for (at, value) in template.iter().enumerate() {
        shapes[at * columns] = 0.1 * value;
    }
    let set = |arrays: &mut ArrayMap, key: &str, values: Vec<f64>| {
        let shape = arrays[key].shape.clone();
        arrays.insert(key.into(), Array { shape, data: ArrayData::F64(values) });
    };
    set(&mut arrays, "shapedirs", shapes);
    assert!(!mano::has_unmirrored_shapes(&read(&arrays)));
    let mirrored = template.iter().enumerate().map(|(at, value)| if at % 3 == 0 { -value } else { *value }).collect();
    set(&mut arrays, "v_template", mirrored);
    let left = read(&arrays);
    assert_ne!(left.skeleton().family, right.skeleton().family);
    assert!(mano::has_unmirrored_shapes(&left));
    let mended = mano::with_mirrored_shapes(arrays).unwrap();
    assert!(!mano::has_unmirrored_shapes(&read(&mended)));
}

/// The constrained reference in a convention: vertices and the cotangents of the pose's numbers.
fn constrained_agrees(convention: HingeConvention, name: &str) {
    let path = golden("tiny_supr_constrained.npy");
    let arrays = BodyModel::read_arrays(&path).unwrap();
    let model = BodyModel::from_arrays(&path, &arrays).unwrap();
    let constraints = JointConstraints::of_supr(&arrays).unwrap().unwrap().in_convention(convention);
    assert_eq!((constraints.numbers(), constraints.joints().len()), (25, 12));
    let golden = numbers("constrained");
    let batch = ConstrainedBatch {
        numbers: golden["pose"].clone(),
        coefficients: golden["coefficients"].clone(),
        translations: triples(&golden["transl"]),
    };
    let posed = model.pose_constrained(&constraints, &batch).unwrap();
    let far = largest_difference(posed.vertices.as_flattened(), &golden[&format!("{name}.vertices")]);
    assert!(far < 1e-12, "{name}: {far}");
    let vertices = triples(&golden[&format!("{name}.c_vertices")]).repeat(5);
    let joints = vec![[0.0; 3]; posed.joints.len()];
    let cotangent = posed.pullback_constrained(&model, &constraints, &batch, &vertices, &joints).unwrap();
    let far = largest_difference(&cotangent.numbers, &golden[&format!("{name}.d_pose")]);
    assert!(far < 1e-10, "{name}: {far}");
}

#[test]
fn hinges_agree_with_the_reference_in_both_conventions() {
    constrained_agrees(HingeConvention::Released, "released");
    constrained_agrees(HingeConvention::RightHanded, "right_handed");
}

#[test]
fn constraints_that_leave_a_number_open_are_errors() {
    let hinge = |number: usize, axis: [f64; 3]| JointFreedom::Hinge(number, axis);
    let new = |joints: &[JointFreedom]| JointConstraints::new(joints.into(), HingeConvention::RightHanded);
    assert!(new(&[hinge(0, [1.0, 0.0, 0.0]), hinge(1, [0.0, 1.0, 0.0])]).is_ok());
    for (joints, words) in [
        ([hinge(0, [1.0, 0.0, 0.0]), hinge(0, [0.0, 1.0, 0.0])], "once"),
        ([hinge(0, [2.0, 0.0, 0.0]), hinge(1, [0.0, 1.0, 0.0])], "unit"),
    ] {
        assert!(new(&joints).unwrap_err().to_string().contains(words));
    }
    let (model, _) = family("smpl");
    assert!(JointConstraints::of_supr(&read_npz(golden("tiny_smpl.npz")).unwrap()).unwrap().is_none());
    let batch = ConstrainedBatch { numbers: vec![0.0; 2], coefficients: vec![0.0; 10], translations: vec![[0.0; 3]] };
    let constraints = new(&[hinge(0, [1.0, 0.0, 0.0]), hinge(1, [0.0, 1.0, 0.0])]).unwrap();
    assert!(
        model
            .pose_constrained(&constraints, &batch)
            .unwrap_err()
            .to_string()
            .contains("constrained joints is 2, expected 24")
    );
}

// d theta / d x of a bounded angle.
#[test]
fn limits_hold_and_have_their_slopes() {
    let limits = Limits { low: vec![-1.0, 0.0], high: vec![0.5, 2.5] };
    let x = [0.3, -2.0, 40.0, -40.0];
    let angles = limits.angles(&x);
    assert!(angles.iter().enumerate().all(|(at, angle)| (limits.low[at % 2]..=limits.high[at % 2]).contains(angle)));
    let slopes = limits.pullback(&x, &[1.0; 4]);
    for (at, step) in [(0, 1e-6), (1, 1e-6)] {
        let moved = |by: f64| {
            limits.angles(&[x[0] + if at == 0 { by } else { 0.0 }, x[1] + if at == 1 { by } else { 0.0 }])[at]
        };
        assert!(((moved(step) - moved(-step)) / (2.0 * step) - slopes[at]).abs() < 1e-8);
    }
}

#[test]
fn a_model_written_in_the_common_layout_reads_as_itself() {
    for name in ["smpl", "smplh", "smplx", "mano", "flame", "star"] {
        let (model, golden) = family(name);
        let written = BodyModel::from_arrays_with(model.path(), &model.to_arrays(), Coefficients::All).unwrap();
        assert_eq!(written.skeleton().joints, model.skeleton().joints, "{name}");
        assert_eq!(written.expression_coefficients(), model.expression_coefficients(), "{name}");
        assert_eq!(written.hands().len(), if name == "mano" { 0 } else { model.hands().len() }, "{name}");
        let batch = batch(&golden);
        let posed = written.pose_batch(&batch).unwrap();
        let difference = largest_difference(posed.vertices.as_flattened(), &golden["vertices"]);
        assert!(difference < 1e-5, "{name}: {difference}");
    }
}
