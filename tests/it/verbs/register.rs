//! Scans alone to data: the built-in subject's, as bare meshes in millimetres with noisy landmarks, is registered as it really is.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use xavatar::body::Pose;
use xavatar::body::smplx::Parameters;
use xavatar::data::{FrameId, Motion, Split, Subject, read_frame, read_motion, write_motion};
use xavatar::mesh::{SurfaceIndex, TriangleMesh, read_mesh, write_obj};
use xavatar::register::landmarks::{LANDMARKS_FILE, LandmarkFiles};
use xavatar::synthetic::BuiltInSubject;

use super::tool::{assert_outcome, data, text};
use super::truth::{self, SEEN};
use crate::ground::add_ground;

/// Frames of the take.
const FRAMES: usize = 4;
/// Bare scans in millimetres, one of them with ground, in a folder of one sequence, and landmarks that are up to 15 mm off.
fn scans() -> (TempDir, PathBuf, PathBuf) {
    first_scans(FRAMES)
}

/// Of these scans the first, and their landmarks.
fn first_scans(count: usize) -> (TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let take = folder.path().join("scans/Take1");
    fs::create_dir_all(&take).unwrap();
    let subject = BuiltInSubject::new().unwrap();
    let mut frames = serde_json::Map::new();
    for index in 0..count {
        let frame = subject.frame(Split::Train, index, FRAMES).unwrap();
        let mut scan = frame.scan;
        scan.vertices.iter_mut().for_each(|vertex| *vertex *= 1000.0);
        if index == 2 {
            add_ground(&mut scan, 1000.0);
        }
        write_obj(take.join(format!("scan_{:03}.obj", index + 1)), &scan).unwrap();
        let rows = truth::landmarks(&subject, &frame.parameters, index, &SEEN, (0.015, 1000.0));
        frames.insert(format!("Take1/f{:05}", index + 1), rows);
    }
    let landmarks = folder.path().join("landmarks.json");
    fs::write(&landmarks, serde_json::json!({ "names": SEEN, "frames": frames }).to_string()).unwrap();
    let scans = folder.path().join("scans");
    (folder, scans, landmarks)
}

/// Of each frame, the mean distance between the registered body's vertices and the true one's, millimetres.
fn errors(data: &Path) -> Vec<f32> {
    let known = BuiltInSubject::new().unwrap();
    let subject = Subject::open(data).unwrap().settled(known.model()).unwrap();
    let error = |(index, files): (usize, _)| {
        let frame = read_frame(files, &subject.betas).unwrap();
        truth::error(&known, &frame.parameters, index, FRAMES)
    };
    subject.train.iter().enumerate().map(error).collect()
}

/// The bytes of every file below a folder, by name; locks are left out.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    let inner = |entry: PathBuf| {
        if entry.is_dir() { contents(&entry) } else { vec![(entry.clone(), fs::read(entry).unwrap())] }
    };
    let all = entries.into_iter().filter(|entry| entry.file_name().is_none_or(|name| name != ".lock")).flat_map(inner);
    // The page quotes the command that wrote it.
    all.filter(|(path, _)| path.extension().is_none_or(|extension| extension != "html")).collect()
}

#[test]
fn bare_scans_with_landmarks_become_data_to_train_on() {
    let (folder, scans, landmarks) = scans();
    let (_, body) = data();
    let out = folder.path().join("data");
    let register = ["register", text(&scans), "--body", body, "--landmarks", text(&landmarks), "--out", text(&out)];
    let noted = "noted: train/Take1/f00003: what is beside the person is left out: the ground (";
    assert_outcome(&register, 0, &["registered         4 of 4 frames", noted, "register.html", "xavatar train"]);
    let errors = errors(&out);
    assert!(errors.iter().all(|error| *error < 8.0), "{errors:?}");
    assert_outcome(&["check", text(&out), "--body", body], 0, &["X-Humans", "ready to train"]);
    let id = FrameId { split: "train".into(), sequence: "Take1".into(), number: 2 };
    let points = |path: &Path| {
        let mut points = LandmarkFiles::read(path).unwrap().of_frame(&id, 1, FRAMES).unwrap();
        points.sort_by(|one, other| one.0.cmp(&other.0));
        points
    };
    assert_eq!(
        points(&out.join(LANDMARKS_FILE)),
        points(&landmarks),
        "what was given can be corrected and given again"
    );
    assert_outcome(&register, 1, &["not empty", "--resume"]);

    // Stopped after shape and one frame were known, and gone on with by one thread: the same bytes.
    let whole = contents(&out);
    for gone in [
        "register.json",
        "register.html",
        "register/train-Take1-f00002.json",
        "train/Take1/SMPLX/mesh-f00003_smplx.pkl",
    ] {
        fs::remove_file(out.join(gone)).unwrap();
    }
    let again = [&register[..], &["--resume", "--threads", "1"]].concat();
    assert_outcome(&again, 0, &["registered         4 of 4 frames"]);
    let resumed = contents(&out);
    assert_eq!(whole.len(), resumed.len());
    for ((path, bytes), (_, other)) in whole.iter().zip(&resumed) {
        if !path.ends_with("train-Take1-f00002.json")
            && !path.to_string_lossy().contains("f00002_smplx")
            && !path.ends_with("register.json")
        {
            assert_eq!(bytes, other, "{}", path.display());
        }
    }

    // Moved onto its scan vertex by vertex, the body has its own faces, and lies on it as bodies under clothes do not.
    assert_outcome(&[&register[..], &["--resume", "--offsets"]].concat(), 0, &["registered         4 of 4 frames"]);
    let subject = Subject::open(&out).unwrap();
    let scan = SurfaceIndex::new(&subject.train[1].read_scan().unwrap().mesh).unwrap();
    let [moved, registered] = ["offsets/train/Take1/f00002.ply", "train/Take1/SMPLX/mesh-f00002_smplx.ply"]
        .map(|file| read_mesh(out.join(file)).unwrap().mesh);
    let off = |mesh: &TriangleMesh| {
        let distances = mesh.vertices.iter().map(|place| scan.closest(*place).distance);
        distances.sum::<f32>() / mesh.vertices.len() as f32
    };
    assert_eq!(moved.faces, registered.faces);
    assert!(off(&moved) < 0.5 * off(&registered), "{} {}", off(&moved), off(&registered));
}

