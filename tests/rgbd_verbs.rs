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
