//! The body model against float64 vectors of PyPI smplx, and what must hold for any model.

use std::path::Path;

use glam::{Affine3A, Vec3};
use safetensors::SafeTensors;
use xavatar::body::smplx::{self, joint};
use xavatar::body::{BodyModel, Gender, HandPose, Pose, PoseAxisAngle, mano};

const FRAMES: usize = 6;

fn golden(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

fn model() -> BodyModel {
    BodyModel::load(&golden("tiny_smplx.npz"), Gender::Neutral).unwrap()
}

/// The rows of a (6, ...) float64 tensor.
fn rows(tensors: &SafeTensors, name: &str) -> Vec<Vec<f32>> {
    let tensor = tensors.tensor(name).unwrap();
    let values: Vec<f32> =
        tensor.data().chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()) as f32).collect();
    values.chunks_exact(values.len() / FRAMES).map(<[f32]>::to_vec).collect()
}

fn points(row: &[f32]) -> Vec<Vec3> {
    row.chunks_exact(3).map(Vec3::from_slice).collect()
}

fn poses<const N: usize>(row: &[f32]) -> [PoseAxisAngle; N] {
    std::array::from_fn(|joint| PoseAxisAngle(Vec3::from_slice(&row[joint * 3..])))
}

fn parameters(tensors: &SafeTensors) -> Vec<smplx::Parameters> {
    let tensor = |name| rows(tensors, name);
    let [betas, expression, global, body] = ["betas", "expression", "global_orient", "body_pose"].map(tensor);
    let [jaw, left_eye, right_eye] = ["jaw_pose", "leye_pose", "reye_pose"].map(tensor);
    let [left_hand, right_hand, transl] = ["left_hand_pose", "right_hand_pose", "transl"].map(tensor);
    (0..FRAMES)
        .map(|frame| smplx::Parameters {
            betas: betas[frame].clone(),
            expression: expression[frame].clone(),
            global_orient: PoseAxisAngle(Vec3::from_slice(&global[frame])),
            body_pose: poses(&body[frame]),
            jaw_pose: PoseAxisAngle(Vec3::from_slice(&jaw[frame])),
            left_eye_pose: PoseAxisAngle(Vec3::from_slice(&left_eye[frame])),
            right_eye_pose: PoseAxisAngle(Vec3::from_slice(&right_eye[frame])),
            left_hand_pose: HandPose::RelativeToMean(poses(&left_hand[frame])),
            right_hand_pose: HandPose::RelativeToMean(poses(&right_hand[frame])),
            transl: Vec3::from_slice(&transl[frame]),
        })
        .collect()
}

/// The poses of the golden parameters.
fn golden_poses(model: &BodyModel, tensors: &SafeTensors) -> Vec<Pose> {
    parameters(tensors).into_iter().map(|parameters| model.resolve(&parameters.into()).unwrap()).collect()
}

fn assert_close(found: &[Vec3], expected: &[Vec3], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((*found - *expected).length() < tolerance, "point {index}: {found} instead of {expected}");
    }
}

