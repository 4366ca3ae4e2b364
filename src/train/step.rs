//! What one step computes: samples, correspondences, losses and their gradients.
//!
//! Every random draw comes from a generator of its own, derived from (seed, stage, step, slot of the frame), so that the order
//! of execution does not matter.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use xavatar_deformer::{Candidates, SearchStatistics};
use xavatar_network::Representation;

use super::camera_sampling;
use super::curve::Curve;
use super::losses::CanonicalBatch;
use super::prepared::{PreparedFrame, Supervision};
use super::pretraining::CanonicalBody;
use super::sampling::{self, PosedSamples};
use super::trainer::Trainer;
use super::{Stage, StepRecord};
use crate::canonical_grid::CERTAINLY_OUTSIDE;
use crate::config::{Assignment, Config, SearchedField};
use crate::correspondence::{PosedField, PosedWarp, bake};
use crate::fields::Skinning;
use crate::{Error, Result};

/// Vertices of hands and face whose weights are supervised at each step.
const WEIGHT_POINTS: usize = 1024;
/// Depth in the unclothed body below which no point of the scan's surface or outside of it can be, metres. A root there is one
/// of skin that folds over itself: to train through it would hollow the body.
const DEEPEST_SURFACE: f32 = 0.01;
/// Spread of the Eikonal points around canonical vertices, metres (METHOD section 5).
const EIKONAL_SPREAD: f32 = 0.05;

/// A frame that is to be drawn from.
struct Order<'a> {
    place: u64,
    epoch: u64,
    frame: Arc<PreparedFrame<'a>>,
    config: &'a Config,
    representation: Representation,
    random: ChaCha8Rng,
}

/// The samples of one frame of one step.
pub(super) struct Drawn<'a> {
    place: u64,
    epoch: u64,
    frame: Arc<PreparedFrame<'a>>,
    condition: Vec<f32>,
    samples: PosedSamples,
    /// Continues where the drawing stopped.
    random: ChaCha8Rng,
    seconds: f64,
}

impl<'a> Order<'a> {
    fn draw(self) -> Drawn<'a> {
        let begin = Instant::now();
        let Self { place, epoch, frame, config, representation, mut random } = self;
        let dropped = random.random::<f64>() < config.fields.condition_dropout;
        let condition = if dropped { vec![0.0; frame.condition.len()] } else { frame.condition.clone() };
        let truncation = config.losses.truncation as f32;
        let samples = match &frame.supervision {
            Supervision::Scan(scan) => sampling::draw(scan, &config.sampling, representation, truncation, &mut random),
            Supervision::Camera(view) => camera_sampling::draw(view, config, &mut random),
        };
        Drawn { place, epoch, frame, condition, samples, random, seconds: begin.elapsed().as_secs_f64() }
    }
}

