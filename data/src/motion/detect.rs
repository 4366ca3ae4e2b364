//! Which format a file is in: by what it starts with, then by the arrays that it holds. Its name decides nothing but which
//! frame of a folder it is.

use std::path::Path;

use super::parameters::{self, Choice};
use super::{Motion, Wanted, amass, bvh, folder, grab, own};
use crate::xhumans::parameters_of;
use xavatar_body::smplx;
use xavatar_formats::{Array, ArrayFile, ArrayMap, Container, Error, Result, excerpt, read_bytes};

/// Bytes that tell what a file is, with comments before them.
const START: usize = 4096;

/// A format of arrays.
struct Format {
    name: &'static str,
    /// What arrays lack to be in it.
    recognised: fn(Container, &ArrayMap) -> std::result::Result<(), String>,
    read: fn(&Path, &ArrayMap, &mut Choice) -> Result<Motion>,
}

/// The formats of arrays, the more particular ones first.
const FORMATS: [Format; 5] = [
    Format { name: "our own npz", recognised: own::recognised, read: |path, arrays, _| own::read(path, arrays) },
    Format {
        name: "X-Humans frame",
        recognised: is_xhumans_frame,
        read: |path, arrays, _| Ok(xhumans_motion(path, vec![parameters_of(path, arrays)?])),
    },
    Format {
        name: "AMASS",
        recognised: |_, arrays| amass::recognised(arrays),
        read: |path, arrays, _| amass::read(path, arrays),
    },
    Format {
        name: "GRAB",
        recognised: |_, arrays| grab::recognised(arrays),
        read: |path, arrays, _| grab::read(path, arrays),
    },
    Format {
        name: "body parameters by name",
        recognised: |_, arrays| parameters::recognised(arrays),
        read: parameters::read,
    },
];

/// Reads a file of any format, or a folder of one file a frame.
pub(super) fn read(path: &Path, wanted: &Wanted) -> Result<Motion> {
    let mut choice = Choice { coordinates: wanted.coordinates, person: None };
    if path.is_dir() { folder::read(path, wanted, &mut choice) } else { read_file(path, wanted, &mut choice) }
}

/// Reads a file of any format; of several people the one that was read before.
pub(super) fn read_file(path: &Path, wanted: &Wanted, choice: &mut Choice) -> Result<Motion> {
    if !path.exists() {
        return Err(Error::Missing {
            path: path.into(),
            what: "a motion".into(),
            remedy:
                "give a BVH, npz, npy, pickle, PyTorch or JSON file, or a folder of one file a frame (docs/motion.md)"
                    .into(),
        });
    }
    parse(path, &read_bytes(path)?, wanted, choice)
}

/// Reads the content of the file at `path`.
pub(super) fn parse(path: &Path, bytes: &[u8], wanted: &Wanted, choice: &mut Choice) -> Result<Motion> {
    let start = &bytes[..bytes.len().min(START)];
    if bvh::is_bvh(start) {
        return bvh::parse(path, bytes, wanted.rest, wanted.bone_map);
    }
    let Some(file) = ArrayFile::parse(path, bytes)? else { return Err(unrecognised(path, other_content(start))) };
    let columns = file.single().map(|array| parameters::motion_x(array).ok_or_else(|| one_array(path, array)));
    let columns = columns.transpose()?;
    let arrays = columns.as_ref().unwrap_or(&file.arrays);
    if let Some(format) = FORMATS.iter().find(|format| (format.recognised)(file.container, arrays).is_ok()) {
        return (format.read)(path, arrays, choice);
    }
    if arrays.keys().any(|key| MOMENTUM.iter().any(|name| key == name || key.ends_with(&format!(".{name}")))) {
        return Err(of_another_rig(path));
    }
    let names: Vec<&str> = arrays.keys().map(String::as_str).take(20).collect();
    let lacks =
        FORMATS.iter().filter_map(|format| Some((format.name, (format.recognised)(file.container, arrays).err()?)));
    let mut tried: Vec<String> = lacks.map(|(format, lack)| format!("{format}: {lack}")).collect();
    tried.push("BVH: it does not begin with HIERARCHY".into());
    tried.push(format!("it holds the arrays {}", excerpt(&names.join(", "))));
    Err(unrecognised(path, tried))
}

fn unrecognised(path: &Path, tried: Vec<String>) -> Error {
    Error::Unrecognised { path: path.into(), what: "motion", tried, remedy: "docs/motion.md has the formats".into() }
}

/// Arrays of the Momentum Human Rig, as SAM 3D Body's results have them.
const MOMENTUM: [&str; 2] = ["mhr_model_params", "body_pose_params"];

/// That a file's numbers are not turns of SMPL-X's joints.
fn of_another_rig(path: &Path) -> Error {
    Error::Mismatch {
        path: path.into(),
        found: "parameters of the Momentum Human Rig, as SAM 3D Body writes them".into(),
        expected: "turns of SMPL-X's or SMPL's joints".into(),
        remedy: "make a pose of SMPL-X of them: xavatar body import mhr MODEL --person RESULT.npz --pose POSE.npz --out BODY.npz".into(),
    }
}

/// That a file holds one array without a name, which may be anything.
fn one_array(path: &Path, array: &Array) -> Error {
    let known = match array.shape[..] {
        [_, 263] => ": features of HumanML3D, which are no rotations",
        [_, 17..=144, 3] => ": places of joints, which are no rotations",
        _ => "",
    };
    Error::Mismatch {
        path: path.into(),
        found: format!("one array, {}{known}", array.description()),
        expected: "rows of 322 numbers (Motion-X), or arrays by name".into(),
        remedy: "if these are rotations, save them by name: numpy.savez(\"motion.npz\", poses=ROTATIONS, trans=PLACES) (docs/motion.md)"
            .into(),
    }
}

/// Why a file that starts like this is none that can be read.
fn other_content(start: &[u8]) -> Vec<String> {
    let begins = match start {
        [] => "it is empty".to_owned(),
        _ => format!("it begins with {}", excerpt(&String::from_utf8_lossy(&start[..start.len().min(16)]))),
    };
    [
        "npz, PyTorch (ours, AMASS, GRAB, body parameters by name): it is no zip archive",
        "pickle, npy, JSON: it does not begin like one, nor is it one compressed by zlib or gzip",
        "BVH: it does not begin with HIERARCHY",
    ]
    .into_iter()
    .map(str::to_owned)
    .chain([begins])
    .collect()
}

fn is_xhumans_frame(container: Container, arrays: &ArrayMap) -> std::result::Result<(), String> {
    if container != Container::Pickle {
        return Err("it is no pickle".into());
    }
    for (name, numbers) in smplx::Parameters::NAMED {
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

/// Frames of X-Humans as a motion.
pub(super) fn xhumans_motion(source: &Path, frames: Vec<smplx::Parameters>) -> Motion {
    Motion {
        frames,
        source: format!("{} (X-Humans frames)", source.display()),
        zeroed: vec!["betas".into()],
        up_is_certain: true,
        ..Motion::default()
    }
}
