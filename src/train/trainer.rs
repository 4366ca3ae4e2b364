//! The run itself: which step comes next, when to save, when to stop.
//!
//! Every random draw comes from a generator of its own, derived from (seed, stage, step, frame): a run that was stopped and
//! resumed at a step does what an uninterrupted one does, to the bit, with the same number of threads.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use glam::Vec3;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar_deformer::{BakedWeights, Candidates, SearchStatistics, StartGroups};
use xavatar_network::{Adam, Representation, clipping_factor};

use super::checkpoint::{Progress, State, checkpoints};
use super::frame_store::FrameStore;
use super::losses::{CanonicalBatch, LossEvaluator, LossTerms};
use super::pretraining::{CERTAINLY_OUTSIDE, CanonicalBody};
use super::{Event, Observer, Stage, StepRecord, sampling};
use crate::atomic_file::write_atomically;
use crate::avatar::{Avatar, Subject};
use crate::body::{BodyModel, PartLabels};
use crate::config::{Assignment, Config, SearchedField};
use crate::correspondence::{PosedField, bake, start_groups};
use crate::data::FrameSource;
use crate::fields::{CONDITION, Fields, skeleton_parents};
use crate::render::{Camera, FRONT, Tile, View, contact_sheet, render_mesh, write_png};
use crate::{Error, Result};

const CONFIG: &str = "config.toml";
const METRICS: &str = "metrics.jsonl";
const PREVIEWS: &str = "previews";
/// Weight of the past in the running mean of the loss.
const LOSS_MEMORY: f64 = 0.98;
/// Largest share of a time limit that stage 0 may take.
const PRETRAINING_SHARE: f64 = 0.15;
/// Vertices of hands and face whose weights are supervised at each step.
const WEIGHT_POINTS: usize = 1024;
/// Spread of the Eikonal points around canonical vertices, metres (METHOD section 5).
const EIKONAL_SPREAD: f32 = 0.05;
const PREVIEW_RESOLUTION: usize = 128;
const PREVIEW_WIDTH: u32 = 480;
const PREVIEW_HEIGHT: u32 = 640;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All steps are done, or the time is up; `avatar.safetensors` is written.
    Finished,
    /// It was asked to stop; a checkpoint is written.
    Stopped,
}

/// A training run.
pub struct Trainer<'a> {
    config: &'a Config,
    body: &'a BodyModel,
    labels: &'a PartLabels,
    run: PathBuf,
    subject: Subject,
    canonical: CanonicalBody<'a>,
    frames: FrameStore<'a>,
    groups: StartGroups,
    /// The grid that the search runs on; sampled every few steps.
    baked: Option<BakedWeights<f32>>,
    state: State,
    losses: LossEvaluator<f32>,
    metrics: fs::File,
    started: Instant,
    /// Seconds that earlier commands spent on this run.
    earlier_seconds: f64,
}

impl<'a> Trainer<'a> {
    /// Starts a run in a new or empty folder.
    ///
    /// # Errors
    /// If the folder holds anything, a frame is bad (unless the configuration skips those), or the configuration is refused.
    pub fn start(
        config: &'a Config,
        frames: &dyn FrameSource,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        fs::create_dir_all(run).map_err(Error::io(run))?;
        if fs::read_dir(run).map_err(Error::io(run))?.next().is_some() {
            return Err(Error::Value {
                name: format!("the run folder {}", run.display()),
                found: "not empty".into(),
                expected: "a new or empty folder; continue a run with --resume".into(),
            });
        }
        write_atomically(&run.join(CONFIG), |file| file.write_all(config.to_toml().as_bytes()))?;
        Self::open(config, frames, body, labels, run, observer)
    }

    /// The configuration of the run in a folder, for [`Trainer::resume`].
    ///
    /// # Errors
    /// If the folder holds no run.
    pub fn configuration(run: &Path) -> Result<Config> {
        if !run.join(CONFIG).is_file() {
            return Err(Error::Missing {
                path: run.into(),
                what: format!("a run to resume ({CONFIG})"),
                remedy: "start one without --resume".into(),
            });
        }
        Config::read(&run.join(CONFIG))
    }