#[test]
fn what_cannot_be_registered_is_named() {
    let (folder, scans, _) = scans();
    let (_, body) = data();
    let out = folder.path().join("data");
    let landmarks = folder.path().join("few.json");
    fs::write(&landmarks, r#"{"names": ["left_knee"], "frames": {"Take1/f00001": [[0, 500, 0, 1]]}}"#).unwrap();
    let register = ["register", text(&scans), "--body", body, "--out", text(&out)];
    assert_outcome(
        &[&register[..], &["--landmarks", text(&landmarks)]].concat(),
        1,
        &["none of 4 frames has landmarks of the torso", "give landmarks"],
    );
    assert!(out.join("landmarks.json").is_file(), "the landmarks to correct are kept");
    fs::remove_dir_all(&out).unwrap();
    assert_outcome(&register, 2, &["--landmarks"]);
    assert_outcome(
        &[&register[..], &["--geometry-only", "--take", "Take9=test"]].concat(),
        1,
        &["the sequence Take9 not found; name one of Take1"],
    );
    let two = folder.path().join("two");
    fs::create_dir(&two).unwrap();
    let mut both = BuiltInSubject::new().unwrap().frame(Split::Train, 0, FRAMES).unwrap().scan;
    let first = both.vertices.len() as u32;
    both.vertices.extend_from_within(..);
    both.vertices[first as usize..].iter_mut().for_each(|vertex| vertex.z += 1.5);
    both.faces.extend(both.faces.clone().iter().map(|face| face.map(|vertex| vertex + first)));
    write_obj(two.join("f1.obj"), &TriangleMesh { vertices: both.vertices, faces: both.faces, ..Default::default() })
        .unwrap();
    assert_outcome(
        &["register", text(&two), "--body", body, "--out", text(&out), "--geometry-only"],
        1,
        &["f1", "2 separate surfaces, each as large as a person"],
    );
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    assert_outcome(
        &["register", text(&empty), "--body", body, "--out", text(&out), "--geometry-only"],
        1,
        &["a scan (.ply"],
    );
}

#[test]
fn a_package_without_networks_is_refused_and_the_version_that_has_them_named() {
    let (folder, scans, _) = scans();
    let (_, body) = data();
    let package = folder.path().join("mediapipe-1.2.3");
    fs::create_dir(&package).unwrap();
    let out = folder.path().join("data");
    let register = ["register", text(&scans), "--body", body, "--models", text(&package), "--out", text(&out)];
    assert_outcome(&register, 1, &["pose_landmark_full.tflite", "mediapipe==0.10.14"]);
}

#[test]
fn scans_with_registrations_are_not_registered_again_for_want_of_something_else() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data"), folder.path().join("run"));
    let body = data.join("body");
    BuiltInSubject::new().unwrap().write_data(&data, 2, 0).unwrap();
    fs::remove_file(data.join("mean_shape_smplx.npy")).unwrap();
    let arguments = ["train", text(&data), "--body", text(&body), "--out", text(&out)];
    assert_outcome(&arguments, 1, &["the subject's mean shape not found"]);
    assert!(!folder.path().join("run-registered").exists());
}

/// Mean distance of the joints of some poses from the true ones, millimetres.
fn joint_errors(poses: &[Pose]) -> Vec<f32> {
    let truth = BuiltInSubject::new().unwrap();
    let error = |(index, pose): (usize, &Pose)| {
        let parameters = truth.parameters(Split::Train, index, FRAMES).unwrap().into();
        let expected = truth.model().resolve(&parameters).unwrap();
        let [found, expected] = [pose, &expected].map(|pose| truth.model().pose(pose).unwrap().joints);
        1e3 * found.iter().zip(&expected).map(|(found, expected)| found.distance(*expected)).sum::<f32>()
            / found.len() as f32
    };
    poses.iter().enumerate().map(error).collect()
}

