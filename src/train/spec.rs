//! What an avatar is trained with, as one value.

use super::clothing;
use super::frames::Frames;
use super::supervision::{PreparedFrame, check_kind};
use crate::Result;
use crate::body::{BodyModel, PartLabels};
use crate::config::Config;
use crate::data::{Capture, Source};

/// The settings, the captures, and the body that is registered to them.
#[derive(Clone, Copy)]
pub struct TrainingSpec<'a> {
    /// The settings.
    pub config: &'a Config,
    /// The captures to learn from.
    pub source: &'a dyn Source,
    /// The body model.
    pub body: &'a BodyModel,
    /// Its vertices' parts.
    pub labels: &'a PartLabels,
}

impl<'a> TrainingSpec<'a> {
    /// Refuses settings that are for captures of another kind.
    ///
    /// # Errors
    /// [`InputError::Value`](crate::InputError::Value) names the presets that fit.
    pub fn check(&self) -> Result<()> {
        check_kind(self.source.kind(), self.config)
    }

    /// The body in the canonical pose that suits the captures: its head bowed, by the angle of the settings, if hair hangs down the back.
    ///
    /// # Errors
    /// A capture that cannot be read or prepared.
    pub fn canonical_body(&self) -> Result<BodyModel> {
        let angle = self.config.bowed_head;
        let skeleton = self.body.skeleton();
        let joints = self.body.canonical_joints(self.source.betas())?;
        let is_bowed = angle > 0.0 && clothing::hair_hangs(&mut Frames::new(*self), skeleton, &joints)?;
        Ok(self.body.in_canonical_pose_of(&skeleton.bowed(if is_bowed { angle } else { 0.0 }))?)
    }

    /// Makes a capture ready to be drawn from. One that can be prepared can be trained on.
    ///
    /// # Errors
    /// As [`PreparedFrame::new`].
    pub fn prepare(&self, capture: Capture) -> Result<PreparedFrame<'a>> {
        PreparedFrame::new(capture, self.body, self.labels, self.config)
    }
}
