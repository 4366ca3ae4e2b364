//! How many points are drawn from a frame, and where.

use serde::{Deserialize, Serialize};

use super::{positive, within};
use crate::Result;

/// Where surface points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SamplingStrategy {
    /// More on face and hands (thesis ch. 4.2.4).
    PartAware,
    /// Uniformly by area (ablation A3).
    Uniform,
}

/// Which surface supervises the hands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HandSupervision {
    /// The registered body: volumetric scans fuse fingers.
    Registration,
    /// What was captured: the scan, or the points that a camera sees.
    Scan,
}

/// Points drawn from each frame at each step (METHOD section 4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SamplingSettings {
    /// P: shares of it go to body, face and hands.
    pub points: usize,
    /// Share of P on the body (thesis: 1/3).
    pub body_share: f64,
    /// Share of P on the face, half of it around eyes and mouth (thesis: 1/3).
    pub face_share: f64,
    /// Share of P on each hand (thesis: 1/8).
    pub hand_share: f64,
    /// Canonical points drawn in the canonical box, kept where the body model alone decides between inside and outside.
    ///
    /// Not in the thesis: without them, space that only ever poses into the body may become body, and shows in a new pose.
    pub far_points: usize,
    /// Standard deviation of the noise that moves surface points off the surface, metres.
    pub deviation: f32,
    /// Share of the points off the surface that get `wide_deviation` instead.
    pub wide_share: f32,
    /// A larger standard deviation, so that the interior is sampled too, metres.
    pub wide_deviation: f32,
    /// Where surface points are drawn.
    pub strategy: SamplingStrategy,
    /// Which surface supervises the hands.
    pub hand_supervision: HandSupervision,
}

impl SamplingSettings {
    pub(super) fn check(&self) -> Result<()> {
        within("sampling.points", self.points as f64, 1e7)?;
        positive("sampling.points", self.points as f64)?;
        positive("sampling.deviation", self.deviation.into())?;
        positive("sampling.wide_deviation", self.wide_deviation.into())?;
        within("sampling.wide_share", self.wide_share.into(), 1.0)?;
        within("sampling.body_share", self.body_share, 1.0)?;
        within("sampling.face_share", self.face_share, 1.0)?;
        within("sampling.hand_share", self.hand_share, 1.0)
    }
}