    /// Continues a run from its newest checkpoint; from the start if it had none yet.
    ///
    /// # Errors
    /// If a checkpoint cannot be read; delete it to continue from the one before.
    pub fn resume(
        config: &'a Config,
        frames: &dyn FrameSource,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        Self::open(config, frames, body, labels, run, observer)
    }

    fn open(
        config: &'a Config,
        frames: &dyn FrameSource,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let started = Instant::now();
        let canonical = CanonicalBody::new(body, labels, &frames.betas(), config)?;
        let mut fields = Fields::new(&config.fields, &skeleton_parents())?;
        fields.initialise(config.seed);
        let adam = fields.networks().map(|network| Adam::new(network.parameters().len()));
        let progress = Progress { running_loss: f64::INFINITY, best_loss: f64::INFINITY, ..Progress::default() };
        let mut state = State { fields, adam, progress, baked_skinning: None };
        if let Some(newest) = checkpoints(run)?.first() {
            state.load(newest)?;
        }
        // The grid that an uninterrupted run would be searching on.
        let bounds = canonical.bounds();
        let mut baked = None;
        if let Some(parameters) = &state.baked_skinning {
            let mut field = state.fields.skinning.clone();
            field.mlp_mut().update(|target| target.copy_from_slice(parameters));
            baked = bake(&field, config.searched_field, bounds)?;
        }
        let store = FrameStore::open(config, frames, body, labels, run, observer)?;
        let subject = Subject {
            gender: frames.gender(),
            betas: frames.betas(),
            joints: canonical.joints().to_vec(),
            bounds,
            frames: store.len(),
        };
        Ok(Self {
            losses: LossEvaluator::new(&state.fields, rayon::current_num_threads()),
            metrics: continue_metrics(&run.join(METRICS), &state.progress)?,
            earlier_seconds: state.progress.seconds,
            groups: start_groups(config.starts)?,
            baked,
            frames: store,
            run: run.into(),
            config,
            body,
            labels,
            subject,
            canonical,
            state,
            started,
        })
    }

    /// Trains until all steps are done, the time is up, or `stop` is set.
    ///
    /// # Errors
    /// If a loss or gradient is not finite (the last checkpoint is kept), or a file cannot be written.
    pub fn run(&mut self, stop: &AtomicBool, observer: &mut dyn Observer) -> Result<Ending> {
        loop {
            if stop.load(Ordering::Relaxed) {
                self.checkpoint(observer)?;
                return Ok(Ending::Stopped);
            }
            let stage = self.stage();
            if stage == Stage::Frames && self.share_done() >= 1.0 {
                break;
            }
            let record = self.step(stage)?;
            let line = serde_json::to_string(&record).unwrap_or_default();
            writeln!(self.metrics, "{line}").map_err(Error::io(self.run.join(METRICS)))?;
            observer.event(Event::Step { progress: self.share_done(), record: &record });
            let Progress { pretraining_steps, steps, .. } = self.state.progress;
            if (pretraining_steps + steps).is_multiple_of(self.config.schedule.checkpoint_steps) {
                self.checkpoint(observer)?;
            }
            let every = self.config.schedule.preview_steps;
            if stage == Stage::Frames && every > 0 && steps.is_multiple_of(every) {
                self.preview(observer)?;
            }
        }
        self.checkpoint(observer)?;
        self.avatar().save(&self.run.join(Avatar::FILE))?;
        Ok(Ending::Finished)
    }

    /// The avatar as it is now.
    pub fn avatar(&self) -> Avatar {
        Avatar {
            fields: self.state.fields.clone(),
            config: self.config.clone(),
            subject: self.subject.clone(),
            steps: self.state.progress.steps,
        }
    }

    fn seconds(&self) -> f64 {
        self.earlier_seconds + self.started.elapsed().as_secs_f64()
    }

    /// The time limit of the run; none if steps end it.
    fn limit(&self) -> Option<f64> {
        (self.config.schedule.minutes > 0.0).then_some(60.0 * self.config.schedule.minutes)
    }

