//! The loss terms and their gradients at known canonical points (thesis ch. 4.3.1, METHOD section 5).
//!
//! L = occupancy BCE(P_off), or distance |f - d| (P_off, P_on), and normal ||n_d - n||^2, colour ||c - c_gt||_1 (P_on),
//! bone BCE(points on bones are inside), joint, surface and volume ||w - w_gt||^2, eikonal (|grad f| - 1)^2, free space (f within
//! bounds); each times its weight.
//! Means over points, sums over components. Where an off-surface point was found by the search, its cotangent goes on to the
//! skinning field by the implicit function theorem.
//!
//! Each thread takes every T-th block of rows into gradients of its own, which are summed in thread order: the result
//! depends on the number of threads T and on nothing else.

mod free_space;
mod off_surface;
mod on_surface;
mod pointwise;
mod regularisers;

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;
use xavatar_deformer::{BoneTransform, Jacobian};
use xavatar_network::{Real, Trace};

use crate::Result;
use crate::config::LossSettings;
use crate::fields::{BLOCK_ROWS, Blend, FieldGradients, Fields, SkinningGradient, SummedGradients};

/// What one frame's losses are computed from, in canonical space.
#[derive(Clone, Debug, Default)]
pub struct CanonicalBatch<T> {
    /// c = [theta_b / pi, psi].
    pub condition: Vec<T>,
    /// Bone transforms, canonical to posed (J).
    pub bones: Vec<BoneTransform<T>>,
    /// P_off: canonical points.
    pub off_points: Vec<[T; 3]>,
    /// Of each: 1 inside and 0 outside for occupancy; else the signed distance, metres.
    pub off_targets: Vec<T>,
    /// Canonical points that are far from the surface whatever the frame, on a side that is known.
    pub far_points: Vec<[T; 3]>,
    /// Of each: what `off_targets` holds.
    pub far_targets: Vec<T>,
    /// P_on: canonical points.
    pub on_points: Vec<[T; 3]>,
    /// Of each: the unit normal of the deformed surface.
    pub on_normals: Vec<[T; 3]>,
    /// Of each: the colour in [0, 1].
    pub on_colours: Vec<[T; 3]>,
    /// Canonical points on bones, all inside.
    pub bone_points: Vec<[T; 3]>,
    /// Canonical joints, and the weights they should have (., J).
    pub joint_weights: WeightTargets<T>,
    /// Canonical vertices of hands and face, and the weights they should have (., J).
    pub surface_weights: WeightTargets<T>,
    /// Canonical points around and inside the body, and the weights of the nearest place on its surface (., J).
    pub volume_weights: WeightTargets<T>,
    /// Canonical points where the field should be a distance.
    pub eikonal_points: Vec<[T; 3]>,
    /// Canonical points of the air.
    pub free_points: Vec<[T; 3]>,
    /// Of each: the least and the greatest distance that the surface may have from it, metres.
    pub free_bounds: Vec<[T; 2]>,
    /// Whether the off-surface cotangents reach the skinning field.
    pub implicit_gradient: bool,
}

/// Canonical points and the skinning weights they should have.
#[derive(Clone, Debug, Default)]
pub struct WeightTargets<T> {
    /// Canonical points (N).
    pub points: Vec<[T; 3]>,
    /// Weights (N, J).
    pub weights: Vec<T>,
}

/// The unweighted loss terms by name, and their weighted sum as `total`.
pub type LossTerms = BTreeMap<&'static str, f64>;

#[derive(Clone, Debug)]
enum Block {
    Off(Range<usize>),
    Far(Range<usize>),
    On(Range<usize>),
    Bone(Range<usize>),
    Joint(Range<usize>),
    Surface(Range<usize>),
    Volume(Range<usize>),
    Eikonal(Range<usize>),
    FreeSpace(Range<usize>),
}

/// Computes losses and gradients; keeps the memory of its threads between calls.
#[derive(Debug)]
pub struct LossEvaluator<T> {
    workers: Vec<Worker<T>>,
}

/// One thread's activations, gradients and sums.
#[derive(Debug)]
struct Worker<T> {
    gradients: FieldGradients<T>,
    terms: LossTerms,
    embedded_cotangent: Vec<T>,
    geometry: Trace<T>,
    texture: Trace<T>,
    skinning: Blend<T>,
    buffers: Buffers<T>,
}

/// Row buffers of one block.
#[derive(Debug, Default)]
struct Buffers<T> {
    weight_cotangents: Vec<T>,
    jacobian_cotangents: Vec<Jacobian<T>>,
    normals: Vec<[T; 3]>,
    normal_cotangents: Vec<[T; 3]>,
    gradient_cotangents: Vec<[T; 3]>,
    values: Vec<T>,
    texture_points: Vec<T>,
    features: Vec<T>,
    colours: Vec<T>,
}

