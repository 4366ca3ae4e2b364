//! Training: samples of posed frames -> correspondences -> fields -> losses -> gradients (thesis ch. 4.3).
//!
//! Stage 0 fits geometry and skinning to the body model; then each step takes a few frames. A run is a folder: `config.toml`,
//! `cache/`, `metrics.jsonl`, `checkpoints/`, `previews/`, and at the end `avatar.safetensors`.

mod camera_sampling;
mod camera_view;
mod captured;
mod checkpoint;
mod curve;
mod distance_grid;
mod event_file;
mod frame_store;
mod history;
pub mod losses;
mod metrics_log;
mod part_shares;
mod prepared;
mod pretraining;
mod preview;
mod sampling;
mod step;
mod stored;
mod trainer;

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

pub use captured::TrainingFrames;
pub(crate) use checkpoint::{insert_parameters, load_parameters, load_voxels};
pub use history::{NotedStep, has_notes, noted_steps, previews, seconds_per_step};
pub use trainer::{Ending, Trainer};

use losses::LossTerms;

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

/// The stage of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Stage 0: the body model in canonical space.
    Pretraining,
    /// The user's frames.
    Frames,
}

/// What was measured in one step: a line of `metrics.jsonl`.
#[derive(Clone, Debug, Serialize)]
pub struct StepRecord {
    /// The stage.
    pub stage: Stage,
    /// Steps done in this stage.
    pub step: u64,
    /// Steps this stage has; none if time ends it.
    pub steps: Option<u64>,
    /// The frames used, as `split/sequence/number`.
    pub frames: Vec<String>,
    /// Wall time of the step.
    pub seconds: f64,
    /// Where that time went: sampling, search, losses, optimiser.
    pub split: BTreeMap<&'static str, f64>,
    /// Points drawn, on and off the surface and in the canonical box.
    pub points: usize,
    /// The learning rate.
    pub learning_rate: f64,
    /// The joint norm of all gradients before clipping.
    pub gradient_norm: f64,
    /// Loss terms, unweighted, and their weighted sum `total`; means over the frames.
    pub losses: LossTerms,
    /// Share of the search's starts that converged.
    pub converged: f64,
    /// Points without any correspondence.
    pub points_without_root: usize,
    /// Those of them that are inside the body: nothing can be learned from them.
    pub inside_without_root: usize,
}