    fn stage(&mut self) -> Stage {
        let Progress { pretraining_steps, steps, .. } = self.state.progress;
        let late = self.limit().is_some_and(|limit| self.seconds() > PRETRAINING_SHARE * limit);
        // Once on the frames, a resumed run does not go back.
        if steps > 0 || late || pretraining_steps >= self.config.schedule.pretraining_steps {
            Stage::Frames
        } else {
            Stage::Pretraining
        }
    }

    /// Share of the run that is done; of its time if that is limited, else of its steps on frames.
    fn share_done(&self) -> f64 {
        match self.limit() {
            Some(limit) => self.seconds() / limit,
            None => self.state.progress.steps as f64 / self.config.schedule.steps.max(1) as f64,
        }
    }

    fn step(&mut self, stage: Stage) -> Result<StepRecord> {
        let begin = Instant::now();
        let settings = &self.config.optimiser;
        let step = match stage {
            Stage::Pretraining => self.state.progress.pretraining_steps,
            Stage::Frames => self.state.progress.steps,
        };
        let learning_rate = match stage {
            Stage::Pretraining => settings.learning_rate,
            Stage::Frames => settings.learning_rate * settings.final_share.powf(self.share_done().min(1.0)),
        };
        let mut record = StepRecord {
            stage,
            step: step + 1,
            steps: match (stage, self.limit()) {
                (Stage::Pretraining, _) => Some(self.config.schedule.pretraining_steps),
                (Stage::Frames, None) => Some(self.config.schedule.steps),
                (Stage::Frames, Some(_)) => None,
            },
            frames: Vec::new(),
            seconds: 0.0,
            split: BTreeMap::new(),
            points: 0,
            learning_rate,
            gradient_norm: 0.0,
            losses: LossTerms::new(),
            converged: 0.0,
            points_without_root: 0,
            inside_without_root: 0,
        };
        match stage {
            Stage::Pretraining => self.pretraining_step(step, &mut record)?,
            Stage::Frames => self.frames_step(step, &mut record)?,
        }
        let updating = Instant::now();
        self.update(learning_rate, &mut record)?;
        add_time(&mut record, "optimiser", updating);
        let progress = &mut self.state.progress;
        match stage {
            Stage::Pretraining => progress.pretraining_steps += 1,
            Stage::Frames => {
                progress.steps += 1;
                let total = record.losses["total"];
                progress.running_loss = match progress.running_loss {
                    mean if mean.is_finite() => LOSS_MEMORY * mean + (1.0 - LOSS_MEMORY) * total,
                    _ => total,
                };
            }
        }
        record.seconds = begin.elapsed().as_secs_f64();
        Ok(record)
    }

