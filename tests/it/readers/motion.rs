//! Motions as their sources store them (tests/golden/motions, made by make.py), and our own format.

use std::path::{Path, PathBuf};

use xavatar::InputError;
use xavatar::body::{HandPose, PoseAxisAngle, smplx};
use xavatar::data::{Clip, HandConvention, Motion, MotionOptions, Translation, UpAxis, read_motion, write_motion};
use xavatar::formats::{Array, ArrayMap, read_npz, write_npz};
use xavatar::synthetic::{DANCE, dance, load_clip};

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
        // An expression is read in the length that all have.
        let written = motion.frames.iter().cloned().map(|mut frame| {
            frame.expression.resize(smplx::EXPRESSIONS, 0.0);
            frame
        });
        assert_eq!(read.frames, written.collect::<Vec<_>>());
        assert_eq!(read.frames_per_second, motion.frames_per_second);
        // What no frame has stays unsaid.
        let has =
            |value: fn(&smplx::Parameters) -> &Vec<f32>| motion.frames.iter().any(|frame| !value(frame).is_empty());
        let said = [("betas", has(|frame| &frame.betas)), ("expression", has(|frame| &frame.expression))];
        let unsaid: Vec<_> = said.into_iter().filter(|(_, is_said)| !is_said).map(|(name, _)| name).collect();
        assert_eq!(read.zeroed, unsaid);
    }
}

