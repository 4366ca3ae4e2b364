//! SMPL-X: 55 joints with hands, jaw and eyes; of its coefficients the first 10 of shape and the first 10 of expression.
//!
//! theta = global 3 + body 63 (21 joints) + jaw 3 + left eye 3 + right eye 3 + hands 45 + 45. The canonical pose is the T-pose
//! but for hips turned +-pi/6 about z, jaw 0.2 about x and flat hands (thesis A.3.3); parts are those of A.3.2.

pub mod joint;

use std::ops::Range;
use std::sync::LazyLock;

use glam::Vec3;

use super::Family;
use super::layout::{
    BODY_NAMES, BODY_PARENTS, BODY_STARTS, Columns, Drive, canonical_body, hand_names, hand_parents, part, read_anatomy,
};
use crate::hands::HAND_JOINTS;
use crate::model_file::ModelFile;
use crate::{
    Anatomy, Coefficients, Detail, Fingers, HandPose, HandSpace, PartGroup, Pose, PoseAxisAngle, Role, Skeleton,
};
use xavatar_formats::{Error, Result};

/// Joints of `body_pose`: those of the body but the root.
pub const BODY_JOINTS: usize = joint::RIGHT_WRIST;

/// Coefficients of the shape that are used.
pub const SHAPES: usize = 10;
/// Coefficients of the expression that are used, and that avatars are told.
pub const EXPRESSIONS: usize = 10;

/// How its files are found, recognised and read.
pub(super) const FAMILY: Family = Family {
    name: "SMPL-X",
    format: "SMPL-X model",
    stem: "SMPLX",
    recognises: |file| file.joints() == Some(joint::COUNT),
    read,
};

/// The skeleton.
pub fn skeleton() -> &'static Skeleton {
    static SKELETON: LazyLock<Skeleton> = LazyLock::new(build);
    &SKELETON
}

fn build() -> Skeleton {
    use joint::{HEAD, JAW, LEFT_EYE, LEFT_HAND, LEFT_WRIST, NECK, RIGHT_EYE, RIGHT_HAND, RIGHT_WRIST};
    let mut canonical = canonical_body(joint::COUNT);
    canonical[JAW] = PoseAxisAngle(Vec3::X * 0.2);
    // A wrist belongs to its hand, neck, jaw and eyes to the face.
    let hand = |wrist: usize, hand: Range<usize>| std::iter::once(wrist).chain(hand).collect();
    let (face, left, right): (_, Vec<usize>, Vec<usize>) =
        (vec![NECK, HEAD, JAW, LEFT_EYE, RIGHT_EYE], hand(LEFT_WRIST, LEFT_HAND), hand(RIGHT_WRIST, RIGHT_HAND));
    let is_elsewhere = |joint: &usize| [&face, &left, &right].iter().any(|part| part.contains(joint));
    let body = (0..joint::COUNT).filter(|joint| !is_elsewhere(joint)).collect();
    let left_parents = hand_parents(LEFT_WRIST, LEFT_HAND.start);
    let right_parents = hand_parents(RIGHT_WRIST, RIGHT_HAND.start);
    let parents = BODY_PARENTS.into_iter().chain([HEAD; 3]).chain(left_parents).chain(right_parents);
    let eyes_mouth = Detail { name: "eyes_mouth".into(), joints: vec![LEFT_EYE, RIGHT_EYE] };
    let ends = [HEAD, JAW, LEFT_EYE, RIGHT_EYE, LEFT_WRIST, RIGHT_WRIST];
    let mut starts: Vec<usize> = BODY_STARTS.into_iter().chain(ends).chain(LEFT_HAND).chain(RIGHT_HAND).collect();
    starts.sort_unstable();
    Skeleton {
        family: "SMPL-X".into(),
        joints: BODY_NAMES
            .into_iter()
            .chain(["jaw", "left_eye", "right_eye"])
            .map(str::to_owned)
            .chain(hand_names("left"))
            .chain(hand_names("right"))
            .collect(),
        parents: std::iter::once(None).chain(parents.map(Some)).collect(),
        parts: vec![
            part("body", Role::Body, body, BODY_STARTS.into()),
            PartGroup { detail: Some(eyes_mouth), ..part("face", Role::Face, face, vec![NECK, HEAD, JAW]) },
            part("left_hand", Role::Hands, left.clone(), left),
            part("right_hand", Role::Hands, right.clone(), right),
        ],
        starts,
        canonical,
        conditioning: (1..=BODY_JOINTS).collect(),
    }
}

