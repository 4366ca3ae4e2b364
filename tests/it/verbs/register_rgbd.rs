//! A depth camera's pictures alone to data: the built-in subject's, filmed by a camera that moves around it, is registered as it really is.

use std::fs;
use std::path::{Path, PathBuf};

use glam::Vec3;
use tempfile::TempDir;
use xavatar::body::Gender;
use xavatar::config::Config;
use xavatar::data::{DepthFormat, RgbdFrame, RgbdLayout, RgbdSubject, Split, write_rgbd_subject};
use xavatar::formats::Result;
use xavatar::mesh::camera::PinholeCamera;
use xavatar::synthetic::{BuiltInSubject, film};

use super::tool::{TINY, assert_outcome, data, text};
use super::truth::{self, SEEN};

/// Frames of the take.
const FRAMES: usize = 4;
/// Pictures with masks in a plain folder that says nothing of bodies, and landmarks that are up to 10 mm off.
fn pictures() -> (TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let pictures = folder.path().join("pictures");
    let subject = BuiltInSubject::new().unwrap();
    let mut landmarks = serde_json::Map::new();
    let picture = |index: usize| -> Result<RgbdFrame> {
        let scan = subject.frame(Split::Train, index, FRAMES)?;
        let rows = truth::landmarks(&subject, &scan.parameters, index, &SEEN[1..], (0.01, 1.0));
        landmarks.insert(scan.id.to_string(), rows);
        let (sin, cos) = (0.6 * index as f32 - 0.9).sin_cos();
        let centre = scan.parameters.translation() + Vec3::Y * 0.1;
        let camera = PinholeCamera::looking_at(centre + 4.0 * Vec3::new(sin, 0.1, cos), centre, 0.55, [300, 400])?;
        let frame = film(&scan, camera)?;
        let mask = Some(frame.depth.iter().map(|depth| depth.is_finite()).collect());
        Ok(RgbdFrame { mask, ..frame })
    };
    let frames = (0..FRAMES).map(picture);
    let layout = RgbdLayout::Plain(DepthFormat::Png);
    write_rgbd_subject(&pictures, layout, Gender::Neutral, &[0.0; 10], frames).unwrap();
    fs::remove_file(pictures.join("train/Take1/bodies.npz")).unwrap();
    let settings = fs::read_to_string(pictures.join("rgbd.toml")).unwrap();
    let without_body = |line: &&str| !line.starts_with("gender") && !line.starts_with("betas");
    // Arrays may go over several lines.
    let settings: String =
        settings.replace(",\n", ",").replace("[\n", "[").lines().filter(without_body).collect::<Vec<_>>().join("\n");
    fs::write(pictures.join("rgbd.toml"), settings).unwrap();
    let file = pictures.join("landmarks.json");
    fs::write(&file, serde_json::json!({ "names": SEEN[1..], "frames": landmarks }).to_string()).unwrap();
    (folder, pictures, file)
}

/// Of each frame, the mean distance between the registered body's vertices and the true one's, millimetres.
fn errors(data: &Path) -> Vec<f32> {
    let (known, subject) = (BuiltInSubject::new().unwrap(), RgbdSubject::open(data).unwrap());
    let error = |(index, files): (usize, &xavatar::data::RgbdFiles)| {
        let frame = files.read(&subject.betas).unwrap();
        assert!(frame.mask.is_some(), "masks are kept");
        truth::error(&known, &frame.parameters, index, FRAMES)
    };
    subject.train.iter().enumerate().map(error).collect()
}

