//! What the loss terms weigh.

use serde::{Deserialize, Serialize};

use super::{positive, within};
use crate::Result;

/// Weights of the loss terms (METHOD section 5); zero leaves a term out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossSettings {
    /// Binary cross-entropy of occupancy off the surface.
    pub occupancy: f64,
    /// Absolute error of the truncated signed distance off the surface, per metre.
    pub distance: f64,
    /// Distances are truncated here, metres.
    pub truncation: f64,
    /// Squared error of the deformed normal.
    pub normal: f64,
    /// Absolute error of the colour.
    pub colour: f64,
    /// Passes over the training frames before the colour is trained.
    pub colour_from_epoch: u64,
    /// Binary cross-entropy of points on bones being inside.
    pub bone: f64,
    /// Squared error of the weights at joints.
    pub joint: f64,
    /// Squared error of the weights at canonical vertices of hands and face.
    pub surface: f64,
    /// Squared error of the weights around and inside the canonical body against the nearest surface point's.
    ///
    /// Not in the thesis: without it, the weights deep inside are free, and the search finds roots there for empty space.
    pub volume: f64,
    /// (|grad f| - 1)^2 around the canonical body.
    pub eikonal: f64,
    /// Points for it a frame.
    pub eikonal_points: usize,
}

impl LossSettings {
    pub(super) fn check(&self) -> Result<()> {
        positive("losses.truncation", self.truncation)?;
        for (name, value) in super::numbers("losses", self)? {
            within(&name, value, 1e6)?;
        }
        Ok(())
    }
}
