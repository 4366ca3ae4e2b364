//! Body parameters in the layouts of the tools that write them: one movement, the reference's, out of each.
//!
//! The reference: a person turns about Y by 0.5 in four frames and walks along x, the left hip bent by 0.4 to 0.

use glam::{DQuat, Quat, Vec3};
use serde_json::json;
use xavatar_body::{HandPose, PoseAxisAngle, smplx};
use xavatar_data::{Clip, Coordinates, Motion, MotionOptions, RestPose, UpAxis, read_motion};
use xavatar_formats::{Array, ArrayMap, Choice, Error, npy_bytes, read_npz, write_npz};

use crate::layouts::{SMPL_PELVIS, assert_body, assert_is_reference, matrix, nested, pose, saved, says, vector};
use crate::{clip, fixture};

fn declared(name: &str, coordinates: Coordinates) -> Clip {
    Clip::load(&fixture(name), &MotionOptions { coordinates: Some(coordinates), ..MotionOptions::default() }).unwrap()
}

#[test]
fn the_reference_comes_out_of_every_tools_file() {
    for (name, tool, up) in [
        ("smpl_69.npz", "SMPL-X parameters", UpAxis::MinusY),
        ("hmr2.npz", "SMPL-X parameters", UpAxis::MinusY),
        ("wham.pkl", "WHAM", UpAxis::Y),
        ("vibe.pkl", "VIBE", UpAxis::MinusY),
        ("vibe_zlib.pkl", "VIBE", UpAxis::MinusY),
        ("econ.npy", "SMPL-X parameters", UpAxis::MinusY),
        ("motion_x.npy", "Motion-X", UpAxis::Y),
        ("camera_without_hands.npz", "SMPL-X parameters", UpAxis::MinusY),
        ("gvhmr.pt", "GVHMR", UpAxis::Y),
        ("tram.npy", "TRAM", UpAxis::MinusY),
    ] {
        let found = clip(name);
        assert_is_reference(&found, name);
        assert!(found.report[0].contains(&format!("({tool})")), "{:?}", found.report);
        assert!(says(&found.report, &format!("up axis: {up} (")), "{:?}", found.report);
        assert!(found.warnings.is_empty(), "{name}: {:?}", found.warnings);
    }
}

#[test]
fn hands_of_smpl_are_left_out_and_said_to_be() {
    for name in ["smpl_69.npz", "hmr2.npz", "wham.pkl", "vibe.pkl", "tram.npy"] {
        assert!(says(&clip(name).report, "its two hand joints are left out"), "{name}");
    }
}

// Pelvises are where the file has them, though SMPL's origin is 0.12 m lower over its pelvis than SMPL-X's.
#[test]
fn bodies_of_smpl_are_where_their_pelvis_is() {
    let (found, expected) = (clip("wham.pkl"), clip("reference.npz"));
    let shift = SMPL_PELVIS - RestPose::default().pelvis();
    for (found, expected) in found.frames.iter().zip(&expected.frames) {
        assert!((found.transl - expected.transl - shift).length() < 1e-5, "{}", found.transl);
    }
}

#[test]
fn of_two_motions_the_worlds_is_read_unless_declared_otherwise() {
    for name in ["wham.pkl", "gvhmr.pt"] {
        let (world, camera) = (clip(name), declared(name, Coordinates::Camera));
        assert!(
            says(&world.report, "in the world's coordinates; the file has a motion in the camera's"),
            "{:?}",
            world.report
        );
        assert!(
            says(&camera.report, "in the camera's coordinates; the file has a motion in the world's"),
            "{:?}",
            camera.report
        );
        assert!(says(&camera.report, "up axis: Y-down"), "{:?}", camera.report);
        assert_is_reference(&camera, name);
        assert_is_reference(&declared(name, Coordinates::World), name);
    }
}

