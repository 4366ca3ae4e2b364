//! What an avatar is trained with, as one value.

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

    /// Makes a capture ready to be drawn from. One that can be prepared can be trained on.
    ///
    /// # Errors
    /// As [`PreparedFrame::new`].
    pub fn prepare(&self, capture: Capture) -> Result<PreparedFrame<'a>> {
        PreparedFrame::new(capture, self.body, self.labels, self.config)
    }
}
