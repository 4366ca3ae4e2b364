//! The families of body models, a file each: how its files are recognised and read, its skeleton, its own conventions.
//!
//! A family is known by the shapes of its arrays, never by a file's name. A new one is a file here and a row of [`FAMILIES`].

pub mod smplx;

use std::path::Path;

use super::Anatomy;
use super::model_file::ModelFile;
use xavatar_formats::ArrayMap;
use xavatar_formats::Result;

/// A family of body models.
struct Family {
    /// What a file of it is called in messages: `SMPL-X model`.
    format: &'static str,
    /// How its files' names begin, before `_{GENDER}`.
    stem: &'static str,
    /// Whether a file is one of its.
    recognises: fn(&ModelFile) -> bool,
    /// Reads a file of it.
    read: fn(&ModelFile) -> Result<Anatomy>,
}

/// The families that are read.
const FAMILIES: [Family; 1] = [smplx::FAMILY];

/// Families that are not read, by their number of joints.
const OTHERS: [(usize, &str); 4] = [
    (24, "an SMPL model (24 joints, no hands or face)"),
    (52, "an SMPL+H model (52 joints, no face)"),
    (16, "a MANO model (16 joints, one hand)"),
    (5, "a FLAME model (5 joints, the head)"),
];

/// Reads the arrays of a model's file, whichever family it is of.
pub(super) fn read(path: &Path, arrays: &ArrayMap) -> Result<Anatomy> {
    let file = |format| ModelFile { path, arrays, format };
    let recognised = |family: &&Family| (family.recognises)(&file(family.format));
    if let Some(family) = FAMILIES.iter().find(recognised) {
        return (family.read)(&file(family.format));
    }
    let file = file("body model");
    let Some(joints) = file.joints() else {
        return Err(file.malformed("kintree_table", "absent", "(2, joints)"));
    };
    let known = OTHERS.iter().find(|(count, _)| *count == joints).map(|(_, name)| (*name).to_owned());
    Err(file.mismatch(
        known.unwrap_or_else(|| format!("a model with {joints} joints")),
        smplx::EXPECTED,
        "download SMPLX_{GENDER}.npz from https://smpl-x.is.tue.mpg.de",
    ))
}

/// How the names of model files begin.
pub(super) fn stems() -> impl Iterator<Item = &'static str> {
    FAMILIES.iter().map(|family| family.stem)
}
