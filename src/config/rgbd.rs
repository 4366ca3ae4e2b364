//! What the frames of an RGB-D camera are drawn from, beside what they share with scans (METHOD section 5).

use serde::{Deserialize, Serialize};

use super::{SamplingSettings, within};
use crate::Result;

/// Points drawn from each RGB-D frame; presets for scans have none of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RgbdSettings {
    /// Share of P around eyes and mouth, a part of `sampling.face_share` (thesis: 1/5).
    pub eyes_mouth_share: f64,
    /// Whether each surface point has a twin off the surface, with the distance to the nearest observed point as its target.
    ///
    /// Not in the thesis, where the Eikonal term alone says what is off the surface.
    pub off_surface: bool,
    /// How far behind the observed surface of a hand its distance is believed, metres: fingers are thin.
    pub hand_depth: f32,
    /// Points around the registered body where no frame has seen it.
    ///
    /// Not in the thesis: without them, what stage 0 left there drifts.
    pub unseen_points: usize,
}

impl RgbdSettings {
    pub(super) fn check(&self, sampling: &SamplingSettings) -> Result<()> {
        within("rgbd.eyes_mouth_share", self.eyes_mouth_share, sampling.face_share)?;
        within("rgbd.hand_depth", self.hand_depth.into(), 1.0)?;
        within("rgbd.unseen_points", self.unseen_points as f64, 1e7)
    }
}
