//! The fields at single canonical points: f(x_c), its normal, colour and skinning weights (METHOD section 2).
//!
//! N points, J joints; metres. Posed points are found by [`Animator`](super::Animator), or by
//! [`PosedField`](crate::correspondence::PosedField).

use glam::Vec3;
use rayon::prelude::*;
use xavatar_network::{SkinningTrace, Trace};

use super::shading::{Posing, shades};
use super::{Avatar, BLOCK_ROWS, arrays};
use crate::body::Pose;
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
    /// [`Error::Value`] for a point that is not finite.
    pub fn query(&self, points: &[Vec3], pose: &Pose) -> Result<Vec<Sample>> {
        if let Some(point) = points.iter().find(|point| !point.is_finite()) {
            return Err(Error::from(InputError::Value {
                name: "a point to query".into(),
                found: point.to_string(),
                expected: "finite coordinates".into(),
            }));
        }
        let network = &self.fields.geometry.mlp;
        let embedded = network.embed(&self.condition().of(pose));
        let canonical = arrays(points);
        let shades = shades(&self.fields, &embedded, &Posing::Canonical, &canonical, points)?;
        let mut values = vec![0.0; points.len()];
        let joints = self.subject.skeleton.joints.len();
        let mut weights = vec![0.0; points.len() * joints];
        let rows = values.par_chunks_mut(BLOCK_ROWS).zip(weights.par_chunks_mut(BLOCK_ROWS * joints));
        rows.zip(canonical.par_chunks(BLOCK_ROWS)).for_each_init(
            || (Trace::default(), SkinningTrace::default()),
            |(geometry, skinning), ((values, weights), points)| {
                network.forward(geometry, points.as_flattened(), &embedded, &[]);
                values.copy_from_slice(geometry.output());
                self.fields.skinning.weights(skinning, points, weights);
            },
        );
        let samples = values.into_iter().zip(shades).zip(weights.chunks_exact(joints));
        Ok(samples
            .map(|((value, (normal, colour)), weights)| Sample { value, normal, colour, weights: weights.to_vec() })
            .collect())
    }
}
