//! What was measured in one step.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::drawn::Drawn;
use super::engine::Outcome;
use super::losses::LossTerms;

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
    /// Where that time went: sampling (beside the rest), warp, search, losses, skinning, optimiser.
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

impl StepRecord {
    /// A step that is begun.
    pub(super) fn of(stage: Stage, step: u64, steps: Option<u64>, learning_rate: f64) -> Self {
        Self {
            stage,
            step,
            steps,
            frames: Vec::new(),
            seconds: 0.0,
            split: BTreeMap::new(),
            points: 0,
            learning_rate,
            gradient_norm: 0.0,
            losses: LossTerms::new(),
            converged: 1.0,
            points_without_root: 0,
            inside_without_root: 0,
        }
    }

    /// Adds what was drawn of a frame.
    pub(super) fn add_frame(&mut self, drawn: &Drawn) {
        self.frames.push(drawn.frame.to_string());
        self.points += drawn.points();
        *self.split.entry("sampling").or_default() += drawn.seconds;
    }

    /// Takes what the engine has measured.
    pub(super) fn take(&mut self, outcome: Outcome) {
        let Outcome { losses, gradient_norm, search, inside_without_root, seconds } = outcome;
        self.losses = losses;
        self.gradient_norm = gradient_norm;
        self.split.extend(seconds);
        if self.stage == Stage::Frames {
            self.converged = search.converged as f64 / search.starts.max(1) as f64;
        }
        self.points_without_root = search.points_without_root;
        self.inside_without_root = inside_without_root;
    }
}