// The same names as our own: a body that stands head down along the camera's y is not ours.
#[test]
fn an_unmarked_file_is_ours_only_if_its_body_is() {
    let arrays = |name: &str| read_npz(fixture(name)).unwrap();
    let mut reference = arrays("reference.npz");
    reference.remove("frames_per_second");
    assert!(loaded(&reference, &MotionOptions::default()).unwrap().report[0].contains("(motion npz)"));
    // Our hands say their convention; those of others are smplx's.
    let mut with_hands = reference.clone();
    with_hands.insert("left_hand_pose".into(), Array::from_f32(&[4, 45], vec![0.1; 4 * 45]));
    let read = loaded(&with_hands, &MotionOptions::default()).unwrap();
    assert!(says(&read.report, "up axis: Y (the body stands along it"), "{:?}", read.report);
    assert!(matches!(&read.frames[0].left_hand_pose, HandPose::RelativeToMean(hand) if hand[14].0 == Vec3::splat(0.1)));
    let mut camera = arrays("camera_without_hands.npz");
    // Marked, it is what the format says, and said loudly.
    camera.insert("frames_per_second".into(), Array::from_f32(&[], vec![30.0]));
    let marked = loaded(&camera, &MotionOptions::default()).unwrap();
    assert!(
        says(&marked.warnings, "head down in 4 of 4 frames") && marked.warnings[0].choice == Some(Choice::UpAxis),
        "{:?}",
        marked.warnings
    );
    let options = MotionOptions { coordinates: Some(Coordinates::Camera), ..MotionOptions::default() };
    assert_is_reference(&loaded(&camera, &options).unwrap(), "declared");
}

#[test]
fn a_motion_of_another_up_axis_is_written_with_it() {
    let expression = vec![0.0; smplx::EXPRESSIONS];
    let frames = vec![smplx::Parameters { transl: Vec3::Z, expression, ..Default::default() }];
    for up in UpAxis::ALL {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("motion.npz");
        xavatar_data::write_motion(&path, &Motion { frames: frames.clone(), up, ..Motion::default() }).unwrap();
        let read = read_motion(&path).unwrap();
        assert_eq!((read.up, read.up_is_certain, &read.frames), (up, true, &frames));
    }
}

fn loaded(arrays: &ArrayMap, options: &MotionOptions) -> xavatar_formats::Result<Clip> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.npz");
    write_npz(&path, arrays).unwrap();
    Clip::load(&path, options)
}

