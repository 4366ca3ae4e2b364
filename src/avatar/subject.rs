//! Whom an avatar was made of.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::body::{BodyModel, Gender, Skeleton};
use crate::fields::Condition;

/// The body under an avatar: its skeleton in its own shape. J joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subject {
    /// The body model's gender.
    pub gender: Gender,
    /// Shape coefficients.
    pub betas: Vec<f32>,
    /// Coefficients of expression that the body model has.
    pub expressions: usize,
    /// The joints, parts and canonical pose.
    pub skeleton: Skeleton,
    /// Where the joints are in canonical space (J), metres.
    pub joints: Vec<Vec3>,
    /// Lowest and highest corner of the canonical box, metres.
    pub bounds: (Vec3, Vec3),
    /// Frames it was trained on.
    pub frames: usize,
}

impl Subject {
    /// The subject of this shape on a body model.
    ///
    /// # Errors
    /// If the shape does not fit the model.
    pub fn of(body: &BodyModel, gender: Gender, betas: &[f32], bounds: (Vec3, Vec3), frames: usize) -> Result<Self> {
        Ok(Self {
            gender,
            betas: betas.to_vec(),
            expressions: body.expression_coefficients(),
            skeleton: body.skeleton().clone(),
            joints: body.canonical_joints(betas)?,
            bounds,
            frames,
        })
    }

    /// Whether a body model has its skeleton, with its joints where the model has those of its shape.
    ///
    /// # Errors
    /// If the shape has more coefficients than the model.
    pub fn is_on(&self, body: &BodyModel) -> Result<bool> {
        /// Joints closer than this are the same, metres.
        const SAME_JOINT: f32 = 1e-4;
        let Ok(body) = body.in_canonical_pose_of(&self.skeleton) else { return Ok(false) };
        let joints = body.canonical_joints(&self.betas)?;
        let is_same = |(joint, own): (&Vec3, &Vec3)| joint.distance(*own) < SAME_JOINT;
        Ok(joints.len() == self.joints.len() && joints.iter().zip(&self.joints).all(is_same))
    }

    /// What the fields are told of a pose of this body.
    pub fn condition(&self) -> Condition {
        Condition::new(&self.skeleton, self.expressions)
    }
}
