//! Faulty subjects as scripts see them: `check` refuses and mends, `train` refuses until a fault is accepted by its name.

use std::path::{Path, PathBuf};

use glam::Vec3;
use tempfile::TempDir;
use xavatar::mesh::{read_mesh, write_ply};

use super::tool::{TINY, assert_outcome, data, run, text};

/// A copy of the subject, whose scans may be changed, and its body model's folder.
fn subject() -> (TempDir, PathBuf, &'static str) {
    let (data, body) = data();
    let folder = tempfile::tempdir().unwrap();
    let copied = folder.path().join("anna");
    for file in files(Path::new(data)) {
        let to = copied.join(file.strip_prefix(data).unwrap());
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(file, to).unwrap();
    }
    (folder, copied, body)
}

/// All files below a folder, in order.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    entries.into_iter().flat_map(|entry| if entry.is_dir() { files(&entry) } else { vec![entry] }).collect()
}

fn scans(data: &Path) -> Vec<PathBuf> {
    let all = files(data).into_iter();
    all.filter(|file| file.parent().is_some_and(|folder| folder.ends_with("meshes_ply"))).collect()
}

fn move_points(scan: &Path, place: impl Fn(Vec3) -> Vec3) {
    let mut mesh = read_mesh(scan).unwrap().mesh;
    mesh.vertices.iter_mut().for_each(|vertex| *vertex = place(*vertex));
    write_ply(scan, &mesh).unwrap();
}

#[test]
fn a_turned_subject_is_refused_then_mended_without_a_change_to_its_files() {
    let (_folder, data, body) = subject();
    scans(&data).iter().for_each(|scan| move_points(scan, |point| Vec3::new(point.x, -point.z, point.y)));
    let before: Vec<_> = files(&data).into_iter().map(|file| (std::fs::read(&file).unwrap(), file)).collect();
    let check = ["check", text(&data), "--body", body];
    let fix = [&check[..], &["--fix"]].concat();
    assert_outcome(&check, 1, &["problem (turned)", "Z up", "--fix", "not ready to train"]);
    assert_outcome(&fix, 0, &["found: ", "mended.toml", "\nready to train"]);
    assert_outcome(&check, 0, &["\nready to train"]);
    assert_outcome(&fix, 0, &["nothing to record"]);
    let (changed, unchanged): (Vec<_>, Vec<_>) =
        files(&data).into_iter().partition(|file| before.iter().all(|(_, old)| old != file));
    assert_eq!(changed, [data.join("mended.toml")]);
    assert!(before.iter().map(|(_, file)| file).eq(&unchanged));
    assert!(before.iter().all(|(bytes, file)| *bytes == std::fs::read(file).unwrap()));
    let printed = assert_outcome(&["info", text(&data)], 0, &["X-Humans", "train/Take1: 3 scans", "mended.toml"]);
    assert!(printed.contains("test/Take2: 1 scans"), "{printed}");
}

#[test]
fn training_refuses_a_faulty_scan_unless_it_is_accepted_or_left_out() {
    let (folder, data, body) = subject();
    // The scans of the test take come first.
    move_points(&scans(&data)[3], |point| point * 1000.0);
    let settings: Vec<&str> = TINY.iter().flat_map(|setting| ["--set", setting]).collect();
    let fixed = ["train", text(&data), "--body", body, "--preset", "demo", "--steps", "3", "--out"];
    let train = |out: &str, more: &[&str], code: i32, words: &[&str]| {
        let out = folder.path().join(out);
        assert_outcome(&[&fixed[..], &[text(&out)], &settings, more].concat(), code, words)
    };
    train("refused", &[], 1, &["train/Take1/f00003", "millimetres", "--accept unit"]);
    train("without", &["--skip-bad-frames"], 0, &["train/Take1/f00003", "millimetres"]);
    train("misnamed", &["--accept", "units"], 2, &["units", "unit"]);
}

#[test]
fn a_report_for_scripts_names_each_finding() {
    let (_folder, data, body) = subject();
    scans(&data).iter().for_each(|scan| move_points(scan, |point| point * 100.0));
    let output = run(&["check", text(&data), "--body", body, "--json", "-"]);
    assert_eq!(output.status.code(), Some(1));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["problems"][0]["name"], "unit", "{report}");
    assert!(report["problems"][0]["message"].as_str().unwrap().contains("centimetres"), "{report}");
    assert!((report["mend"]["scale"].as_f64().unwrap() - 0.01).abs() < 1e-6, "{report}");
}
