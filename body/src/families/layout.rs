//! What the families' files have in common: arrays of one layout, and the joints that SMPL's descendants share.
//!
//! template, faces, weights, shape directions, a joint regressor; correctives by rotation entries or quaternions. V vertices, J joints.

use std::f32::consts::FRAC_PI_6;
use std::ops::Range;

use glam::Vec3;

use crate::model_file::{ModelFile, points};
use crate::{Anatomy, BlendShapes, Correctives, HandSpace, PartGroup, PoseAxisAngle, Role, Skeleton};
use xavatar_formats::Result;

/// Joints of the body that SMPL, SMPL+H and SMPL-X share, the root first.
pub(super) const BODY_NAMES: [&str; 22] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
];

/// The parents of all of them but the root.
pub(super) const BODY_PARENTS: [usize; 21] = [0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19];

/// The joints of the body that the search starts from.
pub(super) const BODY_STARTS: [usize; 9] = [0, 1, 2, 4, 5, 16, 17, 18, 19];

/// The fingers in the order of the files, each three joints from the palm on.
pub(crate) const FINGERS: [&str; 5] = ["index", "middle", "pinky", "ring", "thumb"];

/// The names of a hand's fifteen joints: `left_index1`.
pub(super) fn hand_names(side: &str) -> impl Iterator<Item = String> {
    let name = move |finger: &str, place: usize| format!("{side}_{finger}{place}");
    FINGERS.into_iter().flat_map(move |finger| (1..=3).map(move |place| name(finger, place)))
}

/// The parents of a hand's fifteen joints, of which the first is joint `first` and the fingers hang on `wrist`.
pub(super) fn hand_parents(wrist: usize, first: usize) -> impl Iterator<Item = usize> {
    (0..15).map(move |joint| if joint % 3 == 0 { wrist } else { first + joint - 1 })
}

/// A part without a detail.
pub(super) fn part(name: &str, role: Role, joints: Vec<usize>, starts: Vec<usize>) -> PartGroup {
    PartGroup { name: name.into(), role, joints, starts, detail: None }
}

/// The canonical pose of a body of `joints` joints: the T-pose with the legs apart (thesis A.3.3).
pub(super) fn canonical_body(joints: usize) -> Vec<PoseAxisAngle> {
    let mut canonical = vec![PoseAxisAngle::default(); joints];
    canonical[1] = PoseAxisAngle(Vec3::Z * FRAC_PI_6);
    canonical[2] = PoseAxisAngle(Vec3::Z * -FRAC_PI_6);
    canonical
}

/// Which columns of `shapedirs` are used.
pub(super) struct Columns {
    pub shape: Range<usize>,
    pub expression: Range<usize>,
}

/// How a file's pose correctives are driven.
#[derive(Clone, Copy)]
pub(super) enum Drive {
    /// By R - I of every joint but the root.
    RotationEntries,
    /// By q - (0, 0, 0, 1) from this joint on, and by this coefficient.
    Quaternions { first_joint: usize, coefficient: Option<usize> },
}

/// Reads a file of the common layout, of a skeleton that its tree has been checked against.
pub(super) fn read_anatomy(
    file: &ModelFile,
    skeleton: Skeleton,
    columns: &Columns,
    drive: Drive,
    hands: Vec<HandSpace>,
) -> Result<Anatomy> {
    let template = file.template()?;
    let (vertices, joints) = (template.len() / 3, skeleton.joints.len());
    let (directions, shape) = file.floats("shapedirs", &[vertices, 3, 0])?;
    let stride = shape[2];
    let used = || columns.shape.clone().chain(columns.expression.clone());
    let regressor = file.joint_regressor(vertices, joints)?;
    Ok(Anatomy {
        faces: file.faces(vertices)?,
        skinning_weights: file.skinning_weights(vertices, joints)?,
        joints: regressor.basis(&template, &directions, stride, used()),
        shapes: BlendShapes::from_columns(&directions, stride, used()),
        expressions: columns.expression.len(),
        template: points(&template),
        correctives: match drive {
            Drive::RotationEntries => Correctives::RotationEntries(file.correctives(vertices, 9 * (joints - 1))?),
            Drive::Quaternions { first_joint, coefficient } => Correctives::Quaternions {
                first_joint,
                coefficient,
                shapes: file.correctives(vertices, 4 * (joints - first_joint) + usize::from(coefficient.is_some()))?,
            },
        },
        hands,
        skeleton,
    })
}
