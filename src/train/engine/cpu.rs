//! The engine on this machine's processors: search, losses, gradients and update, each parallel over blocks of points.
//!
//! The result depends on the draws and on the number of threads, and on nothing else.

use std::time::Instant;

use super::roots::{RootFinder, Roots};
use super::{Engine, EngineInput, Learned, Outcome};
use crate::config::{LossSettings, SearchedField};
use crate::fields::{FieldRates, Poser};
use crate::train::drawn::Drawn;
use crate::train::losses::{CanonicalBatch, LossEvaluator};
use crate::{Error, Result};

/// Trains on rayon's threads.
#[derive(Debug)]
pub struct CpuEngine {
    learned: Learned,
    poser: Poser,
    searched_field: SearchedField,
    finder: RootFinder,
    losses: LossEvaluator<f32>,
    /// The gradient of the logits of a skinning field that is a grid; empty without one.
    logit_gradient: Vec<f32>,
    /// Weight of the pull on those logits.
    pull: f32,
    /// The largest norm that clipping leaves of the gradient.
    clip: f64,
    /// Of the step that is under way.
    outcome: Outcome,
}

impl CpuEngine {
    /// An engine that goes on from what is learned.
    ///
    /// # Errors
    /// If the skinning field cannot be sampled on the configured grid.
    pub fn new(input: EngineInput) -> Result<Self> {
        let EngineInput { config, mut poser, distances, learned } = input;
        // The samples that an uninterrupted run would be searching on.
        if let Some(parameters) = &learned.sampled_skinning {
            let mut skinning = learned.fields.skinning.clone();
            skinning.update(|target| target.copy_from_slice(parameters));
            poser.bake(&skinning)?;
        }
        Ok(Self {
            losses: LossEvaluator::new(&learned.fields, rayon::current_num_threads()),
            logit_gradient: learned.fields.skinning.zero_logit_gradient(),
            finder: RootFinder { assignment: config.assignment, distances },
            searched_field: config.searched_field,
            pull: config.losses.volume as f32,
            clip: config.optimiser.clip,
            outcome: Outcome::default(),
            learned,
            poser,
        })
    }
}

impl Engine for CpuEngine {
    fn pretrain(&mut self, batch: CanonicalBatch<f32>, losses: &LossSettings) -> Result<()> {
        let terms = self.losses.accumulate(&self.learned.fields, &batch, losses, 1.0)?;
        self.outcome.add_losses(&terms, 1.0);
        Ok(())
    }

    fn begin(&mut self, step: u64) -> Result<()> {
        if let SearchedField::Baked { refresh_steps, .. } = self.searched_field
            && (!self.poser.is_baked() || step.is_multiple_of(refresh_steps))
        {
            let skinning = &self.learned.fields.skinning;
            self.poser.bake(skinning)?;
            self.learned.sampled_skinning = self.poser.is_baked().then(|| skinning.parameters().to_vec());
        }
        Ok(())
    }

    fn frame(&mut self, drawn: Drawn, losses: &LossSettings, share: f64) -> Result<()> {
        let Self { learned: Learned { fields, .. }, outcome, .. } = self;
        let (frame, pose) = (drawn.frame.to_string(), drawn.pose.clone());
        let in_frame = |error: Error| error.in_frame(&frame);
        let begin = Instant::now();
        let posed = self.poser.pose(fields, &pose, &drawn.condition).map_err(in_frame)?;
        outcome.add_time("warp", begin);
        let begin = Instant::now();
        let Roots { batch, statistics, inside_without_root } = self.finder.find(drawn, &posed).map_err(in_frame)?;
        outcome.search = outcome.search.and(statistics);
        outcome.inside_without_root += inside_without_root;
        outcome.add_time("search", begin);
        let begin = Instant::now();
        let terms = self.losses.accumulate(fields, &batch, losses, share)?;
        outcome.add_losses(&terms, share);
        outcome.add_time("losses", begin);
        let begin = Instant::now();
        let cotangents = || self.losses.root_cotangents(batch.off_points.len());
        posed.pull_back_roots(&batch.off_points, cotangents, &mut self.logit_gradient)?;
        outcome.add_time("skinning", begin);
        Ok(())
    }

    fn update(&mut self, rates: &FieldRates) -> Result<Option<Outcome>> {
        let begin = Instant::now();
        let mut outcome = std::mem::take(&mut self.outcome);
        let Learned { fields, adam, .. } = &mut self.learned;
        if let Some(pull) = fields.skinning.pull_to_initial(self.pull, &mut self.logit_gradient)? {
            outcome.losses.insert("volume", f64::from(pull));
        }
        let gradient = self.losses.sum_gradients(fields, &mut self.logit_gradient);
        outcome.gradient_norm = gradient.norm();
        if outcome.not_finite().is_none() {
            let factor = (self.clip / outcome.gradient_norm).min(1.0);
            gradient.step(fields, adam, rates, factor);
        }
        outcome.add_time("optimiser", begin);
        Ok(Some(outcome))
    }

    fn settle(&mut self) -> Result<Option<Outcome>> {
        Ok(None)
    }

    fn learned(&mut self) -> Result<&Learned> {
        Ok(&self.learned)
    }
}
