//! The loss terms and their gradients at known canonical points (thesis ch. 4.3.1, METHOD section 5).
//!
//! L = occupancy BCE(P_off), or distance |f - d| (P_off, P_on), and normal ||n_d - n||^2, colour ||c - c_gt||_1 (P_on),
//! bone BCE(points on bones are inside), joint, surface and volume ||w - w_gt||^2, eikonal (|grad f| - 1)^2; each times its weight.
//! Means over points, sums over components. Where an off-surface point was found by the search, its cotangent goes on to the
//! skinning field by the implicit function theorem. `kernel` has the table of losses: a new one is a file, a row there and its
//! weight among the settings.
//!
//! Each thread takes every T-th block of rows into gradients of its own, which are summed in thread order: the result
//! depends on the number of threads T and on nothing else.

mod batch;
mod bone;
mod eikonal;
mod kernel;
mod off_surface;
mod on_surface;
mod pointwise;
mod weights;
mod worker;

use std::collections::BTreeMap;

use rayon::prelude::*;
use xavatar_network::Real;

pub use batch::{Anchors, CanonicalBatch, WeightTargets};

use kernel::{blocks, total};
use worker::{Frame, Worker};

use crate::Result;
use crate::config::LossSettings;
use crate::fields::{Fields, SkinningGradient, SummedGradients};

/// The unweighted loss terms by name, and their weighted sum as `total`.
pub type LossTerms = BTreeMap<&'static str, f64>;

/// Computes losses and gradients; keeps the memory of its threads between calls.
#[derive(Debug)]
pub struct LossEvaluator<T> {
    workers: Vec<Worker<T>>,
}

impl<T: Real> LossEvaluator<T> {
    /// An evaluator for `fields` that runs on `threads` threads.
    pub fn new(fields: &Fields<T>, threads: usize) -> Self {
        Self { workers: (0..threads.max(1)).map(|_| Worker::new(fields)).collect() }
    }

    /// Adds `share` times the gradient of the weighted losses of `batch`; returns the loss terms.
    ///
    /// # Errors
    /// If the batch's arrays disagree about the skeleton.
    pub fn accumulate(
        &mut self,
        fields: &Fields<T>,
        batch: &CanonicalBatch<T>,
        losses: &LossSettings,
        share: f64,
    ) -> Result<LossTerms> {
        let embedded = fields.geometry.mlp.embed(&batch.condition);
        let frame = Frame { fields, batch, losses, share, embedded: &embedded };
        let blocks = blocks(batch, losses);
        let threads = self.workers.len();
        self.workers.par_iter_mut().enumerate().try_for_each(|(thread, worker)| {
            worker.begin_frame(embedded.len());
            blocks.iter().skip(thread).step_by(threads).try_for_each(|block| block.run(worker, &frame))
        })?;
        let mut terms = LossTerms::new();
        for worker in &mut self.workers {
            worker.end_frame(&frame);
            for (name, value) in worker.terms() {
                *terms.entry(name).or_default() += value;
            }
        }
        terms.insert("total", total::<T>(&terms, losses));
        Ok(terms)
    }

    /// The cotangents of the last batch's off-surface points, in their order, for a skinning field on a grid.
    pub fn root_cotangents(&self, points: usize) -> Vec<[T; 3]> {
        let mut cotangents = vec![[T::zero(); 3]; points];
        for worker in &self.workers {
            let SkinningGradient::Grid { roots } = &worker.gradients.skinning else { continue };
            for (first, values) in roots {
                cotangents[*first..first + values.len()].copy_from_slice(values);
            }
        }
        cotangents
    }

    /// Sums the threads' gradients since the last call; `logits` is that of a skinning field on a grid.
    pub fn sum_gradients<'a>(&'a mut self, fields: &Fields<T>, logits: &'a mut [T]) -> SummedGradients<'a, T> {
        SummedGradients::of_threads(fields, self.workers.iter_mut().map(|worker| &mut worker.gradients), logits)
    }
}
