//! Other programs that are used where they are there. None is needed to train, measure, pose or export.

use std::path::PathBuf;

use serde::Serialize;

/// A program that something here uses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OptionalProgram {
    /// Its name.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    /// Where it is on the PATH; none if it is not.
    pub path: Option<PathBuf>,
}

/// Names, those under which the program may be installed, and purposes.
const PROGRAMS: [(&str, &[&str], &str); 4] = [
    ("ffmpeg", &["ffmpeg"], "films as MP4"),
    ("tensorboard", &["tensorboard"], "shows a run's losses while it trains"),
    ("npm", &["npm"], "tests only: fetches the validator of exported GLB files"),
    (
        "chromium",
        &["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"],
        "tests only: opens reports and the viewer",
    ),
];

/// All such programs, found or not.
pub fn optional_programs() -> Vec<OptionalProgram> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let find = |name: &&str| {
        let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
        folders.iter().map(|folder| folder.join(&file)).find(|path| path.is_file())
    };
    PROGRAMS
        .into_iter()
        .map(|(name, names, purpose)| OptionalProgram { name, purpose, path: names.iter().find_map(find) })
        .collect()
}
