//! How the parameters move.

use serde::{Deserialize, Serialize};

use super::{positive, within};
use crate::Result;

/// Adam and its learning rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OptimiserSettings {
    /// Learning rate of the networks at the first step.
    pub learning_rate: f64,
    /// That of the geometry's hash grid.
    pub grid_learning_rate: f64,
    /// That of the texture's: colours are larger numbers than distances in metres.
    pub colour_grid_learning_rate: f64,
    /// That of the skinning logits of a grid.
    pub voxel_learning_rate: f64,
    /// Share of it that is left at the last step, falling exponentially; 1 keeps it constant.
    pub final_share: f64,
    /// The joint norm of all gradients is clipped to this.
    pub clip: f64,
    /// Frames a step.
    pub batch_frames: usize,
}

impl OptimiserSettings {
    pub(super) fn check(&self) -> Result<()> {
        positive("optimiser.learning_rate", self.learning_rate)?;
        positive("optimiser.grid_learning_rate", self.grid_learning_rate)?;
        positive("optimiser.colour_grid_learning_rate", self.colour_grid_learning_rate)?;
        within("optimiser.voxel_learning_rate", self.voxel_learning_rate, 1e3)?;
        positive("optimiser.clip", self.clip)?;
        positive("optimiser.final_share", self.final_share)?;
        positive("optimiser.batch_frames", self.batch_frames as f64)
    }
}