#[test]
fn glamr_is_z_up_and_has_the_place_of_the_pelvis() {
    let poses: Vec<Vec<f32>> = (0..3).map(|seed| pose(seed, 24)).collect();
    let body: Vec<&[f32]> = poses.iter().map(|pose| &pose[3..]).collect();
    let file = json!({"seq_name": "walk", "person_data": {"0": {
        "smpl_pose": body,
        "smpl_orient_world": vec![[0.1, 0.2, 0.3]; 3],
        "smpl_orient_cam": vec![[3.0, 0.0, 0.0]; 3],
        "root_trans_world": vec![[1.0, 2.0, 3.0]; 3],
        "root_trans_cam": vec![[4.0, 5.0, 6.0]; 3],
        "smpl_beta": vec![[0.0; 10]; 3],
    }}});
    let motion = nested(&file).unwrap();
    assert_eq!((motion.frames.len(), motion.up, motion.up_is_certain), (3, UpAxis::Z, true));
    assert_body(&motion.frames[1], &poses[1], Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(motion.frames[1].transl, Vec3::new(1.0, 2.0, 3.0) - RestPose::default().pelvis());
    let options = MotionOptions { coordinates: Some(Coordinates::Camera), ..MotionOptions::default() };
    let camera = saved("glamr.json", file.to_string().as_bytes(), |path| Clip::load(path, &options)).unwrap();
    // Turned to Y up about x: y and z change their signs.
    let pelvis = camera.frames[0].transl + RestPose::default().pelvis();
    assert!(pelvis.distance(Vec3::new(4.0, -5.0, -6.0)) < 1e-5, "{pelvis}");
}

#[test]
fn aistpp_is_y_up_at_60_frames_and_to_its_scale() {
    let poses: Vec<Vec<f32>> = (0..2).map(|seed| pose(seed, 24)).collect();
    let motion = nested(&json!({
        "smpl_loss": 0.1, "smpl_scaling": [94.0], "smpl_poses": poses, "smpl_trans": [[94.0, 188.0, 0.0], [0.0, 94.0, 47.0]],
    }))
    .unwrap();
    assert_eq!((motion.up, motion.up_is_certain, motion.frames_per_second), (UpAxis::Y, true, Some(60.0)));
    assert_body(&motion.frames[1], &poses[1], vector(&poses[1], 0));
    let shift = SMPL_PELVIS - RestPose::default().pelvis();
    assert!((motion.frames[1].transl - shift - Vec3::new(0.0, 1.0, 0.5)).length() < 1e-5);
}

// x = R (body without root) + T: turned about the origin, not about the pelvis J, which is then at R J + T.
#[test]
fn easymocaps_bodies_are_turned_about_the_origin() {
    let person = |id: usize, seed: usize| {
        let mut pose = pose(seed, 24);
        pose[..3].fill(0.0);
        json!({"id": id, "Rh": [[0.0, 0.0, 1.5]], "Th": [[1.0, 2.0, 3.0]], "poses": [pose], "shapes": [vec![0.0; 10]]})
    };
    let folder = tempfile::tempdir().unwrap();
    for (frame, people) in
        [json!([person(1, 0), person(0, 7)]), json!([person(0, 8), person(1, 1)]), json!([person(1, 2)])]
            .iter()
            .enumerate()
    {
        std::fs::write(folder.path().join(format!("{frame:06}.json")), people.to_string()).unwrap();
    }
    let motion = read_motion(folder.path()).unwrap();
    // Of the two in the first picture the first by name is followed, as long as it is there.
    let seeds: Vec<usize> =
        if motion.frames[0].body_pose[0].0 == vector(&pose(7, 24), 1) { vec![7, 8, 2] } else { vec![0, 1, 2] };
    assert_eq!(motion.frames.len(), 3);
    for (frame, seed) in motion.frames.iter().zip(seeds) {
        assert_body(frame, &pose(seed, 24), Vec3::new(0.0, 0.0, 1.5));
        let pelvis = frame.transl + RestPose::default().pelvis();
        let expected = Quat::from_rotation_z(1.5) * SMPL_PELVIS + Vec3::new(1.0, 2.0, 3.0);
        assert!(pelvis.distance(expected) < 1e-5, "{pelvis} is not {expected}");
    }
}

// 66 of the body, 6 coefficients a hand, 9 of the face.
#[test]
fn easymocaps_packed_hands_and_face_are_unpacked() {
    let mut packed = pose(3, 22);
    packed.extend([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, -0.1, -0.2, -0.3, -0.4, -0.5, -0.6]);
    let face = [0.11, 0.12, 0.13, 0.21, 0.22, 0.23, 0.31, 0.32, 0.33];
    let file = |poses: &[f32]| json!([{"id": 0, "Rh": [vec![0.0; 3]], "Th": [vec![0.0; 3]], "poses": [poses], "shapes": [vec![0.0; 10]]}]);
    let smplh = nested(&file(&packed)).unwrap();
    let smplx = nested(&file(&[&packed[..], &face[..]].concat())).unwrap();
    for motion in [&smplh, &smplx] {
        let frame = &motion.frames[0];
        assert_body(frame, &pose(3, 22), Vec3::ZERO);
        assert_eq!(frame.left_hand_pose, HandPose::Pca(vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6]));
        assert_eq!(frame.right_hand_pose, HandPose::Pca(vec![-0.1, -0.2, -0.3, -0.4, -0.5, -0.6]));
    }
    assert_eq!(smplx.frames[0].jaw_pose, PoseAxisAngle(Vec3::new(0.11, 0.12, 0.13)));
    assert_eq!(smplx.frames[0].right_eye_pose, PoseAxisAngle(Vec3::new(0.31, 0.32, 0.33)));
    assert_eq!(smplh.frames[0].jaw_pose, PoseAxisAngle::default());
}

#[test]
fn whole_poses_of_every_model_have_their_hands_and_face() {
    for (joints, left, jaw) in [(22, None, None), (24, None, None), (52, Some(22), None), (55, Some(25), Some(22))] {
        let poses: Vec<Vec<f32>> = (0..2).map(|seed| pose(seed, joints)).collect();
        for with_matrices in [false, true] {
            let matrices = |pose: &Vec<f32>| (0..joints).map(|joint| matrix(vector(pose, joint))).collect::<Vec<_>>();
            let value =
                if with_matrices { json!(poses.iter().map(matrices).collect::<Vec<_>>()) } else { json!(poses) };
            let motion = nested(&json!({"smpl_pose": value})).unwrap();
            for (frame, pose) in motion.frames.iter().zip(&poses) {
                assert_body(frame, pose, vector(pose, 0));
                let HandPose::Flat(hand) = &frame.left_hand_pose else { panic!("whole poses are absolute") };
                let expected = left.map_or(Vec3::ZERO, |left| vector(pose, left + 4));
                assert!((hand[4].0 - expected).length() < 1e-5, "{joints} joints");
                let expected = jaw.map_or(Vec3::ZERO, |jaw| vector(pose, jaw));
                assert!((frame.jaw_pose.0 - expected).length() < 1e-5, "{joints} joints");
            }
        }
    }
}

