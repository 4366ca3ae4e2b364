//! Gradients of a network: one a thread while a batch is swept, then their sum, which the optimiser takes.
//!
//! A grid's table may have millions of entries of which a batch touches some: threads' tables are summed and cleared in
//! parallel chunks, in the order of the threads, and runs of zeros are read but never written.

use rayon::prelude::*;

use super::{Mlp, norm};
use crate::Real;
use xavatar_vector::vectorised;

/// Numbers of a table that one task sums.
const CHUNK: usize = 1 << 14;
/// Numbers of a table that are skipped together if all are zero: a cache line of f32.
const RUN: usize = 16;

/// The gradient of a loss with respect to a network's folded weights, its embedding's parameters and its grid's table.
/// One a thread.
#[derive(Clone, Debug)]
pub struct MlpGradient<T> {
    pub(super) folded: Vec<T>,
    pub(super) embedding: Vec<T>,
    pub(super) table: Vec<T>,
}

/// The gradient of one network's parameters, summed over threads: what [`crate::Adam::step_network`] takes.
///
/// Borrows the threads' gradients; they are zero again once the step is done.
#[derive(Debug)]
pub struct SummedGradient<'a, T> {
    /// Of the parameters after the table.
    pub(crate) network: Vec<T>,
    /// Of the grid's table.
    pub(crate) table: &'a mut [T],
    squared_norm: f64,
}

impl<T> SummedGradient<'_, T> {
    /// The sum of all entries' squares; not finite if an entry is not.
    pub fn squared_norm(&self) -> f64 {
        self.squared_norm
    }

    /// The gradient, flat, in the order of [`Mlp::layout`].
    pub fn to_vec(&self) -> Vec<T>
    where
        T: Clone,
    {
        [&*self.table, &self.network].concat()
    }
}

impl<T: Real> MlpGradient<T> {
    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.clear_layers();
        self.table.par_chunks_mut(CHUNK).for_each(|chunk| chunk.fill(T::zero()));
    }

    fn clear_layers(&mut self) {
        self.folded.fill(T::zero());
        self.embedding.fill(T::zero());
    }

    /// Adds another gradient of the same network.
    pub fn add(&mut self, other: &Self) {
        self.add_layers(other);
        let chunks = self.table.par_chunks_mut(CHUNK).zip(other.table.par_chunks(CHUNK));
        chunks.for_each(|(sums, terms)| sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += *term));
    }

    fn add_layers(&mut self, other: &Self) {
        for (sum, term) in self.folded.iter_mut().zip(&other.folded) {
            *sum += *term;
        }
        for (sum, term) in self.embedding.iter_mut().zip(&other.embedding) {
            *sum += *term;
        }
    }
}

impl<T: Real> Mlp<T> {
    /// A gradient of zeros.
    pub fn zero_gradient(&self) -> MlpGradient<T> {
        let embedding = self.embedding.as_ref().map_or(0, |embedding| embedding.weight.len() + embedding.bias.len());
        MlpGradient {
            folded: vec![T::zero(); self.folded.len()],
            embedding: vec![T::zero(); embedding],
            table: vec![T::zero(); self.table.len()],
        }
    }

    /// Turns a gradient of the folded weights into one of the parameters, in the order of [`Mlp::layout`].
    pub fn parameter_gradient(&self, gradient: &MlpGradient<T>, result: &mut [T]) {
        let (table, network) = result.split_at_mut(self.table.len());
        table.copy_from_slice(&gradient.table);
        self.unfold(gradient, network);
    }

