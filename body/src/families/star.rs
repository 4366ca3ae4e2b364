//! STAR (Osman 2020): SMPL's joints, sparse correctives driven by quaternions and by the second coefficient of shape.
//!
//! Features: q_j - (0, 0, 0, 1) of the joints but the root, x y z w, then beta_2: 93.

use super::layout::{Columns, Drive, read_anatomy};
use super::{Family, smpl};
use crate::model_file::ModelFile;
use crate::{Anatomy, Coefficients};
use xavatar_formats::Result;

/// Features of the correctives.
const FEATURES: usize = 4 * (smpl::JOINTS - 1) + 1;
/// Coefficients of shape that are used where not all 300 are asked for.
const SHAPES: usize = 10;

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family = Family {
    name: "STAR",
    format: "STAR model",
    stem: "STAR",
    recognises: |file| file.joints() == Some(smpl::JOINTS) && file.columns("posedirs") == Some(FEATURES),
    read,
};

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let skeleton = smpl::of_family("STAR");
    file.require_kinematic_tree(&skeleton.parents, &skeleton.family)?;
    let shape = 0..file.used_columns(SHAPES, coefficients)?;
    let drive = Drive::Quaternions { first_joint: 1, coefficient: Some(1) };
    read_anatomy(file, skeleton, &Columns { shape, expression: 0..0 }, drive, Vec::new())
}
