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

mod frame;
mod write;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

pub use frame::read_frame;
pub use write::write_subject;

pub(super) use frame::parameters_of;
pub(super) use write::{create_folder, write_common, write_parameters};

use super::{FrameFiles, FrameId};
use xavatar_body::Gender;
use xavatar_formats::{Error, Result, read_npy, read_text};

const SHAPE_FILE: &str = "mean_shape_smplx.npy";
const GENDER_FILE: &str = "gender.txt";
const PARAMETERS: &str = "SMPLX";
const RAW_SCANS: &str = "meshes_pkl";
const COLOURED_SCANS: &str = "meshes_ply";

/// A subject on disk: what is common to its frames, and which frames there are.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The subject's folder.
    pub folder: PathBuf,
    /// Which body model fits the subject.
    pub gender: Gender,
    /// Shape coefficients beta, common to all frames.
    pub betas: [f32; 10],
    /// Training frames, by sequence and number.
    pub train: Vec<FrameFiles>,
    /// Test frames, by sequence and number.
    pub test: Vec<FrameFiles>,
}

impl Subject {
    /// Finds the frames of the subject in `folder`, without reading them.
    ///
    /// A frame of which one file is there counts, so that [`read_frame`] can say what it lacks.
    ///
    /// # Errors
    /// [`Error::Missing`] if the folder, the gender or shape file or every frame is missing; [`Error::Mismatch`] or
    /// [`Error::Malformed`] if the gender is none of the three or the mean shape is not 10 finite numbers.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        let Common { gender, betas } = Common::read(folder)?;
        let subject = Self {
            folder: folder.into(),
            gender,
            betas,
            train: frames_of_split(folder, "train")?,
            test: frames_of_split(folder, "test")?,
        };
        if subject.train.is_empty() && subject.test.is_empty() {
            return Err(Error::Missing {
                path: folder.into(),
                what: "a frame (train/<sequence>/SMPLX/mesh-f00001_smplx.pkl with its scan)".into(),
                remedy: "check that this is one subject's folder, unpacked whole".into(),
            });
        }
        Ok(subject)
    }
}

/// What is common to a subject's frames, scans or pictures.
pub(super) struct Common {
    pub(super) gender: Gender,
    pub(super) betas: [f32; 10],
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
        let text = read_text(&gender_path)?;
        let gender = text.parse().map_err(|_| Error::Mismatch {
            path: gender_path,
            found: xavatar_formats::excerpt(text.trim()),
            expected: "neutral, male or female".into(),
            remedy: "write the gender of the registered body model".into(),
        })?;
        Ok(Self { gender, betas: mean_shape(&folder.join(SHAPE_FILE))? })
    }
}

pub(super) fn mean_shape(path: &Path) -> Result<[f32; 10]> {
    if !path.exists() {
        return Err(Error::Missing {
            path: path.into(),
            what: "the subject's mean shape".into(),
            remedy: "copy it from the data set; the frames' own betas are not a substitute".into(),
        });
    }
    let array = read_npy(path)?;
    let betas = array.to_f32().filter(|values| values.iter().all(|value| value.is_finite()));
    betas.and_then(|values| values.try_into().ok()).ok_or_else(|| Error::Mismatch {
        path: path.into(),
        found: array.description(),
        expected: "10 finite shape coefficients".into(),
        remedy: "use the shape of the 10-coefficient SMPL-X model".into(),
    })
}

fn frames_of_split(subject: &Path, split: &str) -> Result<Vec<FrameFiles>> {
    let mut frames = Vec::new();
    for (sequence, folder) in sequences_of(subject, split)? {
        frames.extend(frames_of_sequence(&folder, split, &sequence)?);
    }
    Ok(frames)
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

fn frames_of_sequence(folder: &Path, split: &str, sequence: &str) -> Result<Vec<FrameFiles>> {
    let raw = numbered_files(&folder.join(RAW_SCANS), "mesh-f", ".pkl")?;
    let coloured = numbered_files(&folder.join(COLOURED_SCANS), "mesh-f", ".ply")?;
    let parameters = parameter_files(folder)?;
    let numbers: BTreeSet<u32> = [&raw, &coloured, &parameters].into_iter().flat_map(BTreeMap::keys).copied().collect();
    let frame = |number: u32| {
        let is_raw = raw.contains_key(&number) || !coloured.contains_key(&number);
        let scan = if is_raw { raw.get(&number) } else { coloured.get(&number) };
        FrameFiles {
            id: FrameId { split: split.into(), sequence: sequence.into(), number },
            scan: scan.cloned().unwrap_or_else(|| folder.join(RAW_SCANS).join(format!("mesh-f{number:05}.pkl"))),
            atlas: is_raw.then(|| folder.join(RAW_SCANS).join(format!("atlas-f{number:05}.pkl"))),
            parameters: parameters.get(&number).cloned().unwrap_or_else(|| parameters_path(folder, number)),
        }
    };
    Ok(numbers.into_iter().map(frame).collect())
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
