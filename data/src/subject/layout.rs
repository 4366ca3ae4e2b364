//! How subjects' folders are laid out, and where in each the scans and registrations are (docs/formats.md).
//!
//! A *sequence* is a folder with scans and registrations, in folders of their own or side by side. Sequences stand under
//! `train/` and `test/`, under the subject, or the subject's folder is one. What a layout's numbers mean is [`Conventions`].

use std::path::{Path, PathBuf};

use super::pairing::{Paired, is_registered_mesh, paired};
use super::rules::{Conventions, HandZero};
use crate::placement::Origin;
use crate::xhumans::file_names;
use xavatar_body::Gender;
use xavatar_formats::{Error, Result};

/// Names of folders with scans, the better kind first where a sequence has several: a texture says more than vertex colours.
const SCAN_FOLDERS: [&str; 8] =
    ["meshes_pkl", "meshes_glb", "meshes_obj", "meshes_ply", "meshes", "scans", "scan", "mesh"];
/// Names of folders with registrations.
const FIT_FOLDERS: [&str; 8] =
    ["smplx", "fits", "fit", "smplx_params", "params", "registrations", "registration", "smplx_fits"];
/// Kinds of scans, by extension.
const SCANS: [&str; 5] = ["glb", "gltf", "obj", "ply", "pkl"];
/// Kinds of registrations.
const FITS: [&str; 3] = ["pkl", "npz", "json"];
/// A file of 4D-DRESS sequences.
pub(super) const DRESS_INFO: &str = "basic_info.pkl";
/// What all registrations of THuman2 are called.
const THUMAN_FIT: &str = "smplx_param.pkl";

/// How a subject's folder is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `train/<sequence>/SMPLX`, `meshes_pkl` or `meshes_ply`; `gender.txt`, `mean_shape_smplx.npy`.
    XHumans,
    /// `<take>/Meshes_pkl`, `SMPLX`, `basic_info.pkl`.
    Dress4d,
    /// `0001/0001.obj` with `smplx_param.pkl`, which scales and moves the body.
    THuman2,
    /// `mesh-f00001.obj` with `mesh-f00001.json`; the body's pelvis is the origin.
    CustomHumans,
    /// `scan.ply` with `scan_smpl.pkl` beside it, as RVH's and other fitting scripts leave it.
    Rvh,
    /// `scans/` and `fits/`, or what a `subject.toml` names.
    Plain,
}

impl Layout {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::XHumans => "X-Humans",
            Self::Dress4d => "4D-DRESS",
            Self::THuman2 => "THuman2",
            Self::CustomHumans => "CustomHumans",
            Self::Rvh => "scans with fits beside them (RVH)",
            Self::Plain => "scans and fits",
        }
    }

    /// What its numbers mean, unless a `subject.toml` says otherwise.
    pub(super) fn conventions(self) -> Conventions {
        match self {
            Self::CustomHumans => {
                Conventions { gender: Some(Gender::Male), hands: HandZero::Flat, origin: Origin::Pelvis }
            }
            Self::THuman2 => Conventions { gender: Some(Gender::Male), ..Conventions::default() },
            _ => Conventions::default(),
        }
    }
}

/// A folder with scans and registrations.
#[derive(Clone, Debug)]
pub(super) struct Sequence {
    /// `train` or `test`, if the folder says so.
    pub split: Option<&'static str>,
    pub name: String,
    pub folder: PathBuf,
    pub frames: Vec<Paired>,
    /// Where its scans and its registrations are.
    pub scan_folder: PathBuf,
    pub fit_folder: PathBuf,
}

/// The sequences of a subject's folder in the layout that it is in; none if it is in no layout.
pub(super) fn find(folder: &Path) -> Result<Option<(Layout, Vec<Sequence>)>> {
    let mut sequences = Vec::new();
    for split in ["train", "test"] {
        let of_split = folder.join(split);
        let found = sequences_under(&of_split)?;
        sequences.extend(found.into_iter().map(|sequence| Sequence { split: Some(split), ..sequence }));
    }
    if sequences.is_empty() {
        sequences = sequences_under(folder)?;
    }
    if sequences.is_empty() {
        several_subjects(folder)?;
        return Ok(None);
    }
    Ok(Some((layout_of(folder, &sequences), sequences)))
}

/// The sequences of a folder of scans, with or without registrations, which are not looked at; none if there are no scans.
pub(super) fn find_scans(folder: &Path) -> Result<Vec<Sequence>> {
    let mut sequences = Vec::new();
    for split in ["train", "test"] {
        let found = sequences_by(scans_alone_in, &folder.join(split))?;
        sequences.extend(found.into_iter().map(|sequence| Sequence { split: Some(split), ..sequence }));
    }
    if sequences.is_empty() { sequences_by(scans_alone_in, folder) } else { Ok(sequences) }
}