#[test]
fn the_motion_of_bare_scans_is_captured_as_a_file_that_other_verbs_read() {
    let (folder, scans, landmarks) = scans();
    let (_, body) = data();
    let out = folder.path().join("motions");
    let capture = ["mocap", text(&scans), "--body", body, "--landmarks", text(&landmarks), "--out", text(&out)];
    // The dance's frames are seconds apart: a rate at which nothing ties them together.
    assert_outcome(&[&capture[..], &["--fps", "2"]].concat(), 0, &["registered         4 of 4 frames", "Take1.npz"]);
    let motion = read_motion(out.join("Take1.npz")).unwrap();
    assert_eq!((motion.frames.len(), motion.frames_per_second), (FRAMES, Some(2.0)));
    let truth = BuiltInSubject::new().unwrap();
    let pose = |frame: &Parameters| truth.model().resolve(&frame.clone().into()).unwrap();
    let errors = joint_errors(&motion.frames.iter().map(pose).collect::<Vec<_>>());
    assert!(errors.iter().all(|error| *error < 10.0), "{errors:?}");
    assert!(!out.join("train").exists(), "poses alone, no data");
    assert_outcome(&capture, 1, &["not empty", "--resume"]);
}

#[test]
fn poses_of_another_program_are_tried_as_starts_and_have_to_be_of_the_frames() {
    let (folder, scans, landmarks) = scans();
    let (_, body) = data();
    let truth = BuiltInSubject::new().unwrap();
    let motion = |frames: usize, name: &str| {
        let frames = (0..frames).map(|index| truth.parameters(Split::Train, index, FRAMES).unwrap()).collect();
        let path = folder.path().join(name);
        write_motion(&path, &Motion { frames, ..Motion::default() }).unwrap();
        path
    };
    let starts = folder.path().join("starts");
    fs::create_dir(&starts).unwrap();
    motion(FRAMES, "starts/Take1.npz");
    let register = ["register", text(&scans), "--body", body, "--landmarks", text(&landmarks), "--out"];
    let out = folder.path().join("data");
    assert_outcome(&[&register[..], &[text(&out), "--start", text(&starts)]].concat(), 0, &["4 of 4 frames"]);
    let errors = errors(&out);
    assert!(errors.iter().all(|error| *error < 8.0), "{errors:?}");

    let none = folder.path().join("none");
    let refused = |start: &Path, words: &[&str]| {
        assert_outcome(&[&register[..], &[text(&none), "--start", text(start), "--resume"]].concat(), 1, words);
    };
    refused(&motion(FRAMES - 1, "few.npz"), &["few.npz", "3 poses", "4 frames of train/Take1"]);
    refused(&folder.path().join("nothing.npz"), &["nothing.npz", "a motion"]);
    refused(&landmarks, &["landmarks.json", "docs/motion.md"]);
}

/// A .npy file of numbers.
fn npy(numbers: &[f32]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({},), }}", numbers.len());
    let header = format!("{header:<117}\n");
    let start = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
    start.into_iter().chain(numbers.iter().flat_map(|number| number.to_le_bytes())).collect()
}

#[test]
fn a_shape_that_is_given_is_held_and_one_sequence_may_give_the_shape_of_all() {
    let (folder, scans, landmarks) = first_scans(2);
    let (_, body) = data();
    let register = ["register", text(&scans), "--body", body, "--landmarks", text(&landmarks), "--out"];
    let shape: Vec<f32> = (0..10).map(|index| 0.1 * index as f32).collect();
    let file = folder.path().join("betas.npy");
    fs::write(&file, npy(&shape)).unwrap();
    let held = folder.path().join("held");
    assert_outcome(&[&register[..], &[text(&held), "--shape", text(&file)]].concat(), 0, &["2 of 2 frames"]);
    assert_eq!(Subject::open(&held).unwrap().betas, shape);
    let short = folder.path().join("short.npy");
    fs::write(&short, npy(&[0.0; 3])).unwrap();
    let none = folder.path().join("none");
    let refused = [&register[..], &[text(&none), "--shape", text(&short)]].concat();
    assert_outcome(&refused, 2, &["short.npy", "expected 10 finite numbers"]);

    let tight = folder.path().join("tight");
    assert_outcome(&[&register[..], &[text(&tight), "--minimal", "Take1"]].concat(), 0, &["2 of 2 frames"]);
    let plain = folder.path().join("plain");
    assert_outcome(&[&register[..], &[text(&plain)]].concat(), 0, &["2 of 2 frames"]);
    let [tight, plain] = [tight, plain].map(|data| Subject::open(&data).unwrap().betas);
    assert_ne!(tight, plain, "clothes that may not be thick leave another shape");
    assert_outcome(
        &[&register[..], &[text(&folder.path().join("none")), "--minimal", "Take7"]].concat(),
        1,
        &["Take7", "Take1"],
    );
}
