//! When a run ends, and how often it saves and shows.

use serde::{Deserialize, Serialize};

use super::{positive, within};
use crate::Result;

/// How long to train, and how often to save and show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Steps on the user's frames.
    pub steps: u64,
    /// Wall time of the whole command; 0 for no limit. When given, it ends training instead of `steps`.
    pub minutes: f64,
    /// Passes over the training frames that end training before `minutes` do: more would fit what the frames have of their
    /// own, as wrinkles, and unseen poses would suffer. 0 for no such bound.
    #[serde(default)]
    pub most_epochs: u64,
    /// Steps of stage 0, on the body model.
    pub pretraining_steps: u64,
    /// Steps between checkpoints.
    pub checkpoint_steps: u64,
    /// Steps between previews; 0 for none.
    pub preview_steps: u64,
    /// How often the frames' poses are refined by the avatar that is learned so far: at half of the training, then at half of the rest.
    #[serde(default)]
    pub pose_refinements: u64,
}

impl Schedule {
    pub(super) fn check(&self) -> Result<()> {
        positive("schedule.checkpoint_steps", self.checkpoint_steps as f64)?;
        within("schedule.minutes", self.minutes, 1e6)?;
        within("schedule.most_epochs", self.most_epochs as f64, 1e9)?;
        within("schedule.pose_refinements", self.pose_refinements as f64, 100.0)
    }
}
