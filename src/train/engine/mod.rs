//! What computes training steps: all that reads parameters or writes gradients is behind this seam.
//!
//! A step on frames is [`Engine::begin`], [`Engine::frame`] for each of its frames, [`Engine::update`]. What comes in are draws, made
//! ahead of time on the CPU; what goes out are a few numbers a step, which may be told one step late, so that an engine on a device
//! never has to be waited for. [`CpuEngine`] is the reference.

mod cpu;
mod roots;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use xavatar_deformer::SearchStatistics;
use xavatar_network::Adam;

pub use cpu::CpuEngine;

use super::DistanceGrid;
use super::drawn::Drawn;
use super::losses::{CanonicalBatch, LossTerms};
use crate::Result;
use crate::config::{Config, LossSettings};
use crate::fields::{FieldRates, Fields, PerField, Poser};

/// All that training moves.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The fields.
    pub fields: Fields<f32>,
    /// Their moments.
    pub adam: PerField<Adam<f32>>,
    /// The skinning field's parameters when they were last sampled for the search; none where it runs on the field itself.
    pub sampled_skinning: Option<Vec<f32>>,
}

impl Learned {
    /// Fields that no step has moved.
    pub fn new(fields: Fields<f32>) -> Self {
        let adam = fields.parameters().map(|parameters| Adam::new(parameters.len()));
        Self { fields, adam, sampled_skinning: None }
    }
}

/// What an engine begins with.
#[derive(Debug)]
pub struct EngineInput {
    /// The configuration of the run.
    pub config: Config,
    /// Poses fields for the points of training frames.
    pub poser: Poser,
    /// Signed distance to the canonical body, by which [`Assignment::Body`](crate::config::Assignment::Body) chooses.
    pub distances: Arc<DistanceGrid>,
    /// What is learned so far.
    pub learned: Learned,
}

/// What one step measured.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Loss terms, unweighted, and their weighted sum `total`; means over the frames.
    pub losses: LossTerms,
    /// The joint norm of all gradients before clipping.
    pub gradient_norm: f64,
    /// Of the searches of all frames.
    pub search: SearchStatistics,
    /// Points inside the body without any correspondence.
    pub inside_without_root: usize,
    /// Seconds by phase.
    pub seconds: BTreeMap<&'static str, f64>,
}

impl Outcome {
    /// Adds a frame's share of the losses.
    fn add_losses(&mut self, terms: &LossTerms, share: f64) {
        for (name, value) in terms {
            *self.losses.entry(name).or_default() += share * value;
        }
    }

    /// Adds the time since `begin` to a phase.
    fn add_time(&mut self, phase: &'static str, begin: Instant) {
        *self.seconds.entry(phase).or_default() += begin.elapsed().as_secs_f64();
    }

    /// What of it is not a finite number, if anything: then the step has moved no parameter, or none of them is of use any more.
    pub fn not_finite(&self) -> Option<String> {
        let loss = self.losses.iter().find(|(_, value)| !value.is_finite());
        let gradient = (!self.gradient_norm.is_finite()).then(|| "the gradient".to_owned());
        loss.map(|(name, _)| format!("the loss `{name}`")).or(gradient)
    }
}

/// Computes training steps on fields that it holds.
pub trait Engine: Send {
    /// Adds the losses and gradients of a step of stage 0, whose points are canonical ones.
    ///
    /// # Errors
    /// If the batch's arrays disagree about the skeleton.
    fn pretrain(&mut self, batch: CanonicalBatch<f32>, losses: &LossSettings) -> Result<()>;

    /// Begins step number `step` on frames: what is made anew every few steps is made here.
    ///
    /// # Errors
    /// If the skinning field cannot be sampled on the configured grid.
    fn begin(&mut self, step: u64) -> Result<()>;

    /// Adds `share` times the losses and gradients of a frame.
    ///
    /// # Errors
    /// [`Error::Frame`](crate::Error::Frame) names the frame if its points cannot be searched.
    fn frame(&mut self, drawn: Drawn, losses: &LossSettings, share: f64) -> Result<()>;

    /// Ends a step: clips the gradient and moves the parameters. Tells the outcome of this step, or of the one before; none if that
    /// is not known yet either.
    ///
    /// # Errors
    /// If an outcome cannot be had.
    fn update(&mut self, rates: &FieldRates) -> Result<Option<Outcome>>;

    /// Waits for the last step; its outcome if [`Engine::update`] has not told it.
    ///
    /// # Errors
    /// If the outcome cannot be had.
    fn settle(&mut self) -> Result<Option<Outcome>>;

    /// What is learned, after [`Engine::settle`].
    ///
    /// # Errors
    /// If the parameters cannot be had.
    fn learned(&mut self) -> Result<&Learned>;
}
