//! MANO: one hand, 16 joints. Ten coefficients of shape.
//!
//! Left and right hands are files of one layout: in a left hand the fingers point to +X from the wrist, as those of a body in the T-pose do.

use super::Family;
use super::layout::{Columns, Drive, FINGERS, hand_names, hand_parents, part, read_anatomy};
use crate::model_file::ModelFile;
use crate::{Anatomy, Coefficients, PoseAxisAngle, Role, Skeleton};
use xavatar_formats::Result;

/// Joints: the wrist, and three a finger.
const JOINTS: usize = 16;
/// Coefficients of shape that are used where not all are asked for.
const SHAPES: usize = 10;

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family =
    Family { name: "MANO", format: "MANO model", stem: "MANO", recognises: |file| file.joints() == Some(JOINTS), read };

/// The skeleton of one side's hand, `left` or `right`: palm and fingers are its parts.
pub fn skeleton(side: &str) -> Skeleton {
    let finger = |(index, name): (usize, &str)| {
        let joints: Vec<usize> = (1 + 3 * index..4 + 3 * index).collect();
        part(name, Role::Body, joints.clone(), joints)
    };
    Skeleton {
        family: format!("MANO {side}"),
        joints: std::iter::once("wrist".to_owned()).chain(hand_names(None)).collect(),
        parents: std::iter::once(None).chain(hand_parents(0, 1).map(Some)).collect(),
        parts: std::iter::once(part("palm", Role::Body, vec![0], vec![0]))
            .chain(FINGERS.into_iter().enumerate().map(finger))
            .collect(),
        starts: (0..JOINTS).collect(),
        canonical: vec![PoseAxisAngle::default(); JOINTS],
        conditioning: (1..JOINTS).collect(),
    }
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let template = skeleton("right");
    file.require_kinematic_tree(&template.parents, FAMILY.name)?;
    let shape = 0..file.used_columns(SHAPES, coefficients)?;
    let hand = file.hand_space("hands_mean", "hands_components")?;
    let columns = Columns { shape, expression: 0..0 };
    let mut anatomy = read_anatomy(file, template, &columns, Drive::RotationEntries, vec![hand])?;
    let joints = &anatomy.joints.template;
    let reach: f64 = joints.iter().map(|joint| joint.x - joints[0].x).sum();
    if reach > 0.0 {
        anatomy.skeleton = skeleton("left");
    }
    Ok(anatomy)
}