impl<T: Real> LossEvaluator<T> {
    /// An evaluator for `fields` that runs on `threads` threads.
    pub fn new(fields: &Fields<T>, threads: usize) -> Self {
        let worker = || Worker {
            gradients: FieldGradients::zero(fields),
            terms: LossTerms::new(),
            embedded_cotangent: Vec::new(),
            geometry: Trace::default(),
            texture: Trace::default(),
            skinning: Blend::default(),
            buffers: Buffers::default(),
        };
        Self { workers: (0..threads.max(1)).map(|_| worker()).collect() }
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
        let blocks = frame.blocks();
        let threads = self.workers.len();
        self.workers.par_iter_mut().enumerate().try_for_each(|(thread, worker)| {
            worker.terms.clear();
            worker.gradients.skinning.begin_frame();
            worker.embedded_cotangent.clear();
            worker.embedded_cotangent.resize(embedded.len(), T::zero());
            blocks.iter().skip(thread).step_by(threads).try_for_each(|block| worker.run(&frame, block))
        })?;
        let mut terms = LossTerms::new();
        for worker in &mut self.workers {
            let Worker { gradients, embedded_cotangent, .. } = worker;
            fields.geometry.mlp.embed_backward(&batch.condition, embedded_cotangent, &mut gradients.geometry);
            for (name, value) in &worker.terms {
                *terms.entry(name).or_default() += value;
            }
        }
        let total = terms.iter().map(|(name, value)| weight_of(losses, name) * value).sum();
        terms.insert("total", total);
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

fn weight_of(losses: &LossSettings, term: &str) -> f64 {
    match term {
        "occupancy" => losses.occupancy,
        "distance" => losses.distance,
        "normal" => losses.normal,
        "colour" => losses.colour,
        "bone" => losses.bone,
        "joint" => losses.joint,
        "surface" => losses.surface,
        "volume" => losses.volume,
        "eikonal" => losses.eikonal,
        "free_space" => losses.free_space,
        _ => 0.0,
    }
}

/// What all blocks of one frame share.
struct Frame<'a, T> {
    fields: &'a Fields<T>,
    batch: &'a CanonicalBatch<T>,
    losses: &'a LossSettings,
    share: f64,
    embedded: &'a [T],
}

impl<T: Real> Frame<'_, T> {
    /// The blocks of every term whose weight is not zero, the dearest first.
    fn blocks(&self) -> Vec<Block> {
        let LossSettings {
            occupancy, distance, normal, colour, bone, joint, surface, volume, eikonal, free_space, ..
        } = *self.losses;
        let batch = self.batch;
        let mut blocks = Vec::new();
        let mut cut = |wanted: bool, rows: usize, block: fn(Range<usize>) -> Block| {
            if wanted {
                blocks.extend((0..rows).step_by(BLOCK_ROWS).map(|first| block(first..rows.min(first + BLOCK_ROWS))));
            }
        };
        cut(normal + colour + distance > 0.0, batch.on_points.len(), Block::On);
        cut(occupancy + distance > 0.0, batch.off_points.len(), Block::Off);
        cut(occupancy + distance > 0.0, batch.far_points.len(), Block::Far);
        cut(eikonal > 0.0, batch.eikonal_points.len(), Block::Eikonal);
        cut(free_space > 0.0, batch.free_points.len(), Block::FreeSpace);
        cut(bone > 0.0, batch.bone_points.len(), Block::Bone);
        cut(surface > 0.0, batch.surface_weights.points.len(), Block::Surface);
        cut(volume > 0.0, batch.volume_weights.points.len(), Block::Volume);
        cut(joint > 0.0, batch.joint_weights.points.len(), Block::Joint);
        blocks
    }

    /// share * weight / N: what a point's unweighted loss is multiplied by.
    fn factor(&self, weight: f64, points: usize) -> T {
        T::of(self.share * weight / points as f64)
    }
}

impl<T: Real> Worker<T> {
    fn run(&mut self, frame: &Frame<T>, block: &Block) -> Result<()> {
        match block {
            Block::Off(rows) => {
                let batch = frame.batch;
                let points = &batch.off_points[rows.clone()];
                let first_root = batch.implicit_gradient.then_some(rows.start);
                self.off_surface(frame, points, &batch.off_targets[rows.clone()], first_root)
            }
            Block::Far(rows) => {
                let batch = frame.batch;
                self.off_surface(frame, &batch.far_points[rows.clone()], &batch.far_targets[rows.clone()], None)
            }
            Block::On(rows) => self.on_surface(frame, rows.clone()),
            Block::Eikonal(rows) => {
                self.eikonal(frame, rows.clone());
                Ok(())
            }
            Block::FreeSpace(rows) => {
                self.free_space(frame, rows.clone());
                Ok(())
            }
            Block::Bone(rows) => {
                self.bone(frame, rows.clone());
                Ok(())
            }
            Block::Joint(rows) => {
                self.weights("joint", frame, &frame.batch.joint_weights, frame.losses.joint, rows.clone());
                Ok(())
            }
            Block::Surface(rows) => {
                self.weights("surface", frame, &frame.batch.surface_weights, frame.losses.surface, rows.clone());
                Ok(())
            }
            Block::Volume(rows) => {
                self.weights("volume", frame, &frame.batch.volume_weights, frame.losses.volume, rows.clone());
                Ok(())
            }
        }
    }

    fn add_term(&mut self, name: &'static str, sum: f64, points: usize) {
        *self.terms.entry(name).or_default() += sum / points as f64;
    }

    fn add_embedded(&mut self, cotangent: &[T]) {
        for (sum, value) in self.embedded_cotangent.iter_mut().zip(cotangent) {
            *sum += *value;
        }
    }
}
