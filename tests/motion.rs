//! Motions as their sources store them (tests/golden/motions, made by make.py), and our own format.

use std::path::{Path, PathBuf};

use xavatar::Error;
use xavatar::body::{BodyParameters, HandPose, PoseAxisAngle};
use xavatar::data::{Array, ArrayMap, Motion, read_motion, read_npz, write_motion, write_npz};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/motions").join(name)
}

/// Component `column` of `poses` in make.py, in the given frame.
fn pose(frame: usize, column: usize) -> f32 {
    (((frame * 165 + column) % 97) as f32 - 48.0) / 100.0
}

fn assert_rotation(rotation: PoseAxisAngle, frame: usize, joint: usize) {
    for (axis, component) in rotation.0.to_array().into_iter().enumerate() {
        assert!((component - pose(frame, 3 * joint + axis)).abs() < 1e-6, "frame {frame}, joint {joint}");
    }
}

#[test]
fn amass_poses_are_joints_in_order_with_flat_hands() {
    let motion = read_motion(golden("amass.npz")).unwrap();
    assert_eq!(motion.frames_per_second, Some(120.0));
    assert_eq!(motion.zeroed, ["expression"]);
    assert_eq!(motion.frames.len(), 3);
    for (index, frame) in motion.frames.iter().enumerate() {
        assert_rotation(frame.global_orient, index, 0);
        assert_rotation(frame.body_pose[0], index, 1);
        assert_rotation(frame.body_pose[20], index, 21);
        assert_rotation(frame.jaw_pose, index, 22);
        assert_rotation(frame.left_eye_pose, index, 23);
        assert_rotation(frame.right_eye_pose, index, 24);
        let (HandPose::Flat(left), HandPose::Flat(right)) = (&frame.left_hand_pose, &frame.right_hand_pose) else {
            panic!("AMASS hands are absolute");
        };
        assert_rotation(left[0], index, 25);
        assert_rotation(right[14], index, 54);
        assert_eq!(frame.betas[9], 9.0 / 16.0);
        assert_eq!(frame.transl.to_array(), [0.0, 1.0, 2.0].map(|value| value + 3.0 * index as f32));
    }
}

#[test]
fn grab_keeps_its_pca_hands() {
    let motion = read_motion(golden("grab.npz")).unwrap();
    assert_eq!(motion.frames_per_second, Some(120.0));
    assert_eq!(motion.zeroed, ["betas"]);
    for (index, frame) in motion.frames.iter().enumerate() {
        assert_rotation(frame.global_orient, index, 0);
        assert_rotation(frame.body_pose[11], index, 12);
        assert_rotation(frame.right_eye_pose, index, 24);
        let (HandPose::Pca(left), HandPose::Pca(right)) = (&frame.left_hand_pose, &frame.right_hand_pose) else {
            panic!("GRAB hands are PCA coefficients");
        };
        assert_eq!(left.len(), 24);
        assert!((left[5] - (24 * index + 5) as f32 / 24.0).abs() < 1e-6);
        assert_eq!(right[5], -left[5]);
        assert!((frame.expression[3] - (10 * index + 3) as f32 / 10.0).abs() < 1e-6);
    }
}

#[test]
fn grab_without_hand_coefficients_takes_the_full_pose() {
    let mut arrays = read_npz(golden("grab.npz")).unwrap();
    arrays.retain(|name, _| !name.ends_with("_hand_pose"));
    let motion = read_copy(&arrays).unwrap();
    let HandPose::Flat(left) = &motion.frames[2].left_hand_pose else { panic!("fullpose is absolute") };
    assert_rotation(left[3], 2, 28);
}

#[test]
fn our_format_needs_only_the_body() {
    let motion = read_motion(golden("own.npz")).unwrap();
    assert_rotation(motion.frames[1].body_pose[4], 1, 5);
    assert_eq!(motion.frames[2].transl.to_array(), [6.0, 7.0, 8.0]);
    assert_eq!(motion.frames[2].betas[9], 9.0);
    assert_eq!(motion.frames[0].left_hand_pose, HandPose::Flat(Default::default()));
    assert!(motion.zeroed.contains(&"jaw_pose".into()) && motion.zeroed.contains(&"expression".into()));
    assert!(!motion.zeroed.contains(&"betas".into()));
}

#[test]
fn motions_survive_a_round_trip_in_every_hand_convention() {
    let amass = read_motion(golden("amass.npz")).unwrap();
    let grab = read_motion(golden("grab.npz")).unwrap();
    let mut relative = amass.clone();
    for frame in &mut relative.frames {
        for hand in [&mut frame.left_hand_pose, &mut frame.right_hand_pose] {
            let HandPose::Flat(joints) = hand.clone() else { panic!("AMASS hands are absolute") };
            *hand = HandPose::RelativeToMean(joints);
        }
    }
    relative.frames_per_second = None;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.npz");
    for motion in [amass, grab, relative] {
        write_motion(&path, &motion).unwrap();
        let read = read_motion(&path).unwrap();
        assert_eq!(read.frames, motion.frames);
        assert_eq!(read.frames_per_second, motion.frames_per_second);
        assert!(read.zeroed.is_empty());
    }
}

#[test]
fn hands_of_two_conventions_cannot_be_written() {
    let pca = BodyParameters { right_hand_pose: HandPose::Pca(vec![1.0]), ..Default::default() };
    let motion = |frames| Motion { frames, ..Motion::default() };
    let folder = tempfile::tempdir().unwrap();
    for frames in [vec![BodyParameters::default(), pca.clone()], vec![pca], vec![]] {
        let error = write_motion(folder.path().join("motion.npz"), &motion(frames)).unwrap_err();
        assert!(matches!(error, Error::Value { .. }), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_is_wrong_with_a_motion_is_named() {
    let amass = read_npz(golden("amass.npz")).unwrap();
    let own = read_npz(golden("own.npz")).unwrap();
    let with = |arrays: &ArrayMap, key: &str, array: Array| {
        let mut arrays = arrays.clone();
        arrays.insert(key.into(), array);
        read_copy(&arrays).unwrap_err().to_string()
    };
    let zeros = |rows: usize, columns: usize| Array::from_f32(&[rows, columns], vec![0.0; rows * columns]);

    assert!(with(&amass, "poses", zeros(3, 156)).contains("SMPL+H"));
    assert!(with(&amass, "trans", zeros(2, 3)).contains("2 rows"));
    assert!(with(&amass, "poses", zeros(0, 165)).contains("no rows"));
    assert!(with(&amass, "betas", zeros(1, 4)).contains("betas"));
    assert!(with(&amass, "trans", Array::from_f32(&[3, 3], vec![f32::NAN; 9])).contains("NaN"));
    assert!(with(&amass, "mocap_frame_rate", Array::from_f32(&[], vec![-1.0])).contains("-1"));
    assert!(with(&own, "left_hand_pose", zeros(3, 45)).contains("hand_convention"));
    assert!(with(&own, "hand_convention", Array::from_text("mean")).contains("relative_to_mean"));
    assert!(with(&own, "jaw_pose", Array::from_text("open")).contains("open"));
}

fn read_copy(arrays: &ArrayMap) -> xavatar::Result<Motion> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.npz");
    write_npz(&path, arrays).unwrap();
    read_motion(&path)
}
