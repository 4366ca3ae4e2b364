//! SMPL+H: SMPL with the hands of MANO, 52 joints, no face. Ten coefficients of shape.

use std::sync::LazyLock;

use super::Family;
use super::layout::{
    BODY_NAMES, BODY_PARENTS, BODY_STARTS, Columns, Drive, canonical_body, hand_names, hand_parents, part, read_anatomy,
};
use crate::hands::HAND_JOINTS;
use crate::model_file::ModelFile;
use crate::{Anatomy, Coefficients, Role, Skeleton};
use xavatar_formats::Result;

const LEFT_HAND: usize = BODY_NAMES.len();
const RIGHT_HAND: usize = LEFT_HAND + HAND_JOINTS;
const JOINTS: usize = RIGHT_HAND + HAND_JOINTS;
/// Coefficients of shape that are used where not all are asked for.
const SHAPES: usize = 10;

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family = Family {
    name: "SMPL+H",
    format: "SMPL+H model",
    stem: "SMPLH",
    recognises: |file| file.joints() == Some(JOINTS),
    read,
};

/// The skeleton.
pub fn skeleton() -> &'static Skeleton {
    static SKELETON: LazyLock<Skeleton> = LazyLock::new(build);
    &SKELETON
}

fn build() -> Skeleton {
    let names = BODY_NAMES.into_iter().map(str::to_owned);
    let parents = BODY_PARENTS.into_iter().chain(hand_parents(20, LEFT_HAND)).chain(hand_parents(21, RIGHT_HAND));
    // A wrist belongs to its hand.
    let hand = |wrist: usize, first: usize| -> Vec<usize> {
        std::iter::once(wrist).chain(first..first + HAND_JOINTS).collect()
    };
    let (left, right) = (hand(20, LEFT_HAND), hand(21, RIGHT_HAND));
    let body_starts: Vec<usize> = BODY_STARTS.into_iter().chain([12, 15]).collect();
    Skeleton {
        family: "SMPL+H".into(),
        joints: names.chain(hand_names("left")).chain(hand_names("right")).collect(),
        parents: std::iter::once(None).chain(parents.map(Some)).collect(),
        starts: body_starts.iter().chain(&left).chain(&right).copied().collect(),
        parts: vec![
            part("body", Role::Body, (0..20).collect(), body_starts),
            part("left_hand", Role::Hands, left.clone(), left),
            part("right_hand", Role::Hands, right.clone(), right),
        ],
        canonical: canonical_body(JOINTS),
        conditioning: (1..LEFT_HAND).collect(),
    }
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let skeleton = skeleton().clone();
    file.require_kinematic_tree(&skeleton.parents, &skeleton.family)?;
    let shape = 0..file.used_columns(SHAPES, coefficients)?;
    let hands = vec![
        file.hand_space("hands_meanl", "hands_componentsl")?,
        file.hand_space("hands_meanr", "hands_componentsr")?,
    ];
    read_anatomy(file, skeleton, &Columns { shape, expression: 0..0 }, Drive::RotationEntries, hands)
}
