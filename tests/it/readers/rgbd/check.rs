//! What `check` finds in RGB-D frames, and the verbs that film and show them.

use std::fs;
use std::path::Path;
use std::process::Command;

use glam::{Mat4, Vec3};
use xavatar::data::{DepthFormat, PointCloud, RgbdCheckReport, RgbdLayout, RgbdSubject, check_rgbd};
use xavatar::formats::{Array, Choice, read_npz, write_npz};

use super::{FRAMES, SUBJECT, replace, written};

fn report(folder: &Path) -> RgbdCheckReport {
    let subject = RgbdSubject::open(folder).unwrap();
    check_rgbd(&subject, SUBJECT.model(), SUBJECT.part_labels(), &|| {}).unwrap()
}

#[test]
fn good_frames_pass_the_check() {
    let folder = written(RgbdLayout::XHumans);
    let report = report(folder.path());
    assert!(report.problems.is_empty(), "{report:#?}");
    assert_eq!(report.measured_frames, 3);
    let mut points: Vec<usize> = FRAMES.iter().map(|frame| PointCloud::of(frame).unwrap().points.len()).collect();
    points.sort();
    assert_eq!(report.points, Some(points[1]), "the median");
    assert!((report.depth_to_body.unwrap() - 1.0).abs() < 0.05, "{report:#?}");
    assert!(report.distances["all"].median_mm < 40.0, "{report:#?}");
}

#[test]
fn the_check_names_units_and_camera_conventions() {
    let problem_after = |change: &dyn Fn(&Path)| {
        let folder = written(RgbdLayout::Plain(DepthFormat::Tiff));
        change(folder.path());
        let report = report(folder.path());
        assert!(!report.problems.is_empty(), "{report:#?}");
        report.problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let unit = |unit: &'static str| {
        move |folder: &Path| replace(&folder.join("rgbd.toml"), "depth_unit = 1.0", &format!("depth_unit = {unit}"))
    };
    let small = problem_after(&unit("\"millimetres\""));
    assert!(small.contains("1.") && small.contains("mm tall") && small.contains("metres"), "{small}");
    let large = problem_after(&unit("1000.0"));
    assert!(large.contains("m tall") && large.contains("millimetres"), "{large}");

    let extrinsics = |change: fn(Mat4) -> Mat4| {
        move |folder: &Path| {
            for sequence in ["train/Take1", "test/Take2"] {
                let path = folder.join(sequence).join("cameras.npz");
                let mut arrays = read_npz(&path).unwrap();
                let values = arrays["extrinsic"].to_f32().unwrap();
                let changed = values.chunks_exact(16).flat_map(|matrix| {
                    let matrix = Mat4::from_cols_slice(matrix).transpose();
                    change(matrix).transpose().to_cols_array()
                });
                let changed: Vec<f32> = changed.collect();
                arrays.insert("extrinsic".into(), Array::from_f32(&[changed.len() / 16, 4, 4], changed));
                write_npz(&path, &arrays).unwrap();
            }
        }
    };
    let inverted = problem_after(&extrinsics(|matrix| matrix.inverse()));
    assert!(inverted.contains("are camera to world:"), "{inverted}");
    let flipped = problem_after(&extrinsics(|matrix| Mat4::from_scale(Vec3::new(1.0, -1.0, -1.0)) * matrix));
    assert!(flipped.contains("OpenGL"), "{flipped}");
    let elsewhere = problem_after(&extrinsics(|matrix| matrix * Mat4::from_translation(Vec3::X * 9.0)));
    assert!(elsewhere.contains("does not appear"), "{elsewhere}");
}

#[test]
fn broken_frames_are_listed_by_name() {
    let folder = written(RgbdLayout::XHumans);
    let depth = folder.path().join("train/Take1/render/depth/depth_000002.tiff");
    let bytes = fs::read(&depth).unwrap();
    fs::write(&depth, &bytes[..bytes.len() / 2]).unwrap();
    let report = report(folder.path());
    assert_eq!(report.unusable.iter().map(|frame| frame.frame.as_str()).collect::<Vec<_>>(), ["train/Take1/f00012"]);
    assert!(report.unusable[0].reason.contains("depth_000002.tiff"), "{report:#?}");
    assert!(report.problems.iter().any(|problem| problem.choice == Some(Choice::SkipBadFrames)), "{report:#?}");
}

#[test]
fn the_verbs_film_check_and_show() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_xavatar")).args(arguments).output().unwrap();
        let printed = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        (output.status.code(), printed)
    };
    let (data, filmed, body) = (path("mannequin"), path("filmed"), path("mannequin/body"));
    assert_eq!(run(&["demo", "--smoke", "--write-data", &data]).0, Some(0));
    let film = ["render-rgbd", &data, "--layout", "plain", "--depth", "exr", "--steps-per-turn", "4", "--out", &filmed];
    let (code, printed) = run(&film);
    assert!(code == Some(0) && printed.contains("4 frames"), "{printed}");
    assert_eq!(run(&film).0, Some(1), "nothing is overwritten");
    let (code, printed) = run(&["check", &filmed, "--body", &body]);
    assert!(code == Some(0) && printed.contains("ready to train from RGB-D"), "{printed}");
    let cloud = path("cloud.ply");
    let show = ["pointcloud", &filmed, "--frame", "test/Take2/f00001", "--parts", "--body", &body, "--out", &cloud];
    let (code, printed) = run(&show);
    assert!(code == Some(0) && printed.contains("left hand"), "{printed}");
    let points = xavatar::mesh::read_mesh(&cloud).unwrap().mesh;
    assert!(points.faces.is_empty() && points.vertices.len() > 20_000);
    let (code, printed) = run(&["pointcloud", &filmed, "--frame", "train/x/f00001", "--out", &path("other.ply")]);
    assert!(code == Some(2) && printed.contains("train/Take1/f00001 to train/Take1/f00003"), "{printed}");
}
