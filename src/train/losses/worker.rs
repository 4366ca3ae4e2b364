//! One thread of the loss evaluator: its gradients, its sums, and the memory of a block of rows.

use xavatar_deformer::Jacobian;
use xavatar_network::{Real, Trace};

use super::kernel::Term;
use super::{CanonicalBatch, LossTerms};
use crate::config::LossSettings;
use crate::fields::{Blend, FieldGradients, Fields};

/// What all blocks of one frame share.
pub(super) struct Frame<'a, T> {
    pub fields: &'a Fields<T>,
    pub batch: &'a CanonicalBatch<T>,
    pub losses: &'a LossSettings,
    pub share: f64,
    pub embedded: &'a [T],
}

/// One thread's activations, gradients and sums.
#[derive(Debug)]
pub(super) struct Worker<T> {
    pub gradients: FieldGradients<T>,
    terms: LossTerms,
    embedded_cotangent: Vec<T>,
    pub geometry: Trace<T>,
    pub texture: Trace<T>,
    pub skinning: Blend<T>,
    pub buffers: Buffers<T>,
}

/// Row buffers of one block.
#[derive(Debug, Default)]
pub(super) struct Buffers<T> {
    pub values: Vec<T>,
    pub normals: Vec<[T; 3]>,
    pub colours: Vec<T>,
    pub texture_points: Vec<T>,
    pub features: Vec<T>,
    pub weight_cotangents: Vec<T>,
    pub normal_cotangents: Vec<[T; 3]>,
    pub gradient_cotangents: Vec<[T; 3]>,
    pub jacobian_cotangents: Vec<Jacobian<T>>,
}

impl<T: Real> Frame<'_, T> {
    /// share * weight / N: what a point's unweighted loss is multiplied by.
    pub fn factor(&self, term: &Term, points: usize) -> T {
        T::of(self.share * (term.weight)(self.losses) / points as f64)
    }

    /// Whether a loss has a weight.
    pub fn wants(&self, term: &Term) -> bool {
        (term.weight)(self.losses) > 0.0
    }
}

impl<T: Real> Worker<T> {
    pub fn new(fields: &Fields<T>) -> Self {
        Self {
            gradients: FieldGradients::zero(fields),
            terms: LossTerms::new(),
            embedded_cotangent: Vec::new(),
            geometry: Trace::default(),
            texture: Trace::default(),
            skinning: Blend::default(),
            buffers: Buffers::default(),
        }
    }

    /// Forgets all of the frame before but the gradients. `embedded`: entries of the embedded condition.
    pub fn begin_frame(&mut self, embedded: usize) {
        self.terms.clear();
        self.gradients.skinning.begin_frame();
        self.embedded_cotangent.clear();
        self.embedded_cotangent.resize(embedded, T::zero());
    }

    /// Pulls what the frame's blocks have asked of the condition back to the embedding.
    pub fn end_frame(&mut self, frame: &Frame<T>) {
        let Self { gradients, embedded_cotangent, .. } = self;
        let network = &frame.fields.geometry.mlp;
        network.embed_backward(&frame.batch.condition, embedded_cotangent, &mut gradients.geometry);
    }

    /// The sums of the frame's blocks.
    pub fn terms(&self) -> &LossTerms {
        &self.terms
    }

    /// Adds a block's share of the mean over `points`.
    pub fn add_term(&mut self, term: &Term, sum: f64, points: usize) {
        *self.terms.entry(term.name).or_default() += sum / points as f64;
    }

    pub fn add_embedded(&mut self, cotangent: &[T]) {
        for (sum, value) in self.embedded_cotangent.iter_mut().zip(cotangent) {
            *sum += *value;
        }
    }
}
