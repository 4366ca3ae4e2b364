//! The tool as a process, and what its tests share: a small data set that it writes itself, and an avatar trained on that.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use tempfile::TempDir;

/// Networks and samples so small that a step takes milliseconds.
pub(super) const TINY: [&str; 9] = [
    "fields.geometry.width=16",
    "fields.geometry.grid.log2_entries=10",
    "fields.texture.width=16",
    "fields.texture.grid.log2_entries=10",
    "fields.skinning.spacing=0.12",
    "fields.skinning.fine_spacing=0.06",
    "sampling.points=200",
    "schedule.pretraining_steps=40",
    "schedule.checkpoint_steps=5",
];

pub(super) fn xavatar(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xavatar"));
    command.args(arguments).stdin(Stdio::null());
    command
}

pub(super) fn run(arguments: &[&str]) -> Output {
    xavatar(arguments).output().unwrap()
}

/// The exit code and everything that was printed.
pub(super) fn outcome(arguments: &[&str]) -> (i32, String) {
    let output = run(arguments);
    let printed = [output.stdout, output.stderr].concat();
    (output.status.code().unwrap(), String::from_utf8(printed).unwrap())
}

pub(super) fn assert_outcome(arguments: &[&str], code: i32, words: &[&str]) -> String {
    let (found, printed) = outcome(arguments);
    assert_eq!(found, code, "{arguments:?}\n{printed}");
    for word in words {
        assert!(printed.contains(word), "{arguments:?} does not say {word:?}:\n{printed}");
    }
    assert!(!printed.contains("panicked") && !printed.contains("stack backtrace"), "{printed}");
    printed
}

pub(super) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A subject's folder, and its body model's.
pub(super) fn data() -> (&'static str, &'static str) {
    static DATA: OnceLock<(TempDir, String, String)> = OnceLock::new();
    let (_, data, body) = DATA.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("mannequin");
        assert_outcome(&["demo", "--smoke", "--write-data", text(&data)], 0, &["xavatar check"]);
        let body = data.join("body");
        (folder, text(&data).into(), text(&body).into())
    });
    (data, body)
}

/// The arguments that train a tiny avatar for so many steps.
pub(super) fn training(out: &Path, steps: usize) -> Vec<String> {
    let (data, body) = data();
    let fixed = ["train", data, "--body", body, "--out", text(out), "--preset", "demo"];
    let settings = TINY.iter().flat_map(|setting| ["--set", setting]);
    fixed.into_iter().chain(settings).map(str::to_owned).chain(["--steps".into(), steps.to_string()]).collect()
}

pub(super) fn borrowed(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

/// A run that was trained to its end, once for all tests.
pub(super) fn trained() -> &'static str {
    static RUN: OnceLock<(TempDir, String)> = OnceLock::new();
    let (_, run) = RUN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        let arguments = training(&run, 10);
        assert_outcome(&borrowed(&arguments), 0, &["avatar.safetensors", "xavatar eval", "xavatar animate"]);
        (folder, text(&run).into())
    });
    run
}