/// A sequence whose folders of scans and registrations are named.
pub(super) fn named_sequence(folder: &Path, scans: &Path, fits: &Path) -> Result<Sequence> {
    let (scan_folder, fit_folder) = (folder.join(scans), folder.join(fits));
    let frames = paired(&scans_in(&scan_folder)?, &fits_in(&fit_folder)?);
    Ok(Sequence { split: None, name: name_of(folder), folder: folder.into(), frames, scan_folder, fit_folder })
}

/// The folder as a sequence, or the sequences in it. Folders of one frame each are one sequence.
fn sequences_under(folder: &Path) -> Result<Vec<Sequence>> {
    sequences_by(sequence_in, folder)
}

fn sequences_by(sequence_in: fn(&Path) -> Result<Option<Sequence>>, folder: &Path) -> Result<Vec<Sequence>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    if let Some(sequence) = sequence_in(folder)? {
        return Ok(vec![sequence]);
    }
    let mut sequences = Vec::new();
    for name in file_names(folder)? {
        let inner = folder.join(name);
        if inner.is_dir() {
            sequences.extend(sequence_in(&inner)?);
        }
    }
    let is_one_scan = |sequence: &Sequence| sequence.frames.len() == 1 && sequence.scan_folder == sequence.folder;
    if sequences.len() > 1 && sequences.iter().all(is_one_scan) {
        let frames = sequences.iter().flat_map(|sequence| sequence.frames.clone()).collect();
        let whole = |mut sequence: Sequence| {
            sequence.scan_folder = folder.into();
            Sequence { name: name_of(folder), folder: folder.into(), frames, ..sequence }
        };
        return Ok(sequences.pop().map(whole).into_iter().collect());
    }
    Ok(sequences)
}

/// The scans and registrations of a folder, if it has any of both kinds.
fn sequence_in(folder: &Path) -> Result<Option<Sequence>> {
    let (scan_folders, fit_folders) = (named(folder, &SCAN_FOLDERS)?, named(folder, &FIT_FOLDERS)?);
    let mut sequence = Sequence {
        split: None,
        name: name_of(folder),
        folder: folder.into(),
        frames: Vec::new(),
        scan_folder: scan_folders.first().cloned().unwrap_or_else(|| folder.into()),
        fit_folder: fit_folders.first().cloned().unwrap_or_else(|| folder.into()),
    };
    if !(scan_folders.is_empty() && fit_folders.is_empty()) {
        let mut scans = Vec::new();
        for folder in &scan_folders {
            scans.extend(scans_in(folder)?);
        }
        let mut fits = Vec::new();
        for folder in &fit_folders {
            fits.extend(fits_in(folder)?);
        }
        sequence.frames = paired(&scans, &fits);
        return Ok((!sequence.frames.is_empty()).then_some(sequence));
    }
    // Side by side, or the registration in a folder of the same name elsewhere.
    let scans = files_of(folder, &SCANS[..4])?;
    let mut fits: Vec<PathBuf> = files_of(folder, &FITS)?.into_iter().filter(|path| is_fit(path, &scans)).collect();
    if fits.is_empty() {
        fits = registered_elsewhere(folder)?;
        sequence.fit_folder = fits.first().and_then(|fit| fit.parent()).map_or(sequence.fit_folder, Path::to_path_buf);
    }
    let scans: Vec<PathBuf> = scans.into_iter().filter(|path| !is_registered_mesh(path)).collect();
    if scans.is_empty() || fits.is_empty() {
        return Ok(None);
    }
    sequence.frames = paired(&scans, &fits);
    Ok(Some(sequence))
}

/// The scans of a folder, in a folder of their own or as they are.
fn scans_alone_in(folder: &Path) -> Result<Option<Sequence>> {
    let scan_folder = named(folder, &SCAN_FOLDERS)?.into_iter().next();
    let scans = match &scan_folder {
        Some(scan_folder) => scans_in(scan_folder)?,
        None => files_of(folder, &SCANS[..4])?.into_iter().filter(|path| !is_registered_mesh(path)).collect(),
    };
    let sequence = Sequence {
        split: None,
        name: name_of(folder),
        folder: folder.into(),
        frames: paired(&scans, &[]),
        scan_folder: scan_folder.unwrap_or_else(|| folder.into()),
        fit_folder: folder.into(),
    };
    Ok((!sequence.frames.is_empty()).then_some(sequence))
}

/// Whether a file beside scans is a registration: it is called so, or as a scan is.
fn is_fit(path: &Path, scans: &[PathBuf]) -> bool {
    is_registered_mesh(path)
        || path.file_name().is_some_and(|name| name == THUMAN_FIT)
        || scans.iter().any(|scan| scan.file_stem() == path.file_stem())
}

