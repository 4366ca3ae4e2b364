//! Which format a file is in: by what it starts with, then by the arrays that it holds. Its name decides nothing but which
//! frame of a folder it is.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::{Motion, Wanted, amass, bvh, grab, named, own};
use crate::xhumans::{motion_files, parameters_of};
use xavatar_body::BodyParameters;
use xavatar_formats::{ArrayMap, Error, Result, excerpt, open_file, read_npz, read_pickle_arrays};

/// Bytes that tell what a file is.
const START: u64 = 256;
/// How a file of arrays is packed.
#[derive(Clone, Copy, PartialEq)]
enum Container {
    Npz,
    Pickle,
}

/// Whether arrays are in a format, or what they lack; its reader; its name.
type Format =
    (&'static str, fn(Container, &ArrayMap) -> std::result::Result<(), String>, fn(&Path, &ArrayMap) -> Result<Motion>);

/// The formats of arrays, the more particular ones first.
const FORMATS: [Format; 5] = [
    ("our own npz", |_, arrays| own::recognised(arrays), own::read),
    ("X-Humans frame", is_xhumans_frame, read_xhumans_frame),
    ("AMASS", |_, arrays| amass::recognised(arrays), amass::read),
    ("GRAB", |_, arrays| grab::recognised(arrays), grab::read),
    ("SMPL-X parameters", |_, arrays| named::recognised(arrays), named::read),
];

/// Reads a file of any format, or a folder of one file a frame.
pub(super) fn read(path: &Path, wanted: &Wanted) -> Result<Motion> {
    if path.is_dir() {
        return read_folder(path, wanted);
    }
    if !path.exists() {
        return Err(Error::Missing {
            path: path.into(),
            what: "a motion".into(),
            remedy: "give an npz, pickle or BVH file, or a folder of one file a frame (docs/motion.md)".into(),
        });
    }
    let start = start_of(path)?;
    if bvh::is_bvh(&start) {
        return bvh::read(path, wanted.rest, wanted.bone_map);
    }
    let is_pickle = start.first() == Some(&0x80) || path.extension().is_some_and(|name| name == "pkl");
    let (container, arrays) = if start.starts_with(b"PK") {
        (Container::Npz, read_npz(path)?)
    } else if is_pickle {
        (Container::Pickle, read_pickle_arrays(path)?)
    } else {
        return Err(unrecognised(path, other_content(&start)));
    };
    if let Some((.., read)) = FORMATS.iter().find(|(_, recognised, _)| recognised(container, &arrays).is_ok()) {
        return read(path, &arrays);
    }
    let names: Vec<&str> = arrays.keys().map(String::as_str).take(20).collect();
    let lacks =
        FORMATS.iter().filter_map(|(format, recognised, _)| Some((*format, recognised(container, &arrays).err()?)));
    let mut tried: Vec<String> = lacks.map(|(format, lack)| format!("{format}: {lack}")).collect();
    tried.push("BVH: it does not begin with HIERARCHY".into());
    tried.push(format!("it holds the arrays {}", excerpt(&names.join(", "))));
    Err(unrecognised(path, tried))
}

fn unrecognised(path: &Path, tried: Vec<String>) -> Error {
    Error::Unrecognised { path: path.into(), what: "motion", tried, remedy: "docs/motion.md has the formats" }
}

fn start_of(path: &Path) -> Result<Vec<u8>> {
    let mut start = Vec::new();
    open_file(path)?.take(START).read_to_end(&mut start).map_err(Error::io(path))?;
    Ok(start)
}

/// Why a file that starts like this is none that can be read.
fn other_content(start: &[u8]) -> Vec<String> {
    let begins = match start {
        [] => "it is empty".to_owned(),
        [b'x', ..] | [0x1f, 0x8b, ..] => "it is compressed: save it again without compression".to_owned(),
        _ => format!("it begins with {}", excerpt(&String::from_utf8_lossy(&start[..start.len().min(16)]))),
    };
    [
        "npz (ours, AMASS, GRAB, SMPL-X parameters): it is no zip archive",
        "pickle: it does not begin like one",
        "BVH: it does not begin with HIERARCHY",
    ]
    .into_iter()
    .map(str::to_owned)
    .chain([begins])
    .collect()
}

/// The names of an X-Humans frame's parameters, and how many numbers each has.
const XHUMANS: [(&str, usize); 9] = [
    ("global_orient", 3),
    ("body_pose", 63),
    ("left_hand_pose", 45),
    ("right_hand_pose", 45),
    ("jaw_pose", 3),
    ("leye_pose", 3),
    ("reye_pose", 3),
    ("expression", 10),
    ("transl", 3),
];

fn is_xhumans_frame(container: Container, arrays: &ArrayMap) -> std::result::Result<(), String> {
    if container != Container::Pickle {
        return Err("it is no pickle".into());
    }
    for (name, numbers) in XHUMANS {
        match arrays.get(name) {
            None => return Err(format!("no `{name}`")),
            Some(array) if array.to_f32().is_none_or(|values| values.len() != numbers) => {
                return Err(format!("`{name}` is {}, not {numbers} numbers", array.description()));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

fn read_xhumans_frame(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    Ok(xhumans_motion(path, vec![parameters_of(path, arrays)?]))
}

fn xhumans_motion(source: &Path, frames: Vec<BodyParameters>) -> Motion {
    Motion {
        frames,
        source: format!("{} (X-Humans frames)", source.display()),
        zeroed: vec!["betas".into()],
        up_is_certain: true,
        ..Motion::default()
    }
}

fn read_folder(folder: &Path, wanted: &Wanted) -> Result<Motion> {
    let files = motion_files(folder)?;
    if !files.is_empty() {
        let frame = |file: &PathBuf| parameters_of(file, &read_pickle_arrays(file)?);
        let frames = files.iter().map(frame).collect::<Result<_>>()?;
        return Ok(xhumans_motion(folder, frames));
    }
    let (files, note) = frame_files(folder)?;
    let mut motions = files.iter().map(|file| read(file, wanted));
    let mut motion = motions.next().unwrap_or_else(|| {
        Err(Error::Missing {
            path: folder.into(),
            what: "a frame (mesh-f00001_smplx.pkl, or .npz or .pkl files numbered in order)".into(),
            remedy: "give a folder of one file a frame, or a file (docs/motion.md)".into(),
        })
    })?;
    for other in motions {
        motion.frames.extend(other?.frames);
    }
    motion.source = format!("{} ({} files, the first: {})", folder.display(), files.len(), motion.source);
    motion.notes.extend(note);
    Ok(motion)
}

/// The .npz and .pkl files of a folder in the order of the numbers in their names. Of names like 00012_1, a frame and a person,
/// those of the person with the most frames, and a note about the others.
fn frame_files(folder: &Path) -> Result<(Vec<PathBuf>, Option<String>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        if path.extension().is_some_and(|extension| extension == "npz" || extension == "pkl") {
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