#[test]
fn vertices_joints_and_bone_transforms_match_smplx() {
    let bytes = std::fs::read(golden("body_smplx.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let model = model();
    let [vertices, joints, transforms] = ["vertices", "joints", "bone_transforms"].map(|name| rows(&tensors, name));
    for (frame, pose) in golden_poses(&model, &tensors).iter().enumerate() {
        let body = model.pose(pose).unwrap();
        assert_close(&body.vertices, &points(&vertices[frame]), 1e-5);
        assert_close(&body.joints, &points(&joints[frame]), 1e-5);
        for (found, expected) in body.bone_transforms.iter().zip(transforms[frame].chunks_exact(16)) {
            for axis in 0..3 {
                for column in 0..4 {
                    let entry = if column < 3 { found.matrix3.col(column)[axis] } else { found.translation[axis] };
                    assert!((entry - expected[axis * 4 + column]).abs() < 1e-5, "frame {frame}");
                }
            }
        }
    }
}

// The three hand conventions of one pose: flat = mean + relative = mean + pca . components
#[test]
fn hand_conventions_agree() {
    let model = model();
    let resolved =
        |pose: HandPose| model.resolve(&smplx::Parameters { left_hand_pose: pose, ..Default::default() }.into());
    let posed = |pose: HandPose| model.pose(&resolved(pose).unwrap()).unwrap();
    let relaxed = posed(HandPose::RelativeToMean(Default::default()));
    assert_close(&relaxed.vertices, &posed(HandPose::Pca(vec![])).vertices, 1e-7);
    let moved = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).any(|(a, b)| a.distance(*b) > 1e-2);
    assert!(moved(&relaxed.vertices, &posed(HandPose::default()).vertices));
    assert!(moved(&relaxed.vertices, &posed(HandPose::Pca(vec![0.7, -0.4])).vertices));
    assert_eq!(
        resolved(HandPose::Pca(vec![0.0; 46])).unwrap_err().to_string(),
        "left_hand_pose is 46 PCA coefficients, expected at most 45, the components of the model"
    );
}

// x_posed = sum_i w_i B_i G_i(canonical) (template + shape + offsets): the deformer's route gives the posed body.
#[test]
fn the_canonical_route_gives_the_posed_body() {
    let bytes = std::fs::read(golden("body_smplx.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let model = model();
    for pose in golden_poses(&model, &tensors) {
        let to_posed = model.canonical_to_posed(&pose).unwrap();
        let body = model.pose(&pose).unwrap();
        let canonical = model.skeleton().canonical_pose(&pose.shape);
        let from_rest = model.pose(&canonical).unwrap().bone_transforms;
        for ((to_posed, from_rest), whole) in to_posed.iter().zip(&from_rest).zip(&body.bone_transforms) {
            assert!((*to_posed * *from_rest).abs_diff_eq(*whole, 2e-5));
        }
        let unmoved = model.canonical_to_posed(&canonical).unwrap();
        assert!(unmoved.iter().all(|transform| transform.abs_diff_eq(Affine3A::IDENTITY, 1e-5)));
    }
}

// Where canonical space is bent makes no difference to what is posed from it.
#[test]
fn another_canonical_pose_leads_to_the_same_posed_body() {
    let bytes = std::fs::read(golden("body_smplx.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let model = model();
    let bowed = model.in_canonical_pose_of(&model.skeleton().bowed(0.6)).unwrap();
    let moved: Vec<bool> = (model.canonical_joints(&[]).unwrap().iter())
        .zip(bowed.canonical_joints(&[]).unwrap())
        .map(|(plain, bowed)| plain.distance(bowed) > 1e-4)
        .collect();
    assert!(moved[joint::JAW] && !moved[joint::NECK] && !moved[joint::LEFT_WRIST]);
    for pose in golden_poses(&model, &tensors) {
        let whole = model.pose(&pose).unwrap().bone_transforms;
        let canonical = bowed.skeleton().canonical_pose(&pose.shape);
        let from_rest = model.pose(&canonical).unwrap().bone_transforms;
        let to_posed = bowed.canonical_to_posed(&pose).unwrap();
        for ((to_posed, from_rest), whole) in to_posed.iter().zip(&from_rest).zip(&whole) {
            assert!((*to_posed * *from_rest).abs_diff_eq(*whole, 2e-5));
        }
    }
    assert!(model.in_canonical_pose_of(&mano::skeleton("left")).is_err(), "a hand has no such pose");
}

// Offsets are what pose() adds before skinning; with none, the canonical vertices are the canonical body.
#[test]
fn offsets_account_for_all_that_posing_adds() {
    let model = model();
    let shape = [0.5, -1.0, 0.3, 0.0, 0.0, 1.0, 0.0, 0.2];
    let plain = model.canonical_vertices(&shape, &[]).unwrap();
    let smile = vec![0.0, 0.0, 1.5];
    let smiling = model.canonical_vertices(&shape, &smile).unwrap();
    let canonical = Pose { expression: smile.clone(), ..model.skeleton().canonical_pose(&shape) };
    let offsets = model.vertex_offsets(&canonical).unwrap();
    let resting = Pose { expression: smile, ..model.skeleton().rest_pose().in_shape(&shape) };
    let expression = model.vertex_offsets(&resting).unwrap();
    assert!(offsets.iter().zip(&expression).any(|(both, expression)| both.distance(*expression) > 1e-3));
    let moved = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    // Skinning keeps lengths where one bone dominates and shortens them where bones disagree, never the other way.
    assert!(moved(&plain, &smiling) <= expression.iter().map(|offset| offset.length()).fold(0.0, f32::max) + 1e-5);
    assert!(moved(&plain, &smiling) > 1e-3);
    let rest = model.pose(&model.skeleton().rest_pose().in_shape(&shape)).unwrap().vertices;
    let with_expression = model.pose(&resting).unwrap().vertices;
    let sum: Vec<Vec3> = rest.iter().zip(&expression).map(|(vertex, offset)| *vertex + *offset).collect();
    assert_close(&with_expression, &sum, 1e-5);
}

// Turning the root turns everything about the root's rest position; translation only adds.
#[test]
fn global_motion_is_rigid() {
    let model = model();
    let mut pose = model.skeleton().canonical_pose(&[0.3; 10]);
    let still = model.pose(&pose).unwrap();
    let turn = glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
    pose.rotations[0] = PoseAxisAngle(turn.to_scaled_axis());
    pose.translation = Vec3::new(0.1, -2.0, 3.0);
    let moved = model.pose(&pose).unwrap();
    let root = still.joints[0];
    let expected: Vec<Vec3> =
        still.vertices.iter().map(|vertex| root + turn * (*vertex - root) + pose.translation).collect();
    assert_close(&moved.vertices, &expected, 1e-5);
}

#[test]
fn what_is_no_pose_of_the_model_is_refused() {
    let model = model();
    let message = |change: fn(&mut Pose)| {
        let mut pose = model.skeleton().rest_pose();
        change(&mut pose);
        model.pose(&pose).unwrap_err().to_string()
    };
    let not_finite = message(|pose| pose.rotations[5].0.y = f32::NAN);
    assert_eq!(not_finite, "the rotation of right_knee is [0, NaN, 0], expected finite");
    assert!(message(|pose| pose.translation.x = f32::INFINITY).contains("the translation is [inf, 0, 0]"));
    assert!(message(|pose| pose.shape = vec![f32::NAN]).contains("shape is NaN, expected finite"));
    assert_eq!(
        message(|pose| pose.expression = vec![0.0; 11]),
        "expression is 11 coefficients, expected at most the body's 10"
    );
    assert_eq!(
        message(|pose| pose.rotations.truncate(24)),
        "the pose is 24 rotations, expected 55, for the SMPL-X skeleton (55 joints)"
    );
}

#[test]
fn parameters_of_another_skeleton_are_refused() {
    let model = model();
    let short = Pose { rotations: vec![PoseAxisAngle::default(); 24], ..Pose::default() };
    assert!(model.resolve(&short.into()).unwrap_err().to_string().contains("24 rotations"));
}
