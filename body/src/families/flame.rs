//! FLAME: a head, 5 joints: root, neck, jaw and two eyes. 300 coefficients of shape and 100 of expression, of which ten each are used
//! where not all are asked for.

use super::Family;
use super::layout::{Columns, Drive, part, read_anatomy};
use super::smplx::{EXPRESSIONS, SHAPES};
use crate::model_file::ModelFile;
use crate::{Anatomy, Coefficients, Detail, PartGroup, PoseAxisAngle, Role, Skeleton};
use xavatar_formats::Result;

const NAMES: [&str; 5] = ["root", "neck", "jaw", "left_eye", "right_eye"];
const PARENTS: [Option<usize>; 5] = [None, Some(0), Some(1), Some(1), Some(1)];

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family = Family {
    name: "FLAME",
    format: "FLAME model",
    stem: "FLAME",
    recognises: |file| file.joints() == Some(NAMES.len()),
    read,
};

/// The skeleton: all of it is one face, with the jaw a little open as in every canonical pose.
pub fn skeleton() -> Skeleton {
    let mut canonical = vec![PoseAxisAngle::default(); NAMES.len()];
    canonical[2] = PoseAxisAngle(glam::Vec3::X * 0.2);
    let head = part("head", Role::Body, (0..NAMES.len()).collect(), vec![0, 1, 2]);
    Skeleton {
        family: FAMILY.name.into(),
        joints: NAMES.map(str::to_owned).into(),
        parents: PARENTS.into(),
        parts: vec![PartGroup { detail: Some(Detail { name: "eyes_mouth".into(), joints: vec![3, 4] }), ..head }],
        starts: vec![0, 1, 2],
        canonical,
        conditioning: (1..NAMES.len()).collect(),
    }
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let skeleton = skeleton();
    file.require_kinematic_tree(&skeleton.parents, FAMILY.name)?;
    let columns = match (file.columns("shapedirs"), coefficients) {
        (Some(400), Coefficients::Usual) => Columns { shape: 0..SHAPES, expression: 300..300 + EXPRESSIONS },
        (Some(400), Coefficients::All) => Columns { shape: 0..300, expression: 300..400 },
        (found, _) => {
            let found = format!("{} shape columns", found.unwrap_or(0));
            return Err(file.mismatch(found, "300 + 100 (shape + expression)", "use a FLAME release itself"));
        }
    };
    read_anatomy(file, skeleton, &columns, Drive::RotationEntries, Vec::new())
}
