//! Training: captures -> draws -> correspondences -> fields -> losses -> gradients (thesis ch. 4.3).
//!
//! Stage 0 fits geometry and skinning to the body model; then each step takes a few frames. [`Trainer`] decides which step comes next,
//! [`engine`] computes it, [`supervision`] says what a capture gives to the [`losses`]. Nothing here writes a file: a training that is
//! stored, resumed and watched is a [run](crate::runs).

mod clothing;
mod drawn;
pub mod engine;
mod epochs;
mod frames;
pub mod losses;
mod progress;
mod record;
mod refinement;
mod spec;
pub mod supervision;
mod trainer;

pub use drawn::{Drawn, Origin, PosedSamples, UNKNOWN_DEPTH};
pub use progress::Progress;
pub use record::{Stage, StepRecord};
pub use refinement::{Refined, RefinedPose};
pub use spec::TrainingSpec;
pub use supervision::DistanceGrid;
pub use trainer::{Trainer, TrainingState};
