//! The families of body models, a file each: how its files are recognised and read, its skeleton, its own conventions.
//!
//! A family is known by the shapes of its arrays, never by a file's name. A new one is a file here and a row of [`FAMILIES`].

pub mod flame;
mod layout;
pub mod mano;
pub mod smpl;
pub mod smplh;
pub mod smplx;
mod star;
pub(crate) mod supr;

use std::path::Path;

pub(crate) use self::layout::FINGERS;

use super::model_file::ModelFile;
use super::{Anatomy, Coefficients};
use xavatar_formats::ArrayMap;
use xavatar_formats::Result;

/// A family of body models.
struct Family {
    /// What it is called: `SMPL-X`.
    name: &'static str,
    /// What a file of it is called in messages: `SMPL-X model`.
    format: &'static str,
    /// How its files' names begin, before `_{GENDER}`.
    stem: &'static str,
    /// Whether a file is one of its.
    recognises: fn(&ModelFile) -> bool,
    /// Reads a file of it.
    read: fn(&ModelFile, Coefficients) -> Result<Anatomy>,
}

/// The families that are read; of two that recognise a file the first: SUPR's layout is one of any joints.
const FAMILIES: [Family; 7] =
    [supr::FAMILY, smplx::FAMILY, smplh::FAMILY, star::FAMILY, smpl::FAMILY, mano::FAMILY, flame::FAMILY];

/// Reads the arrays of a model's file, whichever family it is of.
pub(super) fn read(path: &Path, arrays: &ArrayMap, coefficients: Coefficients) -> Result<Anatomy> {
    let file = |format| ModelFile { path, arrays, format };
    if let Some(family) = FAMILIES.iter().find(|family| (family.recognises)(&file(family.format))) {
        return (family.read)(&file(family.format), coefficients);
    }
    let file = file("body model");
    let Some(joints) = file.joints() else {
        return Err(file.malformed("kintree_table", "absent", "(2, joints)"));
    };
    let known = FAMILIES.map(|family| family.name).join(", ");
    let (found, expected) = (format!("a model with {joints} joints"), format!("one of {known}"));
    Err(file.mismatch(found, expected, "give a model as released, or convert it"))
}

/// How the names of model files begin.
pub(super) fn stems() -> impl Iterator<Item = &'static str> {
    FAMILIES.iter().map(|family| family.stem)
}