/// Registrations of the scan in `<mesh>/NAME` that stand in a folder `<...smplx...>/NAME` beside the scan's.
fn registered_elsewhere(folder: &Path) -> Result<Vec<PathBuf>> {
    let Ok(folder) = folder.canonicalize() else { return Ok(Vec::new()) };
    let (Some(name), Some(set)) = (folder.file_name(), folder.parent().and_then(Path::parent)) else {
        return Ok(Vec::new());
    };
    for other in file_names(set).unwrap_or_default() {
        let candidate = set.join(&other).join(name);
        if other.to_ascii_lowercase().contains("smplx") && candidate.is_dir() && candidate != folder {
            return files_of(&candidate, &FITS);
        }
    }
    Ok(Vec::new())
}

/// That a folder is not that of several subjects or outfits, each of which is one.
fn several_subjects(folder: &Path) -> Result<()> {
    let mut inside = Vec::new();
    for name in file_names(folder)? {
        let inner = folder.join(&name);
        let has_sequences = || {
            let splits = ["train", "test"].map(|split| sequences_under(&inner.join(split)));
            let found = splits.into_iter().chain([sequences_under(&inner)]);
            found.into_iter().any(|sequences| sequences.is_ok_and(|sequences| !sequences.is_empty()))
        };
        if inner.is_dir() && has_sequences() {
            inside.push(name);
        }
    }
    if inside.is_empty() {
        return Ok(());
    }
    Err(Error::Mismatch {
        path: folder.into(),
        found: format!("a folder of {} subjects or outfits", inside.len()),
        expected: "one".into(),
        remedy: format!("give one of {}", inside.join(", ")).into(),
    })
}

fn layout_of(folder: &Path, sequences: &[Sequence]) -> Layout {
    let fits = || sequences.iter().flat_map(|sequence| &sequence.frames).filter_map(|frame| frame.fit.as_deref());
    let named = |fit: &Path, ending: &str| fit.to_string_lossy().to_ascii_lowercase().ends_with(ending);
    let side_by_side = sequences.iter().all(|sequence| sequence.scan_folder == sequence.folder);
    if fits().any(|fit| named(fit, THUMAN_FIT)) {
        Layout::THuman2
    } else if sequences.iter().any(|sequence| sequence.folder.join(DRESS_INFO).is_file()) {
        Layout::Dress4d
    } else if fits().any(|fit| named(fit, ".json") && name_of(fit).starts_with("mesh-f"))
        && sequences[0].split.is_none()
    {
        Layout::CustomHumans
    } else if side_by_side {
        Layout::Rvh
    } else if sequences[0].split.is_some() && sequences.iter().any(|sequence| named(&sequence.fit_folder, "smplx"))
        || folder.join(super::GENDER_FILE).is_file() && folder.join(super::SHAPE_FILE).is_file()
    {
        Layout::XHumans
    } else {
        Layout::Plain
    }
}

/// The folders in `folder` that are called one of `names`, in any case, in the order of `names`.
fn named(folder: &Path, names: &[&str]) -> Result<Vec<PathBuf>> {
    let inside = file_names(folder)?;
    let called = |name: &&str| inside.iter().find(|found| found.eq_ignore_ascii_case(name));
    let folders = names.iter().filter_map(called).map(|name| folder.join(name));
    Ok(folders.filter(|folder| folder.is_dir()).collect())
}

fn scans_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let is_scan = |path: &PathBuf| !is_registered_mesh(path) && !name_of(path).starts_with("atlas");
    Ok(files_below(folder, &SCANS)?.into_iter().filter(is_scan).collect())
}

fn fits_in(folder: &Path) -> Result<Vec<PathBuf>> {
    files_below(folder, &FITS)
}

/// The files of a folder, and of the folders in it, one level deep.
fn files_below(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut files = files_of(folder, extensions)?;
    for name in file_names(folder)? {
        let inner = folder.join(name);
        if inner.is_dir() {
            files.extend(files_of(&inner, extensions)?);
        }
    }
    Ok(files)
}

/// The files of a folder with one of the extensions, the first kinds first.
fn files_of(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>> {
    let kind = |path: &Path| {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        extensions.iter().position(|kind| *kind == extension)
    };
    let paths = file_names(folder)?.into_iter().map(|name| folder.join(name));
    let mut files: Vec<(usize, PathBuf)> =
        paths.filter(|path| !path.is_dir()).filter_map(|path| Some((kind(&path)?, path))).collect();
    files.sort();
    Ok(files.into_iter().map(|(_, path)| path).collect())
}

fn name_of(path: &Path) -> String {
    let whole = path.canonicalize();
    let name = whole.as_deref().unwrap_or(path).file_name().map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "subject".into())
}
