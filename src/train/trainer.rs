//! Which step comes next, on which draws, at which learning rates; what a step computes is the engine's.
//!
//! A training that was stopped and goes on from its state does what an uninterrupted one does, to the bit, with the same number of
//! threads.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use xavatar_network::{AdamSettings, ParameterGroup};

use super::clothing;
use super::drawn::generator;
use super::engine::{CpuEngine, Engine, EngineInput, Learned, Outcome};
use super::epochs::Epochs;
use super::frames::Frames;
use super::progress::{Pace, Progress};
use super::refinement::{PoseRefiner, Refined};
use super::supervision::CanonicalBody;
use super::{Stage, StepRecord, TrainingSpec};
use crate::config::LossSettings;
use crate::fields::{FieldRates, Fields, Poser};
use crate::{Error, Result};

/// Of hash grids, whose entries are updated only when a sample touches them.
const GRID_ADAM: AdamSettings = AdamSettings { first_decay: 0.9, second_decay: 0.99, epsilon: 1e-15 };

/// The first of the slots of the generators that draw for refinements of poses: no step has so many frames.
const REFINEMENT: u64 = 1 << 15;

/// All that a training has to remember between its steps.
#[derive(Clone, Debug)]
pub struct TrainingState {
    /// Fields and optimiser.
    pub learned: Learned,
    /// Where it stands.
    pub progress: Progress,
}

/// A training.
pub struct Trainer<'a> {
    spec: TrainingSpec<'a>,
    pace: Pace<'a>,
    epochs: Epochs<'a>,
    engine: Box<dyn Engine>,
    progress: Progress,
    /// None where the settings refine no pose.
    refiner: Option<PoseRefiner<'a>>,
    /// Steps whose outcome the engine has not told yet, the oldest first.
    pending: VecDeque<StepRecord>,
}

impl<'a> Trainer<'a> {
    /// A training on this machine's processors. `seen` says which of the body's vertices (V) some capture shows, `started` since when time
    /// counts; `restore` may replace the state that a new training begins with.
    ///
    /// # Errors
    /// If the configuration is refused or for captures of another kind; those of `restore`.
    pub fn new(
        spec: TrainingSpec<'a>,
        seen: &[bool],
        started: Instant,
        restore: impl FnOnce(&mut TrainingState) -> Result<()>,
    ) -> Result<Self> {
        Self::with_engine(spec, seen, started, restore, |input| Ok(Box::new(CpuEngine::new(input)?)))
    }

    /// As [`Trainer::new`], with the engine that `make` makes.
    ///
    /// # Errors
    /// As [`Trainer::new`]; those of `make`.
    pub fn with_engine(
        spec: TrainingSpec<'a>,
        seen: &[bool],
        started: Instant,
        restore: impl FnOnce(&mut TrainingState) -> Result<()>,
        make: impl FnOnce(EngineInput) -> Result<Box<dyn Engine>>,
    ) -> Result<Self> {
        spec.check()?;
        let TrainingSpec { config, source, body, labels } = spec;
        let betas = source.betas();
        let mut canonical = CanonicalBody::new(body, labels, betas, config)?;
        canonical.stand_in(seen);
        let bounds = canonical.bounds();
        let poser = Poser::for_training(config, body, labels, betas, bounds)?;
        let mut frames = Frames::new(spec);
        // A training that goes on begins here too: which starts are pruned, and what weights are pulled to, is what they began as.
        let mut worn = None;
        let skinning = poser.initial_skinning(body, |grid| {
            let (rows, found) = clothing::fitted_rows(&mut frames, grid, body, labels, betas)?;
            worn = found;
            Ok(rows)
        })?;
        if let Some(worn) = worn {
            canonical.wear(|point| worn.at(point));
        }
        let mut fields = Fields::new(&config.fields, canonical.condition(), skinning, bounds)?;
        fields.initialise(config.seed);
        let mut state = TrainingState { learned: Learned::new(fields), progress: Progress::default() };
        restore(&mut state)?;
        let TrainingState { learned, progress } = state;
        frames.take_poses(progress.poses.clone());
        let follows_weights = learned.fields.skinning.follows_weights();
        let distances = canonical.distances().clone();
        let refiner = if config.schedule.pose_refinements > 0 {
            Some(PoseRefiner::new(spec, Poser::for_surfaces(config, body, labels, betas, bounds)?))
        } else {
            None
        };
        let engine = make(EngineInput { config: config.clone(), poser, distances, learned })?;
        let (count, earlier_seconds) = (frames.len(), progress.seconds);
        Ok(Self {
            pace: Pace { config, frames: count, started, earlier_seconds, prepared: Instant::now() },
            epochs: Epochs { config, frames, canonical: Arc::new(canonical), follows_weights, ahead: None },
            engine,
            pending: VecDeque::new(),
            progress,
            refiner,
            spec,
        })
    }

    /// Where the training stands.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The stage of the next step.
    pub fn stage(&self) -> Stage {
        self.pace.stage(&self.progress)
    }

    /// Share of the training that is done, 0 to 1: of its time if that is limited, else of its steps.
    pub fn share_done(&self) -> f64 {
        self.pace.share_done(&self.progress)
    }

    /// Whether all steps are done, or the time is up.
    pub fn is_done(&self) -> bool {
        self.stage() == Stage::Frames && self.share_done() >= 1.0
    }

