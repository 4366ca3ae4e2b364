//! The fields at single canonical points: f(x_c), its normal, colour and skinning weights (METHOD section 2).
//!
//! N points, J joints; metres. Posed points are found by [`Animator`](super::Animator), or by
//! [`PosedField`](crate::fields::PosedField).

use glam::Vec3;

use super::{Avatar, arrays};
use crate::body::{BodyParameters, JOINTS};
use crate::fields::{FieldEvaluator, Shade, condition};
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
    pub weights: [f32; JOINTS],
}

impl Avatar {
    /// The fields at canonical points (N), under the pose and expression of `parameters`.
    ///
    /// # Errors
    /// [`Error::Value`] for a point that is not finite.
    pub fn query(&self, points: &[Vec3], parameters: &BodyParameters) -> Result<Vec<Sample>> {
        if let Some(point) = points.iter().find(|point| !point.is_finite()) {
            return Err(Error::from(InputError::Value {
                name: "a point to query".into(),
                found: point.to_string(),
                expected: "finite coordinates".into(),
            }));
        }
        let evaluator = FieldEvaluator::new(&self.fields, &condition(parameters));
        let canonical = arrays(points);
        let (values, weights) = (evaluator.values(&canonical), evaluator.weights(&canonical));
        let shades = evaluator.shades(&canonical)?;
        let samples = values.into_iter().zip(shades).zip(weights.as_chunks::<JOINTS>().0);
        let sample = |((value, Shade { normal, colour }), weights): ((f32, Shade), &[f32; JOINTS])| Sample {
            value,
            normal,
            colour,
            weights: *weights,
        };
        Ok(samples.map(sample).collect())
    }
}