/// One frame of SMPL-X parameters, with their conventions as types. `Default` is the T-pose with flat hands.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    /// Shape coefficients beta; those that are left out are zero.
    pub betas: Vec<f32>,
    /// Expression coefficients psi; those that are left out are zero.
    pub expression: Vec<f32>,
    /// Rotation of the root.
    pub global_orient: PoseAxisAngle,
    /// Rotations of the body's joints, in the skeleton's order from the left hip on.
    pub body_pose: [PoseAxisAngle; BODY_JOINTS],
    /// Rotation of the jaw.
    pub jaw_pose: PoseAxisAngle,
    /// Rotation of the left eye.
    pub left_eye_pose: PoseAxisAngle,
    /// Rotation of the right eye.
    pub right_eye_pose: PoseAxisAngle,
    /// Left hand.
    pub left_hand_pose: HandPose,
    /// Right hand.
    pub right_hand_pose: HandPose,
    /// Translation added to every vertex, metres.
    pub transl: Vec3,
}

impl Parameters {
    /// The names that files have for the parameters but the shape, as PyPI smplx has, and how many numbers each holds.
    pub const NAMED: [(&str, usize); 9] = [
        ("global_orient", 3),
        ("body_pose", 3 * BODY_JOINTS),
        ("left_hand_pose", 3 * HAND_JOINTS),
        ("right_hand_pose", 3 * HAND_JOINTS),
        ("jaw_pose", 3),
        ("leye_pose", 3),
        ("reye_pose", 3),
        ("expression", EXPRESSIONS),
        ("transl", 3),
    ];

    /// The parameters of a source that has them by the names of [`NAMED`](Self::NAMED), with hands of one convention; the shape
    /// is left out. `numbers` gives the numbers of a name, as many as it is asked for.
    ///
    /// # Errors
    /// The first of `numbers`.
    pub fn from_named<E>(
        numbers: impl Fn(&str, usize) -> std::result::Result<Vec<f32>, E>,
        hand: fn(Fingers) -> HandPose,
    ) -> std::result::Result<Self, E> {
        let one = |name: &str| Ok(rotations::<1>(&numbers(name, 3)?)[0]);
        let fingers = |name: &str| Ok(hand(rotations(&numbers(name, 3 * HAND_JOINTS)?)));
        Ok(Self {
            global_orient: one("global_orient")?,
            betas: Vec::new(),
            expression: numbers("expression", EXPRESSIONS)?,
            body_pose: rotations(&numbers("body_pose", 3 * BODY_JOINTS)?),
            jaw_pose: one("jaw_pose")?,
            left_eye_pose: one("leye_pose")?,
            right_eye_pose: one("reye_pose")?,
            left_hand_pose: fingers("left_hand_pose")?,
            right_hand_pose: fingers("right_hand_pose")?,
            transl: rotations::<1>(&numbers("transl", 3)?)[0].0,
        })
    }

    /// The same with hands that no model is needed for: offsets from a mean as they are, coefficients of components as flat hands.
    #[must_use]
    pub fn with_flat_hands(&self) -> Self {
        let flat = |hand: &HandPose| match hand {
            HandPose::Flat(fingers) | HandPose::RelativeToMean(fingers) => HandPose::Flat(*fingers),
            HandPose::Pca(_) => HandPose::default(),
        };
        Self {
            left_hand_pose: flat(&self.left_hand_pose),
            right_hand_pose: flat(&self.right_hand_pose),
            ..self.clone()
        }
    }

    /// The pose of SMPL-X's skeleton, with the `hands` (left, right) of the model that it is of.
    ///
    /// # Errors
    /// [`Error::Value`] for another number of hands, or more coefficients than they have components.
    pub fn resolve(&self, hands: &[HandSpace]) -> Result<Pose> {
        let [left, right] = hands else {
            let (found, expected) = (format!("of a model with {} hands", hands.len()), "of one with two".into());
            return Err(Error::Value { name: "SMPL-X parameters".into(), found, expected });
        };
        let left = left.rotations("left_hand_pose", &self.left_hand_pose)?;
        let right = right.rotations("right_hand_pose", &self.right_hand_pose)?;
        Ok(self.with_hands(&left, &right))
    }