    /// The canonical box: its lowest and highest corner, metres.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.epochs.canonical.bounds()
    }

    /// Makes one step. What was measured in it, or in the one before; none if the engine has not told it yet.
    ///
    /// # Errors
    /// [`Error::NonFinite`] if a loss or gradient is not finite; a frame that cannot be read or searched.
    pub fn step(&mut self) -> Result<Option<StepRecord>> {
        let begin = Instant::now();
        let stage = self.stage();
        let optimiser = &self.spec.config.optimiser;
        let (step, decay) = match stage {
            Stage::Pretraining => (self.progress.pretraining_steps, 1.0),
            Stage::Frames => (self.progress.steps, optimiser.final_share.powf(self.share_done().min(1.0))),
        };
        let mut record = StepRecord::of(stage, step + 1, self.pace.steps(stage), decay * optimiser.learning_rate);
        match stage {
            Stage::Pretraining => self.pretraining_step(step, &mut record)?,
            Stage::Frames => self.frames_step(step, &mut record)?,
        }
        let outcome = self.engine.update(&self.rates(decay))?;
        match stage {
            Stage::Pretraining => self.progress.pretraining_steps += 1,
            Stage::Frames => self.progress.steps += 1,
        }
        record.seconds = begin.elapsed().as_secs_f64();
        self.pending.push_back(record);
        outcome.map(|outcome| self.completed(outcome)).transpose().map(Option::flatten)
    }

    /// Whether the frames' poses are to be refined before the next step.
    pub fn is_refinement_due(&self) -> bool {
        self.pace.is_refinement_due(&self.progress)
    }

    /// Refines the frames' poses, after [`Trainer::settle`]; what it did. `goes_on` is told how many of how many frames are done, and says whether
    /// to go on: if not, all poses stay as they are. None then, and if the settings refine no pose.
    ///
    /// # Errors
    /// A frame that cannot be read or searched.
    pub fn refine_poses(&mut self, mut goes_on: impl FnMut(usize, usize) -> bool) -> Result<Option<Refined>> {
        let Self { epochs, engine, progress, refiner: Some(refiner), spec, .. } = self else { return Ok(None) };
        let fields = &engine.learned()?.fields;
        let total = epochs.frames.len();
        for index in 0..total {
            if !goes_on(index, total) {
                refiner.finish();
                return Ok(None);
            }
            let (capture, registered) = epochs.frames.registered(index)?;
            let now = progress.poses.get(index).map_or_else(|| registered.clone(), |refined| refined.of(&registered));
            let random = generator(spec.config.seed, Stage::Frames, index as u64, REFINEMENT + progress.refinements);
            refiner.add(fields, (capture, &registered), &now, random)?;
        }
        let (poses, refined) = refiner.finish();
        epochs.take_poses(poses.clone());
        progress.poses = poses;
        progress.refinements += 1;
        Ok(Some(refined))
    }

    /// Waits for the last step; what was measured in it, if [`Trainer::step`] has not told it.
    ///
    /// # Errors
    /// As [`Trainer::step`].
    pub fn settle(&mut self) -> Result<Option<StepRecord>> {
        let outcome = self.engine.settle()?;
        outcome.map(|outcome| self.completed(outcome)).transpose().map(Option::flatten)
    }

    /// What is learned and where the training stands, after [`Trainer::settle`].
    ///
    /// # Errors
    /// If the engine cannot give the fields back.
    pub fn state(&mut self) -> Result<(&Learned, &mut Progress)> {
        self.progress.seconds = self.pace.seconds();
        Ok((self.engine.learned()?, &mut self.progress))
    }

    fn pretraining_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let config = self.spec.config;
        let mut random = generator(config.seed, Stage::Pretraining, step, 0);
        let batch = self.epochs.canonical.batch(config, &mut random);
        record.points = batch.on_points.len() + batch.off_points.len();
        let losses = LossSettings { colour: 0.0, ..config.losses.clone() };
        self.engine.pretrain(batch, &losses)
    }

    fn frames_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let Self { engine, epochs, spec: TrainingSpec { config, .. }, .. } = self;
        let count = config.optimiser.batch_frames as u64;
        engine.begin(step)?;
        for slot in 0..count {
            let (drawn, next) = epochs.take(step * count + slot)?;
            record.add_frame(&drawn);
            let mut losses = config.losses.clone();
            if drawn.epoch < losses.colour_from_epoch {
                losses.colour = 0.0;
            }
            // While this frame is trained on, the next is drawn.
            let (trained, ahead) = rayon::join(|| engine.frame(drawn, &losses, 1.0 / count as f64), || next.draw());
            trained?;
            epochs.ahead = Some(ahead);
        }
        Ok(())
    }

    /// The learning rates at `decay` times the first step's.
    fn rates(&self, decay: f64) -> FieldRates {
        let settings = &self.spec.config.optimiser;
        let group = |settings: AdamSettings, rate: f64| ParameterGroup { settings, rate: decay * rate };
        FieldRates {
            networks: group(AdamSettings::default(), settings.learning_rate),
            geometry_grid: group(GRID_ADAM, settings.grid_learning_rate),
            texture_grid: group(GRID_ADAM, settings.colour_grid_learning_rate),
            logits: group(AdamSettings::default(), settings.voxel_learning_rate),
        }
    }

    /// The record of the oldest step that has no outcome yet, with this one.
    fn completed(&mut self, outcome: Outcome) -> Result<Option<StepRecord>> {
        let Some(mut record) = self.pending.pop_front() else { return Ok(None) };
        if let Some(what) = outcome.not_finite() {
            let frame = if record.frames.is_empty() { "stage 0".into() } else { record.frames.join(", ") };
            return Err(Error::NonFinite { what, step: record.step, frame });
        }
        record.take(outcome);
        if record.stage == Stage::Frames {
            self.progress.add_loss(record.losses.get("total").copied().unwrap_or_default());
        }
        Ok(Some(record))
    }
}
