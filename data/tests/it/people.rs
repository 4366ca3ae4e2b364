//! Estimators of the people in pictures: who is who, and how their files lie.

use glam::Vec3;
use serde_json::{Value, json};
use xavatar_body::HandPose;
use xavatar_data::{RestPose, UpAxis};

use crate::layouts::{SMPL_PELVIS, assert_body, matrix, nested, pose, says, vector};

// A dict a picture, in it lists over the people, whom `tid` tells apart.
#[test]
fn people_of_4d_humans_are_followed_through_the_pictures() {
    let smpl = |seed: usize| {
        let pose = pose(seed, 24);
        let matrices: Vec<Value> = (1..24).map(|joint| matrix(vector(&pose, joint))).collect();
        json!({"global_orient": [matrix(vector(&pose, 0))], "body_pose": matrices, "betas": vec![0.0; 10]})
    };
    let picture = |people: &[(usize, usize)]| {
        json!({
            "tid": people.iter().map(|(id, _)| *id).collect::<Vec<_>>(),
            "camera": people.iter().map(|(_, seed)| vec![*seed as f32, 0.0, 9.0]).collect::<Vec<_>>(),
            "smpl": people.iter().map(|(_, seed)| smpl(*seed)).collect::<Vec<_>>(),
        })
    };
    let motion = nested(&json!({
        "outputs//_DEMO/walk/img/000010.jpg": picture(&[(7, 1), (3, 5)]),
        "outputs//_DEMO/walk/img/000009.jpg": picture(&[(7, 0)]),
        "outputs//_DEMO/walk/img/000011.jpg": picture(&[(3, 6), (7, 2)]),
    }))
    .unwrap();
    assert_eq!((motion.frames.len(), motion.up, motion.up_is_certain), (3, UpAxis::MinusY, true));
    assert!(motion.source.contains("4D-Humans") && says(&motion.notes, "person 3 (2 frames)"), "{:?}", motion.notes);
    for (seed, frame) in motion.frames.iter().enumerate() {
        let pose = pose(seed, 24);
        assert_body(frame, &pose, vector(&pose, 0));
        let expected = Vec3::new(seed as f32, 0.0, 9.0) + SMPL_PELVIS - RestPose::default().pelvis();
        assert!((frame.transl - expected).length() < 1e-5);
    }
}

// An npz a picture of all people in it; the video's has each in a track of its own.
#[test]
fn people_of_romp_are_told_apart() {
    let people = |seeds: &[usize]| {
        json!({
            "cam": seeds.iter().map(|seed| vec![*seed as f32, 0.0, 0.0]).collect::<Vec<_>>(),
            "center_confs": vec![1.0; seeds.len()],
            "cam_trans": seeds.iter().map(|seed| vec![0.0, 0.0, *seed as f32]).collect::<Vec<_>>(),
            "smpl_thetas": seeds.iter().map(|seed| pose(*seed, 24)).collect::<Vec<_>>(),
        })
    };
    let motion = nested(&json!({"results": people(&[1, 4, 2])})).unwrap();
    assert_eq!(motion.frames.len(), 1);
    assert_body(&motion.frames[0], &pose(4, 24), vector(&pose(4, 24), 0));
    assert!(motion.source.contains("ROMP") && says(&motion.notes, "the largest is read"), "{:?}", motion.notes);
    let motion = nested(&json!({
        "results": {"00000000.png": people(&[1, 4]), "00000001.png": people(&[5])},
        "sequence_results": {"1": people(&[1, 5, 6]), "2": people(&[4])},
    }))
    .unwrap();
    assert_eq!(motion.frames.len(), 3);
    assert_body(&motion.frames[2], &pose(6, 24), vector(&pose(6, 24), 0));
}