    /// The pose, if no model is needed to know its hands.
    pub(crate) fn absolute(&self) -> Result<Pose> {
        match (&self.left_hand_pose, &self.right_hand_pose) {
            (HandPose::Flat(left), HandPose::Flat(right)) => Ok(self.with_hands(left, right)),
            _ => Err(Error::Value {
                name: "the motion's hand pose".into(),
                found: "given relative to the body model's mean hand, and no body model".into(),
                expected: "a body model to know that hand, or hands relative to the flat one".into(),
            }),
        }
    }

    /// The rotations of the joints before the hands, in the skeleton's order: root, body, jaw and eyes.
    pub fn before_hands(&self) -> impl Iterator<Item = PoseAxisAngle> {
        let face = [self.jaw_pose, self.left_eye_pose, self.right_eye_pose];
        std::iter::once(self.global_orient).chain(self.body_pose).chain(face)
    }

    fn with_hands(&self, left: &Fingers, right: &Fingers) -> Pose {
        let mut rotations = Vec::with_capacity(joint::COUNT);
        rotations.extend(self.before_hands());
        rotations.extend(left.iter().chain(right));
        let (shape, expression) = (self.betas.clone(), self.expression.clone());
        Pose { rotations, shape, expression, translation: self.transl }
    }
}

impl From<&Pose> for Parameters {
    /// The parameters of a pose of SMPL-X's skeleton, hands flat; joints that it lacks are at rest.
    fn from(pose: &Pose) -> Self {
        let rotation = |joint: usize| pose.rotations.get(joint).copied().unwrap_or_default();
        Self {
            betas: pose.shape.clone(),
            expression: pose.expression.clone(),
            global_orient: rotation(0),
            body_pose: std::array::from_fn(|joint| rotation(1 + joint)),
            jaw_pose: rotation(joint::JAW),
            left_eye_pose: rotation(joint::LEFT_EYE),
            right_eye_pose: rotation(joint::RIGHT_EYE),
            left_hand_pose: HandPose::Flat(std::array::from_fn(|place| rotation(joint::LEFT_HAND.start + place))),
            right_hand_pose: HandPose::Flat(std::array::from_fn(|place| rotation(joint::RIGHT_HAND.start + place))),
            transl: pose.translation,
        }
    }
}

/// Rotations of their components, three a joint; joints whose components are missing are at rest.
fn rotations<const N: usize>(components: &[f32]) -> [PoseAxisAngle; N] {
    let (joints, _) = components.as_chunks::<3>();
    std::array::from_fn(|joint| {
        joints.get(joint).map_or(PoseAxisAngle::default(), |axis| PoseAxisAngle((*axis).into()))
    })
}

fn read(file: &ModelFile, coefficients: Coefficients) -> Result<Anatomy> {
    let skeleton = skeleton().clone();
    let vertices = file.template()?.len() / 3;
    file.require_kinematic_tree(&skeleton.parents, &skeleton.family)?;
    let count = file.extents("shapedirs", &[vertices, 3, 0])?[2];
    let first_expression = match count {
        20 => 10,
        400 => 300,
        _ => {
            let found = format!("{count} shape columns");
            let remedy = "use the SMPL-X release itself; 16 columns and no expressions are SMPL+H's, as in AMASS";
            return Err(file.mismatch(found, "10 + 10 or 300 + 100 (shape + expression)", remedy));
        }
    };
    let columns = match coefficients {
        Coefficients::Usual => {
            Columns { shape: 0..SHAPES, expression: first_expression..first_expression + EXPRESSIONS }
        }
        Coefficients::All => Columns { shape: 0..first_expression, expression: first_expression..count },
    };
    let hands = vec![
        file.hand_space("hands_meanl", "hands_componentsl")?,
        file.hand_space("hands_meanr", "hands_componentsr")?,
    ];
    read_anatomy(file, skeleton, &columns, Drive::RotationEntries, hands)
}

#[cfg(test)]
#[path = "smplx_tests.rs"]
pub(crate) mod tests;
