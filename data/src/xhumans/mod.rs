//! The X-Humans layout: a subject's scans and the SMPL-X parameters registered to them.
//!
//! ```text
//! <subject>/gender.txt, mean_shape_smplx.npy
//! <subject>/{train,test}/<sequence>/SMPLX/mesh-fXXXXX_smplx.pkl
//!                                   meshes_pkl/mesh-fXXXXX.pkl, atlas-fXXXXX.pkl   (raw: textured)
//!                                   meshes_ply/mesh-fXXXXX.ply                     (preprocessed: coloured vertices)
//! ```
//! Where both kinds of scan are there, the raw one is read, because it has a texture. Shape is the subject's mean shape,
//! never the frames' own `betas`; hand poses are relative to the mean hand. Metres, Y up.

mod parameters;
mod raw;
mod write;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub use raw::FrameFolder;
pub use write::{write_common, write_subject};

pub(super) use parameters::parameters_of;
pub(super) use write::{create_folder, write_parameters};

use xavatar_body::{Gender, smplx};
use xavatar_formats::{Error, Result, read_npy, read_text};

pub(super) const SHAPE_FILE: &str = "mean_shape_smplx.npy";
pub(super) const GENDER_FILE: &str = "gender.txt";
const PARAMETERS: &str = "SMPLX";
const COLOURED_SCANS: &str = "meshes_ply";
const RAW_SCANS: &str = "meshes_pkl";

/// What is common to a subject's frames, scans or pictures.
pub(super) struct Common {
    pub(super) gender: Gender,
    pub(super) betas: Vec<f32>,
}

impl Common {
    /// Reads `gender.txt` and the mean shape in a subject's folder.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let missing =
            |path: PathBuf, what: &str, remedy: &str| Error::Missing { path, what: what.into(), remedy: remedy.into() };
        if !folder.is_dir() {
            return Err(missing(
                folder.into(),
                "subject folder",
                "give the folder that holds gender.txt, train and test",
            ));
        }
        let gender_path = folder.join(GENDER_FILE);
        if !gender_path.exists() {
            return Err(missing(gender_path, "the subject's gender", "write neutral, male or female into it"));
        }
        Ok(Self { gender: gender_in(&gender_path)?, betas: mean_shape(&folder.join(SHAPE_FILE))? })
    }
}

/// The gender that a file states.
pub(super) fn gender_in(path: &Path) -> Result<Gender> {
    let text = read_text(path)?;
    text.parse().map_err(|_| Error::Mismatch {
        path: path.into(),
        found: xavatar_formats::excerpt(text.trim()),
        expected: "neutral, male or female".into(),
        remedy: "write the gender of the registered body model".into(),
    })
}

pub(super) fn mean_shape(path: &Path) -> Result<Vec<f32>> {
    if !path.exists() {
        return Err(Error::Missing {
            path: path.into(),
            what: "the subject's mean shape".into(),
            remedy: "copy it from the data set; the frames' own betas are not a substitute".into(),
        });
    }
    let array = read_npy(path)?;
    let betas = array.to_f32().filter(|values| values.iter().all(|value| value.is_finite()));
    betas.filter(|values| values.len() == smplx::SHAPES).ok_or_else(|| Error::Mismatch {
        path: path.into(),
        found: array.description(),
        expected: "10 finite shape coefficients".into(),
        remedy: "use the shape that the frames were registered with".into(),
    })
}

/// The names and folders of a split's sequences, sorted; none if there is no such split.
pub(super) fn sequences_of(subject: &Path, split: &str) -> Result<Vec<(String, PathBuf)>> {
    let folder = subject.join(split);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let names = file_names(&folder)?.into_iter().map(|name| (name.clone(), folder.join(name)));
    Ok(names.filter(|(_, folder)| folder.is_dir()).collect())
}

pub(super) fn parameters_path(sequence: &Path, number: u32) -> PathBuf {
    sequence.join(PARAMETERS).join(format!("mesh-f{number:05}_smplx.pkl"))
}

/// The parameter files of a sequence, given its folder or the `SMPLX` folder in it, by frame number.
pub(super) fn motion_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let in_sequence = parameter_files(folder)?;
    let files = if in_sequence.is_empty() { numbered_parameters(folder)? } else { in_sequence };
    Ok(files.into_values().collect())
}

/// The parameter files in the `SMPLX` folder of a sequence, by frame number.
pub(super) fn parameter_files(sequence: &Path) -> Result<BTreeMap<u32, PathBuf>> {
    numbered_parameters(&sequence.join(PARAMETERS))
}

fn numbered_parameters(folder: &Path) -> Result<BTreeMap<u32, PathBuf>> {
    numbered_files(folder, "mesh-f", "_smplx.pkl")
}

/// The files of a folder whose names are a number between `prefix` and `suffix`; none if there is no such folder.
pub(super) fn numbered_files(folder: &Path, prefix: &str, suffix: &str) -> Result<BTreeMap<u32, PathBuf>> {
    if !folder.is_dir() {
        return Ok(BTreeMap::new());
    }
    let numbered = |name: String| {
        let digits = name.strip_prefix(prefix)?.strip_suffix(suffix)?;
        let number = digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())??;
        Some((number, folder.join(&name)))
    };
    Ok(file_names(folder)?.into_iter().filter_map(numbered).collect())
}

/// The names in a folder, sorted, hidden ones left out.
pub(super) fn file_names(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let name = entry.map_err(Error::io(folder))?.file_name();
        // Names that are not Unicode cannot be those of the layout.
        names.extend(name.into_string().ok().filter(|name| !name.starts_with('.')));
    }
    names.sort();
    Ok(names)
}