// RVH and BEHAVE: a frame of SMPL+H a file; PeopleSnapshot and InstantAvatar: 69 numbers beside the root's.
#[test]
fn fits_of_smpl_and_smplh_are_read() {
    let pose = pose(5, 52);
    let motion = nested(&json!({"pose": pose, "betas": vec![0.0; 10], "trans": [0.0, 1.0, 2.0]})).unwrap();
    assert_body(&motion.frames[0], &pose, vector(&pose, 0));
    assert!(says(&motion.notes, "SMPL+H"), "{:?}", motion.notes);
    let motion = nested(&json!({
        "betas": vec![0.0; 10], "global_orient": vec![[3.1, 0.0, 0.0]; 2], "body_pose": vec![&pose[3..72]; 2], "transl": vec![[0.0; 3]; 2],
    }))
    .unwrap();
    assert_body(&motion.frames[1], &pose, Vec3::new(3.1, 0.0, 0.0));
    assert!(motion.zeroed.iter().all(|name| name != "transl"), "{:?}", motion.zeroed);
}

// Of SLAHMR: people, frames, numbers.
#[test]
fn of_several_people_in_an_array_the_first_is_read() {
    let person = |first: usize| (first..first + 3).map(|seed| pose(seed, 22)[3..].to_vec()).collect::<Vec<_>>();
    let motion = nested(&json!({
        "pose_body": [person(0), person(10)],
        "root_orient": [vec![[0.5, 0.0, 0.0]; 3], vec![[0.6, 0.0, 0.0]; 3]],
        "trans": [vec![[1.0, 0.0, 0.0]; 3], vec![[2.0, 0.0, 0.0]; 3]],
        "betas": [vec![0.5; 16], vec![0.7; 16]],
    }))
    .unwrap();
    assert_eq!((motion.frames.len(), motion.frames[2].betas[9]), (3, 0.5));
    assert_body(&motion.frames[2], &pose(2, 22), Vec3::new(0.5, 0.0, 0.0));
    assert_eq!(motion.frames[2].transl.x, 1.0);
    assert!(says(&motion.notes, "of several people"), "{:?}", motion.notes);
}

#[test]
fn codes_of_vposer_are_refused_by_that_name() {
    for value in [json!({"body_pose": [vec![0.0; 32]]}), json!({"pose_body": vec![vec![0.0; 32]; 4], "betas": [0.0]})] {
        let error = nested(&value).unwrap_err();
        assert!(matches!(error, Error::Mismatch { .. }), "{error}");
        assert!(["VPoser", "vposer.decode"].iter().all(|word| error.to_string().contains(word)), "{error}");
    }
    // The decoded pose beside the code is read.
    assert!(nested(&json!({"body_pose": [vec![0.0; 32]], "poses": [pose(0, 22)]})).is_ok());
}

#[test]
fn one_array_without_a_name_is_told_what_to_do() {
    for (shape, words) in
        [(&[4, 72][..], "poses=ROTATIONS"), (&[4, 263], "HumanML3D"), (&[4, 22, 3], "places of joints")]
    {
        let array = Array::from_f32(shape, vec![0.0; shape.iter().product()]);
        let message = saved("motion.npy", &npy_bytes(&array), |path| read_motion(path)).unwrap_err().to_string();
        assert!(message.contains(words) && message.contains("numpy.savez"), "{message}");
    }
}

// A body that lies, in a file that does not say which way is up.
#[test]
fn what_cannot_be_told_is_said() {
    let lying = DQuat::from_rotation_z(1.5).to_scaled_axis().as_vec3().to_array();
    let value = json!({"body_pose": vec![vec![0.0; 63]; 2], "global_orient": [lying, lying], "gender": "male"});
    let found =
        saved("motion.json", value.to_string().as_bytes(), |path| Clip::load(path, &MotionOptions::default())).unwrap();
    assert!(
        says(&found.warnings, "which way is up") && found.warnings[0].choice == Some(Choice::UpAxis),
        "{:?}",
        found.warnings
    );
}

// SAM 3D Body's results, a dict a person: the turns of another skeleton under names of their own.
#[test]
fn poses_of_the_momentum_human_rig_are_refused_with_the_way_out() {
    let person = json!({
        "pred_cam_t": [0.0, 1.0, 2.5],
        "global_rot": [3.1, 0.0, 0.1],
        "body_pose_params": vec![0.1; 133],
        "hand_pose_params": vec![0.0; 108],
        "shape_params": vec![0.0; 45],
        "mhr_model_params": vec![0.1; 204],
    });
    for file in [person.clone(), json!([person])] {
        let error = nested(&file).unwrap_err().to_string();
        assert!(["SAM 3D Body", "xavatar body import mhr"].iter().all(|word| error.contains(word)), "{error}");
    }
}
