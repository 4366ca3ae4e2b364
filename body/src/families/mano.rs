//! MANO: one hand, 16 joints. Ten coefficients of shape.
//!
//! Left and right hands are files of one layout: in a left hand the fingers point to +X from the wrist, as those of a body in the T-pose do.
//! Joints are named as those of a whole body's hand, so that a body's motion moves a hand. Many copies of the left model have shapes whose x
//! was not mirrored with the hand ([`has_unmirrored_shapes`]).

use super::Family;
use super::layout::{Columns, Drive, FINGERS, hand_names, hand_parents, part, read_anatomy};
use crate::hands::HAND_JOINTS;
use crate::model_file::ModelFile;
use crate::{Anatomy, BodyModel, Coefficients, HandPose, HandSpace, Pose, PoseAxisAngle, Role, Skeleton};
use glam::Vec3;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};

/// Joints: the wrist, and three a finger.
pub const JOINTS: usize = 1 + HAND_JOINTS;
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
        joints: std::iter::once(format!("{side}_wrist")).chain(hand_names(side)).collect(),
        parents: std::iter::once(None).chain(hand_parents(0, 1).map(Some)).collect(),
        parts: std::iter::once(part("palm", Role::Body, vec![0], vec![0]))
            .chain(FINGERS.into_iter().enumerate().map(finger))
            .collect(),
        starts: (0..JOINTS).collect(),
        canonical: vec![PoseAxisAngle::default(); JOINTS],
        conditioning: (1..JOINTS).collect(),
    }
}

/// One frame of MANO's parameters, with the convention of its fingers as a type.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    /// Shape coefficients beta; those that are left out are zero.
    pub betas: Vec<f32>,
    /// Rotation of the wrist.
    pub global_orient: PoseAxisAngle,
    /// The fingers.
    pub hand_pose: HandPose,
    /// Translation added to every vertex, metres.
    pub transl: Vec3,
}

impl Parameters {
    /// The pose, with the `hands` of the model that it is of.
    pub(crate) fn resolve(&self, hands: &[HandSpace]) -> Result<Pose> {
        let [hand] = hands else {
            let (found, expected) = (format!("of a model with {} hands", hands.len()), "of one hand".into());
            return Err(Error::Value { name: "MANO parameters".into(), found, expected });
        };
        Ok(self.with_fingers(&hand.rotations("hand_pose", &self.hand_pose)?))
    }

    /// The pose, if no model is needed to know its fingers.
    pub(crate) fn absolute(&self) -> Result<Pose> {
        match &self.hand_pose {
            HandPose::Flat(fingers) => Ok(self.with_fingers(fingers)),
            _ => Err(Error::Value {
                name: "a hand's pose".into(),
                found: "given relative to the model's mean hand, and no model".into(),
                expected: "a MANO model to know that hand".into(),
            }),
        }
    }

    fn with_fingers(&self, fingers: &[PoseAxisAngle]) -> Pose {
        let rotations = std::iter::once(self.global_orient).chain(fingers.iter().copied()).collect();
        Pose { rotations, shape: self.betas.clone(), expression: Vec::new(), translation: self.transl }
    }
}

/// Whether the shapes of a hand were not mirrored with it: its first, which is size, then draws it together along x while it widens across.
pub fn has_unmirrored_shapes(model: &BodyModel) -> bool {
    let Some(size) = model.anatomy.shapes.directions().next().filter(|direction| !direction.is_empty()) else {
        return false;
    };
    let wrist = model.anatomy.joints.template[0].as_vec3();
    let moved = model.template().iter().zip(size.as_chunks::<3>().0);
    let growth: Vec3 = moved.map(|(place, offset)| (*place - wrist) * Vec3::from(*offset)).sum();
    model.skeleton().family.starts_with(FAMILY.name) && growth.x * (growth.y + growth.z) < 0.0
}

/// The arrays of a model's file with the x of its shapes mirrored.
///
/// # Errors
/// [`Error::Value`] if there are no shapes of vertices.
pub fn with_mirrored_shapes(mut arrays: ArrayMap) -> Result<ArrayMap> {
    let shapes = arrays.get("shapedirs").filter(|array| matches!(array.shape[..], [_, 3, _]));
    let Some((shape, mut values)) = shapes.and_then(|array| Some((array.shape.clone(), array.to_f64()?))) else {
        let (found, expected) = ("none of (V, 3, shapes)".into(), "a hand's, to be mirrored".into());
        return Err(Error::Value { name: "shapedirs".into(), found, expected });
    };
    let columns = shape[2];
    values.chunks_exact_mut(3 * columns).for_each(|vertex| vertex[..columns].iter_mut().for_each(|x| *x = -*x));
    arrays.insert("shapedirs".into(), Array { shape, data: ArrayData::F64(values) });
    Ok(arrays)
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
