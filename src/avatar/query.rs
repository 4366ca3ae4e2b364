//! The fields at single canonical points: f(x_c), its normal, colour and skinning weights (METHOD section 2).
//!
//! N points, J joints; metres. Posed points are found by [`Animator`](super::Animator), or by
//! [`PosedField`](crate::fields::PosedField).

use glam::Vec3;

use super::{Avatar, arrays};
use crate::body::Pose;
use crate::fields::{FieldEvaluator, Shade};
use crate::{Error, InputError, Result};

/// What the fields say of one canonical point.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The geometry field: a logit, positive inside, or metres to the surface, negative inside; see
    /// [`Representation`](xavatar_network::Representation).
    pub value: f32,
    /// Where the outside lies: against the occupancy's gradient, along the distance's; of unit length, zero where there is no gradient.
    pub normal: Vec3,
    /// sRGB.
    pub colour: [u8; 3],
    /// How much of each bone's motion the point follows (J); their sum is 1.
    pub weights: Vec<f32>,
}

impl Avatar {
    /// The fields at canonical points (N), under a pose and its expression.
    ///
    /// # Errors
    /// [`InputError::Value`] for a point that is not finite.
    pub fn query(&self, points: &[Vec3], pose: &Pose) -> Result<Vec<Sample>> {
        if let Some(point) = points.iter().find(|point| !point.is_finite()) {
            return Err(Error::from(InputError::Value {
                name: "a point to query".into(),
                found: point.to_string(),
                expected: "finite coordinates".into(),
            }));
        }
        let evaluator = FieldEvaluator::new(&self.fields, &self.condition().of(pose));
        let canonical = arrays(points);
        let (values, weights) = (evaluator.values(&canonical), evaluator.weights(&canonical));
        let shades = evaluator.shades(&canonical)?;
        let rows = weights.chunks_exact(self.subject.skeleton.joints.len());
        let sample = |((value, Shade { normal, colour }), weights): ((f32, Shade), &[f32])| Sample {
            value,
            normal,
            colour,
            weights: weights.to_vec(),
        };
        Ok(values.into_iter().zip(shades).zip(rows).map(sample).collect())
    }
}
