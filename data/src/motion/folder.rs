//! Folders of one file a frame: in the order of the numbers in their names, and of one person.

use std::path::{Path, PathBuf};

use super::parameters::Choice;
use super::{Motion, Wanted, detect};
use crate::xhumans::{motion_files, parameters_of};
use xavatar_formats::{Error, Result, read_pickle_arrays};

/// What ROMP writes beside its frames: all of them, with people told apart.
const WHOLE: &str = "video_results.npz";
/// Files that may be a frame.
const FRAMES: [&str; 6] = ["npz", "npy", "pkl", "json", "pt", "pth"];

/// Reads a folder's motion.
pub(super) fn read(folder: &Path, wanted: &Wanted, choice: &mut Choice) -> Result<Motion> {
    let files = motion_files(folder)?;
    if !files.is_empty() {
        let frame = |file: &PathBuf| parameters_of(file, &read_pickle_arrays(file)?);
        let frames = files.iter().map(frame).collect::<Result<_>>()?;
        return Ok(detect::xhumans_motion(folder, frames));
    }
    let whole = folder.join(WHOLE);
    if whole.is_file() {
        return detect::read_file(&whole, wanted, choice);
    }
    let (files, note) = frame_files(folder)?;
    let mut motion: Option<Motion> = None;
    for file in &files {
        let frame = detect::read_file(file, wanted, choice)?;
        match &mut motion {
            None => motion = Some(frame),
            Some(motion) => {
                motion.frames.extend(frame.frames);
                motion.notes.extend(frame.notes.into_iter().filter(|note| !note.starts_with("the file's longest")));
            }
        }
    }
    let mut motion = motion.ok_or_else(|| Error::Missing {
        path: folder.into(),
        what: "a frame (mesh-f00001_smplx.pkl, or .npz, .npy, .pkl, .json or .pt files numbered in order)".into(),
        remedy: "give a folder of one file a frame, or a file (docs/motion.md)".into(),
    })?;
    motion.source = format!("{} ({} files, the first: {})", folder.display(), files.len(), motion.source);
    let mut said = std::collections::BTreeSet::new();
    motion.notes.retain(|note| said.insert(note.clone()));
    motion.notes.extend(note);
    Ok(motion)
}

/// The files of a folder that may be frames, in the order of the numbers in their names. Of names like 00012_1, a frame and a person,
/// those of the person with the most frames, and a note about the others.
fn frame_files(folder: &Path) -> Result<(Vec<PathBuf>, Option<String>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
        if extension.is_some_and(|extension| FRAMES.contains(&extension.as_str())) {
            files.push((numbers_in(&path), path));
        }
    }
    files.sort();
    if files.is_empty() || files.iter().any(|(numbers, _)| numbers.len() != 2) {
        return Ok((files.into_iter().map(|(_, path)| path).collect(), None));
    }
    let mut people = std::collections::BTreeMap::<u64, Vec<PathBuf>>::new();
    for (numbers, path) in files {
        people.entry(numbers[1]).or_default().push(path);
    }
    let count = people.len();
    // The first of those with the most.
    let longest = people.into_iter().rev().max_by_key(|(_, files)| files.len());
    let Some((person, files)) = longest else { return Ok((Vec::new(), None)) };
    let note = (count > 1).then(|| format!("the files are of {count} people; only those of person {person} are read"));
    Ok((files, note))
}

fn numbers_in(path: &Path) -> Vec<u64> {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    stem.split(|character: char| !character.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}
