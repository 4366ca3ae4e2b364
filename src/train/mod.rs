//! Training: samples of posed frames -> correspondences -> fields -> losses -> gradients (thesis ch. 4.3).
//!
//! Stage 0 fits geometry and skinning to the body model; then each step takes a few frames. A run is a folder: `config.toml`,
//! `cache/`, `metrics.jsonl`, `checkpoints/`, `previews/`, and at the end `avatar.safetensors`.

mod camera_sampling;
mod camera_view;
mod canonical_body;
mod captured;
mod checkpoint;
mod curve;
mod distance_grid;
mod drawn;
pub mod engine;
mod epochs;
mod event_file;
mod frame_store;
mod history;
pub mod losses;
mod metrics_log;
mod part_shares;
mod prepared;
mod preview;
mod record;
mod sampling;
mod stored;
mod trainer;

use std::path::Path;

pub use captured::TrainingFrames;
pub use distance_grid::DistanceGrid;
pub use drawn::{Drawn, PosedSamples};
pub use history::{NotedStep, has_notes, noted_steps, previews, seconds_per_step};
pub use record::{Stage, StepRecord};
pub use trainer::{Ending, Trainer};

/// Whoever watches a run.
pub trait Observer {
    /// Is told what happened.
    fn event(&mut self, event: Event<'_>);
}

/// A closure that takes events; `|_: Event<'_>| {}` watches nothing.
impl<F: FnMut(Event<'_>)> Observer for F {
    fn event(&mut self, event: Event<'_>) {
        self(event);
    }
}

/// What happens in a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// Frames are read, checked and stored.
    Preparing {
        /// Frames done.
        done: usize,
        /// Frames there are.
        total: usize,
    },
    /// A step of either stage is done.
    Step {
        /// Share of the whole run that is done, 0 to 1.
        progress: f64,
        /// What was measured.
        record: &'a StepRecord,
    },
    /// A checkpoint was written.
    Checkpoint {
        /// Where.
        path: &'a Path,
    },
    /// A preview picture was written.
    Preview {
        /// Where.
        path: &'a Path,
    },
    /// Something the user should know.
    Warning {
        /// What.
        message: String,
    },
}