#[test]
fn hands_of_two_conventions_cannot_be_written() {
    let pca = smplx::Parameters { right_hand_pose: HandPose::Pca(vec![1.0]), ..Default::default() };
    let motion = |frames| Motion { frames, ..Motion::default() };
    let folder = tempfile::tempdir().unwrap();
    for frames in [vec![smplx::Parameters::default(), pca.clone()], vec![pca], vec![]] {
        let error = write_motion(folder.path().join("motion.npz"), &motion(frames)).unwrap_err();
        assert!(matches!(error, InputError::Value { .. }), "{error}");
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

    assert!(with(&amass, "poses", zeros(3, 150)).contains("156 (SMPL+H)"));
    assert!(with(&amass, "trans", zeros(2, 3)).contains("2 rows"));
    assert!(with(&amass, "poses", zeros(0, 165)).contains("no rows"));
    assert!(with(&amass, "betas", zeros(1, 4)).contains("betas"));
    assert!(with(&amass, "trans", Array::from_f32(&[3, 3], vec![f32::NAN; 9])).contains("NaN"));
    assert!(with(&amass, "mocap_frame_rate", Array::from_f32(&[], vec![-1.0])).contains("-1"));
    assert!(with(&own, "left_hand_pose", zeros(3, 45)).contains("hand_convention"));
    assert!(with(&own, "hand_convention", Array::from_text("mean")).contains("relative_to_mean"));
    assert!(with(&own, "jaw_pose", Array::from_text("open")).contains("open"));
}

// The layout of AMASS's files of SMPL+H: 22 joints of the body, then 15 of each hand; of SMPL: 22 and two more.
#[test]
fn motions_of_smpl_and_smplh_are_read_with_what_they_have() {
    let amass = read_npz(golden("amass.npz")).unwrap();
    let values = |width: usize| (0..3 * width).map(|at| pose(at / width, at % width)).collect();
    let read = |width: usize| {
        let mut arrays = amass.clone();
        arrays.insert("poses".into(), Array::from_f32(&[3, width], values(width)));
        read_copy(&arrays).unwrap()
    };
    let (smplh, smpl) = (read(156), read(72));
    for (index, (with_hands, without)) in smplh.frames.iter().zip(&smpl.frames).enumerate() {
        for frame in [with_hands, without] {
            assert_rotation(frame.global_orient, index, 0);
            assert_rotation(frame.body_pose[20], index, 21);
            assert_eq!((frame.jaw_pose, frame.betas.len()), Default::default());
            // Another template: SMPL's pelvis is 0.23 m below its origin, SMPL-X's 0.35 m.
            assert!((frame.transl - glam::Vec3::new(0.0, 1.12, 2.028) - 3.0 * index as f32).length() < 1e-5);
        }
        let HandPose::Flat(right) = &with_hands.right_hand_pose else { panic!("AMASS hands are absolute") };
        assert_rotation(right[14], index, 51);
        assert_eq!(without.right_hand_pose, HandPose::Flat(Default::default()));
    }
    assert!(smpl.notes[0].contains("hands are flat") && smpl.notes[0].contains("face is neutral"), "{:?}", smpl.notes);
    assert!(smplh.notes[0].contains("156") && !smplh.zeroed.contains(&"left_hand_pose".into()));
    assert!(smpl.zeroed.contains(&"left_hand_pose".into()) && smpl.zeroed.contains(&"jaw_pose".into()));
}

// A file of SMPLer-X is one frame, its body (21, 3), in camera coordinates.
#[test]
fn pose_estimates_by_name_are_read() {
    let motion = read_motion(golden("smpler_x.npz")).unwrap();
    assert_eq!((motion.frames.len(), motion.up, motion.frames_per_second), (1, UpAxis::MinusY, None));
    let frame = &motion.frames[0];
    assert_rotation(frame.body_pose[0], 1, 1);
    assert_rotation(frame.jaw_pose, 1, 22);
    let HandPose::RelativeToMean(right) = &frame.right_hand_pose else { panic!("smplx's default") };
    assert_rotation(right[14], 1, 54);
    assert_eq!((frame.betas[9], frame.transl.to_array()), (9.0, [3.0, 4.0, 5.0]));
    let clip = Clip::of(motion, &MotionOptions::default()).unwrap();
    assert!(clip.frames[0].global_orient.0.length() < 1e-5, "upright");
    assert!(clip.report.iter().any(|line| line.contains("up axis: Y-down")), "{:?}", clip.report);
}

// PyMAF-X: two batches of rotation matrices, in joblib's pickle.
#[test]
fn rotation_matrices_become_the_vectors_they_were_made_of() {
    let motion = read_motion(golden("pymaf_x.pkl")).unwrap();
    assert_eq!((motion.frames.len(), motion.up), (3, UpAxis::MinusY));
    for (index, frame) in motion.frames.iter().enumerate() {
        assert_rotation(frame.body_pose[20], index, 21);
        assert_rotation(frame.right_eye_pose, index, 24);
        let HandPose::Flat(left) = &frame.left_hand_pose else { panic!("matrices are absolute") };
        assert_rotation(left[0], index, 25);
        assert!((frame.global_orient.0.x.abs() - std::f32::consts::PI).abs() < 1e-5);
    }
    assert_eq!(motion.zeroed, ["transl"]);
}

#[test]
fn what_is_wrong_with_an_estimate_is_named() {
    let estimate = read_npz(golden("smpler_x.npz")).unwrap();
    let with = |key: &str, array: Array| {
        let mut arrays = estimate.clone();
        arrays.insert(key.into(), array);
        read_copy(&arrays).unwrap_err().to_string()
    };
    let zeros = |shape: &[usize]| Array::from_f32(shape, vec![0.0; shape.iter().product()]);
    assert!(with("body_pose", zeros(&[20, 3])).contains("21 joints"));
    assert!(with("body_pose", zeros(&[0, 63])).contains("21 joints"));
    assert!(with("body_pose", zeros(&[1, 21, 3, 3])).contains("rotation matrices"));
    assert!(with("left_hand_pose", zeros(&[46])).contains("PCA"));
    assert!(with("jaw_pose", zeros(&[2, 3])).contains("3 numbers"));
    assert!(with("expression", zeros(&[1, 5])).contains("10 or more"));
    assert!(with("transl", Array::from_f32(&[3], vec![0.0, f32::NAN, 0.0])).contains("NaN"));
    assert!(with("fps", Array::from_f32(&[], vec![0.0])).contains("positive"));
}

#[test]
fn a_folder_of_one_file_a_frame_is_read_in_order_and_for_one_person() {
    let folder = tempfile::tempdir().unwrap();
    let mut estimate = read_npz(golden("smpler_x.npz")).unwrap();
    for (name, x) in [("00009_0", 0.0), ("00010_0", 1.0), ("00100_0", 2.0), ("00010_1", 7.0)] {
        estimate.insert("transl".into(), Array::from_f32(&[1, 3], vec![x, 0.0, 0.0]));
        write_npz(folder.path().join(format!("{name}.npz")), &estimate).unwrap();
    }
    let motion = read_motion(folder.path()).unwrap();
    assert_eq!(motion.frames.iter().map(|frame| frame.transl.x).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
    assert!(motion.notes.iter().any(|note| note.contains("2 people")), "{:?}", motion.notes);
}

#[test]
fn a_file_in_no_format_is_told_why_for_each() {
    let folder = tempfile::tempdir().unwrap();
    let message = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = read_motion(&path).unwrap_err();
        assert!(matches!(error, InputError::Unrecognised { .. }), "{error}");
        error.to_string()
    };
    for bytes in [&b""[..], b"frame,x,y\n", b"BVH"] {
        let message = message("walk.csv", bytes);
        assert!(
            ["walk.csv", "npz", "pickle", "BVH", "HIERARCHY", "docs/motion.md"]
                .iter()
                .all(|word| message.contains(word))
        );
    }
    let path = folder.path().join("weights.npz");
    write_npz(&path, &ArrayMap::from([("lin0".into(), Array::from_f32(&[1], vec![0.0]))])).unwrap();
    let message = read_motion(&path).unwrap_err().to_string();
    for word in
        ["lin0", "`body_pose`", "`poses`", "body.params", "X-Humans", "AMASS", "GRAB", "body parameters by name", "BVH"]
    {
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn declared_options_are_followed_and_reported() {
    let options = MotionOptions {
        up: Some(UpAxis::Y),
        hands: Some(HandConvention::RelativeToMean),
        source_rate: Some(60.0),
        rate: Some(30.0),
        frames: Some((1, Some(3))),
        translation: Translation::FromOrigin,
        ..Default::default()
    };
    let clip = Clip::load(&golden("amass.npz"), &options).unwrap();
    assert_eq!((clip.frames.len(), clip.frames_per_second), (2, 30.0));
    assert_rotation(clip.frames[1].body_pose[0], 2, 1);
    assert!(matches!(clip.frames[0].left_hand_pose, HandPose::RelativeToMean(_)));
    assert_eq!(clip.frames[1].transl.to_array(), [6.0, 7.0, 6.0]);
    let report = clip.report.join("\n");
    for line in
        ["AMASS", "frame rate: 60 per second (declared)", "up axis: Y (declared)", "hands: relative", "2 frames at 30"]
    {
        assert!(report.contains(line), "{report}");
    }
    let refused = |options: MotionOptions| Clip::load(&golden("amass.npz"), &options).unwrap_err().to_string();
    assert!(refused(MotionOptions { frames: Some((2, Some(9))), ..Default::default() }).contains("within 1..3"));
    assert!(refused(MotionOptions { rate: Some(f32::NAN), ..Default::default() }).contains("positive"));
    let grab = MotionOptions { hands: Some(HandConvention::Flat), ..Default::default() };
    assert!(Clip::load(&golden("grab.npz"), &grab).unwrap_err().to_string().contains("24 numbers"));
}

#[test]
fn the_dance_is_there_by_name() {
    assert_eq!(load_clip(Path::new(DANCE), &MotionOptions::default()).unwrap().frames, dance().frames);
    assert_eq!(dance().seconds(), 2.4);
}

fn read_copy(arrays: &ArrayMap) -> xavatar::formats::Result<Motion> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.npz");
    write_npz(&path, arrays).unwrap();
    read_motion(&path)
}