// An array a parameter over the pictures; matrices as 216 numbers. Places are of the whole picture's camera, where the file has both.
#[test]
fn hybrik_has_matrices_and_two_cameras() {
    let flat = |seed: usize| -> Vec<Value> {
        let pose = pose(seed, 24);
        (0..24).map(|joint| matrix(vector(&pose, joint))).flat_map(|rows| numbers(&rows)).collect()
    };
    let motion = nested(&json!({
        "pred_thetas": (0..3).map(flat).collect::<Vec<_>>(),
        "pred_betas": vec![vec![0.0; 10]; 3],
        "pred_camera": vec![vec![0.9, 0.0, 0.0]; 3],
        "transl": vec![[0.0, 0.0, 2.0]; 3],
        "transl_camsys": [[0.0, 0.0, 5.0], [0.0, 0.0, 6.0], [0.0, 0.0, 7.0]],
        "bbox": vec![[0.0, 0.0, 1.0, 1.0]; 3],
    }))
    .unwrap();
    assert_eq!((motion.frames.len(), motion.up, motion.up_is_certain), (3, UpAxis::MinusY, true));
    assert!(motion.source.contains("HybrIK"), "{}", motion.source);
    for (seed, frame) in motion.frames.iter().enumerate() {
        let pose = pose(seed, 24);
        assert_body(frame, &pose, vector(&pose, 0));
        let expected = Vec3::new(0.0, 0.0, 5.0 + seed as f32) + SMPL_PELVIS - RestPose::default().pelvis();
        assert!((frame.transl - expected).length() < 1e-5);
    }
}

/// The numbers of nested lists.
fn numbers(value: &Value) -> Vec<Value> {
    value.as_array().map_or_else(|| vec![value.clone()], |items| items.iter().flat_map(numbers).collect())
}

// All joints of SMPL-X in one array, the hands' relative to the mean hand, beside AMASS's names; in the world, Y up.
#[test]
fn beat2_has_hands_relative_to_the_mean_hand() {
    let poses: Vec<Vec<f32>> = (0..2).map(|seed| pose(seed, 55)).collect();
    let expressions: Vec<Vec<f32>> =
        (0..2).map(|frame| (0..100).map(|at| (frame * 100 + at) as f32).collect()).collect();
    let motion = nested(&json!({
        "betas": (0..300).map(|at| at as f32).collect::<Vec<_>>(),
        "poses": poses,
        "expressions": expressions,
        "trans": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        "model": "smplx2020",
        "gender": "neutral",
        "mocap_frame_rate": 30,
    }))
    .unwrap();
    assert_eq!((motion.up, motion.up_is_certain, motion.frames_per_second), (UpAxis::Y, true, Some(30.0)));
    assert!(motion.source.contains("BEAT2"), "{}", motion.source);
    let frame = &motion.frames[1];
    assert_body(frame, &poses[1], vector(&poses[1], 0));
    let HandPose::RelativeToMean(right) = &frame.right_hand_pose else { panic!("relative to the mean hand") };
    assert!((right[14].0 - vector(&poses[1], 54)).length() < 1e-6 && frame.jaw_pose.0 == vector(&poses[1], 22));
    assert_eq!((frame.betas[9], frame.expression[9], frame.transl), (9.0, 109.0, Vec3::new(3.0, 4.0, 5.0)));
}

// A code of VPoser beside the decoded body; hands as coefficients.
#[test]
fn show_has_its_body_twice() {
    let pose = pose(2, 22);
    let motion = nested(&json!({
        "body_pose": [vec![0.0; 32]],
        "body_pose_axis": [&pose[3..]],
        "global_orient": [&pose[..3]],
        "left_hand_pose": [vec![0.5; 12]],
        "right_hand_pose": [vec![0.25; 12]],
        "expression": [vec![0.0; 100]],
    }))
    .unwrap();
    assert_body(&motion.frames[0], &pose, vector(&pose, 0));
    assert_eq!(motion.frames[0].right_hand_pose, HandPose::Pca(vec![0.25; 12]));
}
