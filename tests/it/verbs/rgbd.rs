//! The verbs on RGB-D frames as scripts see them.

use std::path::Path;
use std::process::{Command, Stdio};

use xavatar::avatar::Avatar;
use xavatar::config::Config;

/// The exit code and everything that was printed.
fn outcome(arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_xavatar")).args(arguments).stdin(Stdio::null()).output().unwrap();
    let printed = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(!printed.contains("panicked"), "{printed}");
    (output.status.code().unwrap(), printed)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn the_demo_learns_from_pictures_alone() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let demo = ["demo", "--smoke", "--rgbd", "--out", text(&out)];
    let (code, printed) = outcome(&demo);
    assert_eq!(code, 0, "{printed}");
    for file in ["pictures.png", "demo.png", "metrics.json", "meshes/canonical.ply", Avatar::FILE] {
        assert!(out.join(file).is_file(), "{file}\n{printed}");
    }
    assert!(Config::read(&out.join("config.toml")).unwrap().rgbd.is_some());
    let (code, printed) = outcome(&demo);
    assert_eq!(code, 1);
    assert!(printed.contains("not empty"), "{printed}");
}

/// Copies a folder's files and folders.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let (from, to) = (entry.as_ref().unwrap().path(), to.join(entry.unwrap().file_name()));
        if from.is_dir() {
            copy(&from, &to);
        } else {
            std::fs::copy(from, to).unwrap();
        }
    }
}

#[test]
fn the_data_choose_the_preset_and_a_turn_is_seen_part_by_part() {
    let folder = tempfile::tempdir().unwrap();
    let (scans, pictures) = (folder.path().join("scans"), folder.path().join("pictures"));
    assert_eq!(outcome(&["demo", "--smoke", "--write-data", text(&scans)]).0, 0);
    let (code, printed) = outcome(&["render-rgbd", text(&scans), "--steps-per-turn", "3", "--out", text(&pictures)]);
    assert_eq!(code, 0, "{printed}");
    let (body, run) = (scans.join("body"), folder.path().join("run"));
    let tiny: Vec<&str> = ["sampling.points=300", "schedule.pretraining_steps=20", "fields.skinning.spacing=0.12"]
        .into_iter()
        .flat_map(|setting| ["--set", setting])
        .chain(["--steps", "6"])
        .collect();
    let train = ["train", text(&pictures), "--body", text(&body), "--out", text(&run), "--preset", "demo"];
    let (code, printed) = outcome(&[&train[..], &tiny].concat());
    assert_eq!(code, 0, "{printed}");
    assert_eq!(Config::read(&run.join("config.toml")).unwrap().preset, "demo-rgbd");
    let (code, printed) = outcome(&[&train[..], &["--resume", "--from", "scans"]].concat());
    assert!(code == 2 && printed.contains("other frames"), "{printed}");

    copy(&scans, &pictures);
    let out = folder.path().join("fusion");
    let fuse = ["fuse", text(&pictures), "--body", text(&body), "--out", text(&out), "--preset", "demo"];
    let fuse = [&fuse[..], &["--turns", "360,120", "--resolution", "48"], &tiny].concat();
    let (code, printed) = outcome(&fuse);
    assert_eq!(code, 0, "{printed}");
    let table: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("fusion.json")).unwrap()).unwrap();
    let trained_on: Vec<_> = table["rows"].as_array().unwrap().iter().map(|row| row["trained_on"].as_u64()).collect();
    assert_eq!(trained_on, [Some(1), Some(3)], "one view, then all around");
    assert!(
        std::fs::read_to_string(out.join("fusion.svg")).unwrap().contains("class=\"first\"")
            && out.join("fusion.md").is_file()
    );
    let (code, printed) = outcome(&fuse);
    assert!(code == 0 && printed.contains("360 degrees: trained already"), "{printed}");
}

#[test]
fn where_there_are_no_pictures_scans_are_learned_from_or_an_error_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("mannequin");
    let (code, printed) = outcome(&["demo", "--smoke", "--write-data", text(&data)]);
    assert_eq!(code, 0, "{printed}");
    let (body, run) = (data.join("body"), folder.path().join("run"));
    let train = ["train", text(&data), "--body", text(&body), "--out", text(&run), "--from", "rgbd"];
    let (code, printed) = outcome(&train);
    assert_eq!(code, 1);
    assert!(printed.contains("RGB-D") && printed.contains("render"), "{printed}");
    let out = folder.path().join("fusion");
    let (code, printed) = outcome(&["fuse", text(&data), "--body", text(&body), "--out", text(&out)]);
    assert_eq!(code, 1);
    assert!(printed.contains("RGB-D") && !out.exists(), "{printed}");
    for turns in ["0", "-90", "many"] {
        let turns = format!("--turns={turns}");
        let (code, printed) = outcome(&["fuse", text(&data), "--body", text(&body), "--out", text(&out), &turns]);
        assert_eq!(code, 2, "{printed}");
    }
}