impl<'a> Trainer<'a> {
    pub(super) fn pretraining_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let mut random = generator(self.config.seed, Stage::Pretraining, step, 0);
        let batch = self.canonical.batch(self.config, &mut random);
        let losses = CanonicalBody::losses(&self.config.losses);
        record.points = batch.on_points.len() + batch.off_points.len();
        record.losses = self.losses.accumulate(&self.state.fields, &batch, &losses, 1.0)?;
        record.converged = 1.0;
        Ok(())
    }

    pub(super) fn frames_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let count = self.config.optimiser.batch_frames;
        let share = 1.0 / count as f64;
        if let SearchedField::Baked { refresh_steps, .. } = self.config.searched_field
            && (self.baked.is_none() || step.is_multiple_of(refresh_steps))
        {
            let skinning = &self.state.fields.skinning;
            self.baked = bake(skinning, self.config.searched_field, self.subject.bounds)?;
            if let Skinning::Network(field) = skinning {
                self.state.baked_skinning = Some(field.mlp().parameters().to_vec());
            }
        }
        let mut statistics = SearchStatistics::default();
        for slot in 0..count as u64 {
            let place = step * count as u64 + slot;
            let drawn = match self.drawn.take() {
                Some(drawn) if drawn.place == place => drawn,
                _ => self.order(place)?.draw(),
            };
            let next = self.order(place + 1)?;
            // While this frame is trained on, the next is drawn.
            let (trained, drawn) = rayon::join(|| self.train_on(drawn, share, record, &mut statistics), || next.draw());
            trained?;
            self.drawn = Some(drawn);
        }
        record.converged = statistics.converged as f64 / statistics.starts.max(1) as f64;
        record.points_without_root = statistics.points_without_root;
        Ok(())
    }

    /// The frame at a place in the endless sequence of shuffled epochs.
    fn shuffled(&self, place: u64) -> (u64, usize) {
        let count = self.frames.len() as u64;
        let epoch = place / count;
        let mut order: Vec<usize> = (0..self.frames.len()).collect();
        order.shuffle(&mut generator(self.config.seed, Stage::Frames, epoch, u64::MAX));
        (epoch, order[(place % count) as usize])
    }

    /// What is needed to draw from the frame at a place in that sequence, without the trainer.
    fn order(&mut self, place: u64) -> Result<Order<'a>> {
        let count = self.config.optimiser.batch_frames as u64;
        let (epoch, index) = self.shuffled(place);
        let random = generator(self.config.seed, Stage::Frames, place / count, place % count);
        let representation = self.state.fields.geometry.representation;
        Ok(Order { place, epoch, frame: self.frames.prepared(index)?, config: self.config, representation, random })
    }

    /// Adds a drawn frame's losses and gradients.
    fn train_on(
        &mut self,
        drawn: Drawn<'a>,
        share: f64,
        record: &mut StepRecord,
        statistics: &mut SearchStatistics,
    ) -> Result<()> {
        let mut losses = self.config.losses.clone();
        if drawn.epoch < losses.colour_from_epoch {
            losses.colour = 0.0;
        }
        let frame = drawn.frame.clone();
        let begin = Instant::now();
        let offsets = self.grid.as_ref().map(|grid| grid.node_offsets(&frame.offsets));
        let in_frame = |error: Error| error.in_frame(frame.id.to_string());
        let skinning = &self.state.fields.skinning;
        let warp = PosedWarp::new(skinning, self.baked.as_ref(), &frame.bones, offsets.as_deref()).map_err(in_frame)?;
        add_time(record, "warp", begin);
        let batch = self.canonical_batch(drawn, &warp, record, statistics)?;
        let begin = Instant::now();
        let terms = self.losses.accumulate(&self.state.fields, &batch, &losses, share)?;
        add_time(record, "losses", begin);
        if let (Skinning::Voxels(field), PosedWarp::Voxels(warp)) = (skinning, &warp) {
            let begin = Instant::now();
            let cotangents = self.losses.root_cotangents(batch.off_points.len());
            let gradient = &mut self.voxel_gradient;
            field.root_backward(warp, offsets.as_deref(), &batch.off_points, &cotangents, gradient)?;
            add_time(record, "skinning", begin);
        }
        for (name, value) in terms {
            *record.losses.entry(name).or_default() += share * value;
        }
        Ok(())
    }

    /// Finds the canonical correspondences of a frame's points.
    fn canonical_batch(
        &self,
        drawn: Drawn,
        warp: &PosedWarp,
        record: &mut StepRecord,
        statistics: &mut SearchStatistics,
    ) -> Result<CanonicalBatch<f32>> {
        let Drawn { frame, condition, samples, mut random, seconds, .. } = drawn;
        let fields = &self.state.fields;
        let inside = |target: f32| match fields.geometry.representation {
            Representation::Occupancy => target > 0.5,
            Representation::SignedDistance => target < 0.0,
        };
        record.points += samples.on_points.len() + samples.off_points.len() + samples.free_points.len();
        record.frames.push(frame.id.to_string());
        *record.split.entry("sampling").or_default() += seconds;
        let begin = Instant::now();
        let embedded = fields.geometry.mlp.embed(&condition);
        let posed = PosedField {
            fields,
            bones: &frame.bones,
            embedded: &embedded,
            groups: &self.groups,
            settings: &self.config.search,
            warp,
            bounds: self.subject.bounds,
        };
        let in_frame = |error: Error| error.in_frame(frame.id.to_string());
        // One search for all kinds of points: the frame's warp is made once.
        let points = [samples.on_points.as_slice(), &samples.off_points, &samples.free_points].concat();
        let labels = [samples.on_labels.as_slice(), &samples.off_labels, &samples.free_labels].concat();
        let found = posed.candidates(&points, &labels).map_err(in_frame)?;
        // What was captured of a point: on the surface, outside, or inside.
        let on = samples.on_points.iter().map(|_| false);
        let off = samples.off_targets.iter().map(|target| inside(*target));
        let is_inside: Vec<bool> = on.chain(off).chain(samples.free_points.iter().map(|_| false)).collect();
        let assigned = self.assign(&posed, &found, &is_inside);
        let (assigned_on, others) = assigned.split_at(samples.on_points.len());
        let (assigned_off, assigned_free) = others.split_at(samples.off_points.len());
        *statistics = statistics.and(found.statistics);
        add_time(record, "search", begin);

        let mut batch = CanonicalBatch {
            condition,
            bones: frame.bones.clone(),
            implicit_gradient: true,
            ..CanonicalBatch::default()
        };
        for (winner, index) in self.in_spatial_order(assigned_on, &found) {
            batch.on_points.push(found.points[winner]);
            batch.on_normals.push(samples.on_normals[index]);
            batch.on_colours.push(samples.on_colours[index]);
        }
        for (winner, index) in self.in_spatial_order(assigned_off, &found) {
            batch.off_points.push(found.points[winner]);
            batch.off_targets.push(samples.off_targets[index]);
        }
        for (winner, index) in self.in_spatial_order(assigned_free, &found) {
            batch.free_points.push(found.points[winner]);
            batch.free_bounds.push(samples.free_bounds[index]);
        }
        let lost = assigned_off.iter().zip(&samples.off_targets).filter(|(winner, _)| winner.is_none());
        record.inside_without_root += lost.filter(|(_, target)| inside(**target)).count();
        // Skinning on a grid is held by its logits instead.
        let weight_points = if fields.skinning.voxels().is_some() { 0 } else { WEIGHT_POINTS };
        self.canonical.anchor(weight_points, &mut random, &mut batch);
        let count = self.config.sampling.far_points;
        self.canonical.far(count, fields.geometry.representation, &mut random, &mut batch);
        record.points += batch.far_points.len();
        if let Some(rgbd) = &self.config.rgbd {
            self.canonical.unseen(rgbd.unseen_points, self.config.sampling.deviation, &mut random, &mut batch);
        }
        if self.config.losses.eikonal > 0.0 {
            let count = self.config.losses.eikonal_points;
            batch.eikonal_points = self.canonical.around(count, EIKONAL_SPREAD, &mut random);
        }
        Ok(batch)
    }

    /// The candidates that points are trained through, with the points' places, neighbours in space near each other: a grid's
    /// entries are then still in the cache when the next point needs them.
    fn in_spatial_order(&self, assigned: &[Option<usize>], found: &Candidates<f32>) -> Vec<(usize, usize)> {
        let curve = Curve::over(self.subject.bounds);
        let key = |winner: usize| curve.place(Vec3::from_array(found.points[winner]));
        let places = assigned.iter().enumerate().filter_map(|(index, winner)| Some(((*winner)?, index)));
        let mut keyed: Vec<_> = places.map(|(winner, index)| (key(winner), winner, index)).collect();
        keyed.sort_unstable();
        keyed.into_iter().map(|(_, winner, index)| (winner, index)).collect()
    }

    /// The candidate that each point is trained through, given which points are inside.
    fn assign(&self, posed: &PosedField, candidates: &Candidates<f32>, is_inside: &[bool]) -> Vec<Option<usize>> {
        match self.config.assignment {
            Assignment::Field => {
                let values = posed.geometry(&candidates.points);
                let representation = posed.fields.geometry.representation;
                posed.winners(candidates, |index, best| representation.prefers(values[index], values[best]))
            }
            Assignment::Body => {
                let depths: Vec<f32> =
                    candidates.points.par_iter().map(|point| self.canonical.distance(*point)).collect();
                let possible = |point: usize, index: usize| may_train(depths[index], is_inside[point]);
                posed.winners_among(candidates, possible, |index, best| depths[index] < depths[best])
            }
        }
    }
}

/// Whether a point, inside the captured body or not, may be trained through a root this far from the unclothed one, metres.
fn may_train(distance: f32, is_inside: bool) -> bool {
    distance < CERTAINLY_OUTSIDE && (is_inside || distance > -DEEPEST_SURFACE)
}

pub(super) fn add_time(record: &mut StepRecord, phase: &'static str, begin: Instant) {
    *record.split.entry(phase).or_default() += begin.elapsed().as_secs_f64();
}

/// The generator of one purpose: a stream of the seed's own for each stage, step and slot.
fn generator(seed: u64, stage: Stage, step: u64, slot: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ (stage as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    random.set_stream(step << 16 | (slot & 0xffff));
    random
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_surface_is_trained_deep_in_the_body_and_nothing_far_from_it() {
        assert!(may_train(0.02, false) && may_train(-0.005, false) && !may_train(-0.03, false));
        assert!(may_train(0.02, true) && may_train(-0.03, true) && !may_train(0.2, true));
    }
}