    fn pretraining_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let mut random = generator(self.config.seed, Stage::Pretraining, step, 0);
        let batch = self.canonical.batch(self.config, &mut random);
        let losses = CanonicalBody::losses(&self.config.losses);
        record.points = batch.on_points.len() + batch.off_points.len();
        record.losses = self.losses.accumulate(&self.state.fields, &batch, &losses, 1.0)?;
        record.converged = 1.0;
        Ok(())
    }

    fn frames_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let count = self.config.optimiser.batch_frames;
        let share = 1.0 / count as f64;
        if let SearchedField::Baked { refresh_steps, .. } = self.config.searched_field
            && (self.baked.is_none() || step.is_multiple_of(refresh_steps))
        {
            let field = &self.state.fields.skinning;
            self.baked = bake(field, self.config.searched_field, self.subject.bounds)?;
            self.state.baked_skinning = Some(field.mlp().parameters().to_vec());
        }
        let mut statistics = SearchStatistics::default();
        for slot in 0..count {
            let place = step * count as u64 + slot as u64;
            let (epoch, index) = self.shuffled(place);
            let batch = self.canonical_batch(index, step, slot as u64, record, &mut statistics)?;
            let mut losses = self.config.losses.clone();
            if epoch < losses.colour_from_epoch {
                losses.colour = 0.0;
            }
            let begin = Instant::now();
            let terms = self.losses.accumulate(&self.state.fields, &batch, &losses, share)?;
            add_time(record, "losses", begin);
            for (name, value) in terms {
                *record.losses.entry(name).or_default() += share * value;
            }
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

    /// Draws a frame's points and finds their canonical correspondences.
    fn canonical_batch(
        &mut self,
        index: usize,
        step: u64,
        slot: u64,
        record: &mut StepRecord,
        statistics: &mut SearchStatistics,
    ) -> Result<CanonicalBatch<f32>> {
        let frame = self.frames.prepared(index)?;
        let fields = &self.state.fields;
        let mut random = generator(self.config.seed, Stage::Frames, step, slot);
        let dropped = random.random::<f64>() < self.config.fields.condition_dropout;
        let condition = if dropped { vec![0.0; CONDITION] } else { frame.condition.clone() };
        let begin = Instant::now();
        let samples = sampling::draw(&frame, &self.config.sampling, fields.geometry.representation, &mut random);
        record.points += samples.on_points.len() + samples.off_points.len();
        record.frames.push(frame.id.to_string());

        add_time(record, "sampling", begin);
        let begin = Instant::now();
        let embedded = fields.geometry.mlp.embed(&condition);
        let posed = PosedField {
            fields,
            bones: &frame.bones,
            embedded: &embedded,
            groups: &self.groups,
            settings: &self.config.search,
            baked: self.baked.as_ref(),
            bounds: self.subject.bounds,
        };
        let in_frame = |error: Error| error.in_frame(frame.id.to_string());
        let on = posed.candidates(&samples.on_points, &samples.on_labels).map_err(in_frame)?;
        let off = posed.candidates(&samples.off_points, &samples.off_labels).map_err(in_frame)?;
        let assigned_on = self.assign(&posed, &on);
        let assigned_off = self.assign(&posed, &off);
        *statistics = statistics.and(on.statistics).and(off.statistics);
        add_time(record, "search", begin);

        let mut batch = CanonicalBatch {
            condition,
            bones: frame.bones.clone(),
            implicit_gradient: true,
            ..CanonicalBatch::default()
        };
        for (index, winner) in assigned_on.into_iter().enumerate() {
            let Some(winner) = winner else { continue };
            batch.on_points.push(on.points[winner]);
            batch.on_normals.push(samples.on_normals[index]);
            batch.on_colours.push(samples.on_colours[index]);
        }
        let inside = |target: f32| match fields.geometry.representation {
            Representation::Occupancy => target > 0.5,
            Representation::SignedDistance => target < 0.0,
        };
        for (winner, target) in assigned_off.into_iter().zip(samples.off_targets) {
            match winner {
                Some(winner) => {
                    batch.off_points.push(off.points[winner]);
                    batch.off_targets.push(target);
                }
                None => record.inside_without_root += usize::from(inside(target)),
            }
        }
        self.canonical.anchor(WEIGHT_POINTS, &mut random, &mut batch);
        let count = self.config.sampling.far_points;
        self.canonical.far(count, fields.geometry.representation, &mut random, &mut batch);
        if self.config.losses.eikonal > 0.0 {
            let count = self.config.losses.eikonal_points;
            batch.eikonal_points = self.canonical.around(count, EIKONAL_SPREAD, &mut random);
        }
        Ok(batch)
    }

    /// The candidate that each point is trained through.
    fn assign(&self, posed: &PosedField, candidates: &Candidates<f32>) -> Vec<Option<usize>> {
        match self.config.assignment {
            Assignment::Field => {
                let values = posed.geometry(&candidates.points);
                let representation = posed.fields.geometry.representation;
                posed.winners(candidates, |index, best| representation.prefers(values[index], values[best]))
            }
            Assignment::Body => {
                let depths: Vec<f32> = candidates.points.iter().map(|point| self.canonical.distance(*point)).collect();
                let winners = posed.winners(candidates, |index, best| depths[index] < depths[best]);
                let is_possible = |winner: &usize| depths[*winner] < CERTAINLY_OUTSIDE;
                winners.into_iter().map(|winner| winner.filter(is_possible)).collect()
            }
        }
    }

    /// Clips the gradients and moves the parameters.
    fn update(&mut self, learning_rate: f64, record: &mut StepRecord) -> Result<()> {
        let settings = &self.config.optimiser;
        let gradients = self.losses.take_gradients(&self.state.fields);
        let all = [gradients[0].as_slice(), &gradients[1], &gradients[2]];
        let squares = all.iter().flat_map(|gradient| gradient.iter()).map(|g| f64::from(*g) * f64::from(*g));
        record.gradient_norm = squares.sum::<f64>().sqrt();
        let not_finite = |what: &str| Error::NonFinite {
            what: what.into(),
            step: record.step,
            frame: if record.frames.is_empty() { "stage 0".into() } else { record.frames.join(", ") },
        };
        if let Some((name, _)) = record.losses.iter().find(|(_, value)| !value.is_finite()) {
            return Err(not_finite(&format!("the loss `{name}`")));
        }
        if !record.gradient_norm.is_finite() {
            return Err(not_finite("the gradient"));
        }
        let factor = clipping_factor(&all, settings.clip);
        let State { fields, adam, .. } = &mut self.state;
        for ((network, adam), gradient) in fields.networks_mut().into_iter().zip(adam).zip(&gradients) {
            network.update(|parameters| adam.step(settings.adam, learning_rate, factor, gradient, parameters));
        }
        Ok(())
    }

    fn checkpoint(&mut self, observer: &mut dyn Observer) -> Result<()> {
        self.state.progress.seconds = self.seconds();
        let path = self.state.save(&self.run, self.config.schedule.checkpoints_kept)?;
        self.metrics.sync_data().map_err(Error::io(self.run.join(METRICS)))?;
        observer.event(Event::Checkpoint { path: &path });
        Ok(())
    }

    /// The first frame's scan beside the avatar in the same pose.
    fn preview(&self, observer: &mut dyn Observer) -> Result<()> {
        let frame = self.frames.read(0)?;
        let extracted = match self.avatar().extract_posed(self.body, self.labels, &frame.parameters, PREVIEW_RESOLUTION)
        {
            Err(Error::NoSurface { .. }) => return Ok(()),
            extracted => extracted?,
        };
        let folder = self.run.join(PREVIEWS);
        fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
        let corner =
            |fold: fn(Vec3, Vec3) -> Vec3| frame.scan.vertices.iter().copied().reduce(fold).unwrap_or_default();
        let (low, high) = (corner(Vec3::min), corner(Vec3::max));
        let camera = Camera::framing(low, high, FRONT, PREVIEW_WIDTH, PREVIEW_HEIGHT)?;
        let tiles = |view: View| -> Result<Vec<Tile>> {
            Ok(vec![
                Tile::new(render_mesh(&frame.scan, &camera, view)?, "scan"),
                Tile::new(render_mesh(&extracted.mesh, &camera, view)?, "avatar"),
            ])
        };
        let row = [tiles(View::Colour)?, tiles(View::Normals)?].concat();
        let path = folder.join(format!("step-{:08}.png", self.state.progress.steps));
        write_png(&path, &contact_sheet(&[row])?)?;
        observer.event(Event::Preview { path: &path });
        Ok(())
    }
}

fn add_time(record: &mut StepRecord, phase: &'static str, begin: Instant) {
    *record.split.entry(phase).or_default() += begin.elapsed().as_secs_f64();
}

/// The generator of one purpose: a stream of the seed's own for each stage, step and slot.
fn generator(seed: u64, stage: Stage, step: u64, slot: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ (stage as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    random.set_stream(step << 16 | (slot & 0xffff));
    random
}

/// Opens the metrics for appending, without the lines of steps after the checkpoint that the run continues from.
fn continue_metrics(path: &Path, progress: &Progress) -> Result<fs::File> {
    if path.is_file() {
        let text = fs::read_to_string(path).map_err(Error::io(path))?;
        let done = (progress.pretraining_steps + progress.steps) as usize;
        let kept: String = text.split_inclusive('\n').filter(|line| line.ends_with('\n')).take(done).collect();
        write_atomically(path, |file| file.write_all(kept.as_bytes()))?;
    }
    fs::OpenOptions::new().create(true).append(true).open(path).map_err(Error::io(path))
}