#[test]
fn pictures_with_landmarks_become_data_to_train_on() {
    let (folder, pictures, landmarks) = pictures();
    let (_, body) = data();
    // Where training looks for what it registers first.
    let out = folder.path().join("run-registered");
    let register =
        ["register", "--rgbd", text(&pictures), "--body", body, "--landmarks", text(&landmarks), "--out", text(&out)];
    assert_outcome(&register, 0, &["registered         4 of 4 frames", "register.html", "xavatar train"]);
    let errors = errors(&out);
    assert!(errors.iter().all(|error| *error < 20.0), "{errors:?}");
    assert_outcome(&["check", text(&out), "--body", body], 0, &["ready to train"]);

    let files = ["rgbd.toml", "train/Take1/bodies.npz", "train/Take1/depth/depth_000002.tiff", "register.json"];
    let contents = || files.map(|file| fs::read(out.join(file)).unwrap());
    let whole = contents();
    let end_is_lost =
        || ["rgbd.toml", "register.json"].iter().for_each(|file| fs::remove_file(out.join(file)).unwrap());
    end_is_lost();
    assert_outcome(&register, 1, &["not empty", "--resume"]);
    assert_outcome(&[&register[..], &["--resume"]].concat(), 0, &["registered         4 of 4 frames"]);
    assert!(whole == contents(), "a run that was stopped ends with the same bytes");

    end_is_lost();
    let run = folder.path().join("run");
    let train = ["train", text(&pictures), "--body", body, "--out", text(&run), "--preset", "demo", "--steps", "4"];
    let settings: Vec<&str> = TINY.iter().flat_map(|setting| ["--set", setting]).collect();
    let told = ["registering one by landmarks.json, into", "run-registered", "avatar.safetensors"];
    assert_outcome(&[&train[..], &settings].concat(), 0, &told);
    assert!(whole == contents(), "training registers as the verb does");
    assert_eq!(Config::read(&run.join("config.toml")).unwrap().preset, "demo-rgbd");
}

#[test]
fn what_pictures_lack_or_cannot_give_is_named() {
    let (folder, pictures, landmarks) = pictures();
    let (_, body) = data();
    let out = folder.path().join("data");
    let register =
        ["register", "--rgbd", text(&pictures), "--body", body, "--landmarks", text(&landmarks), "--out", text(&out)];
    let with = |more: &[&str], code: i32, words: &[&str]| assert_outcome(&[&register[..], more].concat(), code, words);
    with(&["--offsets"], 2, &["--offsets", "one side", "leave it out"]);
    with(&["--take", "Take1=test"], 2, &["--take", "rgbd.toml"]);
    assert_outcome(&[&["register", "scans"], &register[1..]].concat(), 2, &["--rgbd"]);
    assert_outcome(&["register", "--body", body, "--geometry-only", "--out", text(&out)], 2, &["SCANS"]);

    let settings = fs::read_to_string(pictures.join("rgbd.toml")).unwrap();
    let with_settings = |from: &str, to: &str| {
        assert!(settings.contains(from), "{settings}");
        fs::write(pictures.join("rgbd.toml"), settings.replace(from, to)).unwrap();
    };
    let unit = settings.lines().find(|line| line.starts_with("depth_unit")).unwrap();
    with_settings(unit, "depth_unit = 0.00002");
    with(&[], 1, &["no person alone", "depth_unit"]);
    with_settings(unit, "depth_unit = 1.0");
    with(&["--resume"], 1, &["train/Take1/f00001", "no depth within 10 m"]);
    with_settings("cameras.npz", "none.npz");
    with(&["--resume"], 1, &["none.npz", "extrinsic"]);
    fs::write(pictures.join("rgbd.toml"), &settings).unwrap();
    // Bodies say of whom they are.
    let (run, bodies) = (folder.path().join("run"), pictures.join("train/Take1/bodies.npz"));
    fs::write(&bodies, "").unwrap();
    let train = ["train", text(&pictures), "--body", body, "--out", text(&run)];
    assert_outcome(&train, 1, &["betas", "docs/registration.md"]);
    fs::remove_file(bodies).unwrap();

    let depth = pictures.join("train/Take1/depth/depth_000003.png");
    let bytes = fs::read(&depth).unwrap();
    fs::write(&depth, &bytes[..bytes.len() / 2]).unwrap();
    with(&["--resume"], 1, &["train/Take1/f00003", "depth_000003.png"]);
    fs::remove_dir_all(pictures.join("train")).unwrap();
    with(&["--resume"], 1, &["a folder of pictures", "rgbd.toml"]);
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let nothing =
        ["register", "--rgbd", text(&empty), "--body", body, "--geometry-only", "--out", text(&out), "--resume"];
    assert_outcome(&nothing, 1, &["an RGB-D frame not found", "docs/rgbd.md"]);
}