    /// Sums the gradients of at least one thread, in their order, and sets them to zero, but for the sum itself.
    pub fn sum_gradients<'a>(
        &self,
        threads: impl IntoIterator<Item = &'a mut MlpGradient<T>>,
    ) -> SummedGradient<'a, T> {
        let mut threads = threads.into_iter();
        let first = threads.next().expect("at least one thread");
        let mut tables = Vec::new();
        for other in threads {
            first.add_layers(other);
            other.clear_layers();
            tables.push(other.table.as_mut_slice());
        }
        let mut network = vec![T::zero(); self.parameters.len() - self.table.len()];
        self.unfold(first, &mut network);
        first.clear_layers();
        let table = first.table.as_mut_slice();
        let squared_norm = network.iter().map(|value| value.wide() * value.wide()).sum::<f64>();
        SummedGradient { network, squared_norm: squared_norm + sum_tables(table, tables), table }
    }

    /// W = c g v / |v|:  dg = c dW . v / |v|,  dv = c g / |v| (dW - (dW . v) v / |v|^2). `result` begins after the table.
    fn unfold(&self, gradient: &MlpGradient<T>, result: &mut [T]) {
        let before = self.table.len();
        for layer in &self.layers {
            let scale = T::of(layer.scale);
            let directions = self.parameters[layer.direction.clone()].chunks_exact(layer.inputs);
            let magnitudes = &self.parameters[layer.magnitude.clone()];
            let folded = gradient.folded[layer.folded_weight.clone()].chunks_exact(layer.inputs);
            for (row, (direction, d_weight)) in directions.zip(folded).enumerate() {
                let length = norm(direction);
                let along = direction.iter().zip(d_weight).map(|(v, d)| *v * *d).sum::<T>() / length;
                result[layer.magnitude.start - before + row] = scale * along;
                let factor = scale * magnitudes[row] / length;
                let start = layer.direction.start - before + row * layer.inputs;
                for ((result, v), d) in result[start..start + layer.inputs].iter_mut().zip(direction).zip(d_weight) {
                    *result = factor * (*d - along * *v / length);
                }
            }
            result[layer.bias.start - before..layer.bias.end - before]
                .copy_from_slice(&gradient.folded[layer.folded_bias.clone()]);
        }
        if let Some(embedding) = &self.embedding {
            result[embedding.weight.start - before..embedding.bias.end - before].copy_from_slice(&gradient.embedding);
        }
    }
}

/// Adds `others` to `sum` and clears them; returns the sum's squared norm.
fn sum_tables<T: Real>(sum: &mut [T], others: Vec<&mut [T]>) -> f64 {
    let mut chunks: Vec<(&mut [T], Vec<&mut [T]>)> = sum.chunks_mut(CHUNK).map(|chunk| (chunk, Vec::new())).collect();
    for other in others {
        chunks.iter_mut().zip(other.chunks_mut(CHUNK)).for_each(|((_, terms), chunk)| terms.push(chunk));
    }
    let squares = chunks.into_par_iter().map(|(sum, others)| {
        for other in others {
            vectorised(
                #[inline(always)]
                || {
                    for (sum, terms) in sum.chunks_mut(RUN).zip(other.chunks_mut(RUN)) {
                        if !all_zero(terms) {
                            sum.iter_mut().zip(terms.iter()).for_each(|(sum, term)| *sum += *term);
                            terms.fill(T::zero());
                        }
                    }
                },
            );
        }
        squared_norm(sum)
    });
    squares.collect::<Vec<_>>().into_iter().sum()
}

/// The sum of squares, in lanes that do not depend on the machine's vector width.
fn squared_norm<T: Real>(values: &[T]) -> f64 {
    let mut lanes = [0.0; RUN];
    vectorised(
        #[inline(always)]
        || {
            for run in values.chunks(RUN) {
                if !all_zero(run) {
                    for (lane, value) in lanes.iter_mut().zip(run) {
                        *lane += value.wide() * value.wide();
                    }
                }
            }
        },
    );
    lanes.iter().sum()
}

/// Visits the runs of a table's gradient that are not all zero, in parallel, with what belongs to them; clears them after.
pub(crate) fn for_each_touched<T: Real>(
    gradient: &mut [T],
    parameters: &mut [T],
    moments: [&mut [T]; 2],
    visit: impl Fn(&[T], &mut [T], [&mut [T]; 2]) + Sync,
) {
    let [first, second] = moments;
    let state = parameters.par_chunks_mut(CHUNK).zip(first.par_chunks_mut(CHUNK)).zip(second.par_chunks_mut(CHUNK));
    gradient.par_chunks_mut(CHUNK).zip(state).for_each(|(gradient, ((parameters, first), second))| {
        vectorised(
            #[inline(always)]
            || {
                let moments = first.chunks_mut(RUN).zip(second.chunks_mut(RUN));
                let runs = gradient.chunks_mut(RUN).zip(parameters.chunks_mut(RUN)).zip(moments);
                for ((gradient, parameters), (first, second)) in runs {
                    if !all_zero(gradient) {
                        visit(gradient, parameters, [first, second]);
                        gradient.fill(T::zero());
                    }
                }
            },
        );
    });
}

/// Without an early exit, so that it is a few vector instructions. NaN is not zero.
#[inline(always)]
fn all_zero<T: Real>(values: &[T]) -> bool {
    values.iter().fold(true, |zero, value| zero & (*value == T::zero()))
}
