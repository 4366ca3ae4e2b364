//! SMPL: 24 joints, hands that are one joint each, no face. Ten coefficients of shape.

use std::sync::LazyLock;

use super::Family;
use super::layout::{BODY_NAMES, BODY_PARENTS, BODY_STARTS, Columns, Drive, canonical_body, part, read_anatomy};
use crate::model_file::ModelFile;
use crate::{Anatomy, Coefficients, Role, Skeleton};
use xavatar_formats::Result;

/// Joints: those of the body, and two hands.
pub(super) const JOINTS: usize = 24;
/// Coefficients of shape that are used where not all are asked for.
const SHAPES: usize = 10;

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family =
    Family { name: "SMPL", format: "SMPL model", stem: "SMPL", recognises: |file| file.joints() == Some(JOINTS), read };

/// The skeleton. STAR's is the same.
pub fn skeleton() -> &'static Skeleton {
    static SKELETON: LazyLock<Skeleton> = LazyLock::new(|| of_family("SMPL"));
    &SKELETON
}

pub(super) fn of_family(family: &str) -> Skeleton {
    let starts: Vec<usize> = BODY_STARTS.into_iter().chain([12, 15, 20, 21]).collect();
    Skeleton {
        family: family.into(),
        joints: BODY_NAMES.into_iter().chain(["left_hand", "right_hand"]).map(str::to_owned).collect(),
        parents: std::iter::once(None).chain(BODY_PARENTS.into_iter().chain([20, 21]).map(Some)).collect(),
        parts: vec![part("body", Role::Body, (0..JOINTS).collect(), starts.clone())],
        starts,
        canonical: canonical_body(JOINTS),
        conditioning: (1..JOINTS).collect(),
    }
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let skeleton = skeleton().clone();
    file.require_kinematic_tree(&skeleton.parents, &skeleton.family)?;
    let shape = 0..file.used_columns(SHAPES, coefficients)?;
    read_anatomy(file, skeleton, &Columns { shape, expression: 0..0 }, Drive::RotationEntries, Vec::new())
}
