//! The run itself: which step comes next, when to save, when to stop.
//!
//! A run that was stopped and resumed at a step does what an uninterrupted one does, to the bit, with the same number of threads.

use std::collections::VecDeque;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use xavatar_network::{AdamSettings, ParameterGroup};

use super::canonical_body::CanonicalBody;
use super::captured::TrainingFrames;
use super::checkpoint::{self, Progress, State};
use super::drawn::generator;
use super::engine::{CpuEngine, Engine, EngineInput, Learned, Outcome};
use super::epochs::Epochs;
use super::frame_store::{self, FrameStore};
use super::metrics_log::MetricsLog;
use super::{Event, Observer, Stage, StepRecord, preview};
use crate::avatar::{Avatar, Subject};
use crate::body::{BodyModel, PartLabels};
use crate::config::{Config, LossSettings};
use crate::fields::{FieldRates, Fields, Poser};
use crate::formats::{Choice, Remedy};
use crate::render::write_png;
use crate::{Error, InputError, Result};
use xavatar_formats::{FolderLock, is_vacant, remove_partial, write_atomically};

const CONFIG: &str = "config.toml";
pub(super) const PREVIEWS: &str = "previews";
/// Weight of the past in the running mean of the loss.
const LOSS_MEMORY: f64 = 0.98;
/// Largest share of a time limit that stage 0 may take.
const PRETRAINING_SHARE: f64 = 0.15;
const PREVIEW_RESOLUTION: usize = 128;

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
    /// The run's folder is this process's.
    _lock: FolderLock,
    subject: Subject,
    epochs: Epochs<'a>,
    engine: Box<dyn Engine>,
    progress: Progress,
    /// Steps whose outcome the engine has not told yet, the oldest first.
    pending: VecDeque<StepRecord>,
    metrics: MetricsLog,
    started: Instant,
    /// Seconds that earlier commands spent on this run.
    earlier_seconds: f64,
}

impl<'a> Trainer<'a> {
    /// Starts a run in a new or empty folder.
    ///
    /// # Errors
    /// If the folder holds anything or another process works in it, a frame is bad (unless the configuration skips those), or the configuration is refused or for
    /// frames of another kind.
    pub fn start(
        config: &'a Config,
        frames: TrainingFrames,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        frames.check(config)?;
        let lock = FolderLock::take(run)?;
        if !is_vacant(run)? {
            return Err(Error::from(InputError::Mismatch {
                path: run.into(),
                found: "a folder that is not empty".into(),
                expected: "a new or empty one".into(),
                remedy: Remedy::choosing(Choice::ContinueRun, "name a new folder, or continue the run that is there"),
            }));
        }
        let text = config.to_toml()?;
        write_atomically(&run.join(CONFIG), |file| file.write_all(text.as_bytes()))?;
        Self::open(lock, config, frames, body, labels, run, observer)
    }

    /// The configuration of the run in a folder, for [`Trainer::resume`].
    ///
    /// # Errors
    /// If the folder holds no run.
    pub fn configuration(run: &Path) -> Result<Config> {
        if !run.join(CONFIG).is_file() {
            return Err(Error::from(InputError::Missing {
                path: run.into(),
                what: format!("a run to resume ({CONFIG})"),
                remedy: Remedy::choosing(Choice::StartRun, "start one"),
            }));
        }
        Config::read(&run.join(CONFIG))
    }

    /// Continues a run from its newest checkpoint that is not damaged; from the start if it had none yet.
    ///
    /// # Errors
    /// If a checkpoint cannot be read or is of another configuration, or another process works in the folder.
    pub fn resume(
        config: &'a Config,
        frames: TrainingFrames,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        frames.check(config)?;
        let lock = FolderLock::take(run)?;
        for folder in [checkpoint::FOLDER, frame_store::FOLDER, PREVIEWS] {
            remove_partial(&run.join(folder))?;
        }
        Self::open(lock, config, frames, body, labels, run, observer)
    }

    fn open(
        lock: FolderLock,
        config: &'a Config,
        frames: TrainingFrames,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let started = Instant::now();
        let mut canonical = CanonicalBody::new(body, labels, frames.betas(), config)?;
        let bounds = canonical.bounds();
        let poser = Poser::for_training(config, body, labels, frames.betas(), bounds)?;
        let mut fields = Fields::new(&config.fields, canonical.condition(), poser.initial_skinning(body)?, bounds)?;
        fields.initialise(config.seed);
        let progress = Progress { running_loss: f64::INFINITY, best_loss: f64::INFINITY, ..Progress::default() };
        let mut state = State { learned: Learned::new(fields), progress };
        state.load_newest(run)?;
        let State { learned, progress } = state;
        let follows_weights = learned.fields.skinning.follows_weights();
        let distances = canonical.distances().clone();
        let engine = CpuEngine::new(EngineInput { config: config.clone(), poser, distances, learned })?;
        let store = FrameStore::open(config, frames, body, labels, run, observer)?;
        canonical.stand_in(store.seen_vertices());
        let subject = Subject::of(body, frames.gender(), frames.betas(), bounds, store.len())?;
        let epochs = Epochs { config, frames: store, canonical: Arc::new(canonical), follows_weights, ahead: None };
        Ok(Self {
            _lock: lock,
            metrics: MetricsLog::open(run, (progress.pretraining_steps + progress.steps) as usize)?,
            earlier_seconds: progress.seconds,
            engine: Box::new(engine),
            epochs,
            progress,
            pending: VecDeque::new(),
            run: run.into(),
            config,
            body,
            labels,
            subject,
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
            if let Some(outcome) = self.step(stage)? {
                self.complete(outcome, observer)?;
            }
            let Progress { pretraining_steps, steps, .. } = self.progress;
            if (pretraining_steps + steps).is_multiple_of(self.config.schedule.checkpoint_steps) {
                self.checkpoint(observer)?;
            }
            let every = self.config.schedule.preview_steps;
            if stage == Stage::Frames && every > 0 && steps.is_multiple_of(every) {
                self.preview(observer)?;
            }
        }
        self.checkpoint(observer)?;
        self.avatar()?.save(&self.run.join(Avatar::FILE))?;
        Ok(Ending::Finished)
    }

    /// The avatar as it is now.
    ///
    /// # Errors
    /// If the engine cannot give the fields back.
    pub fn avatar(&mut self) -> Result<Avatar> {
        Ok(Avatar {
            fields: self.engine.learned()?.fields.clone(),
            config: self.config.clone(),
            subject: self.subject.clone(),
            steps: self.progress.steps,
        })
    }

    fn seconds(&self) -> f64 {
        self.earlier_seconds + self.started.elapsed().as_secs_f64()
    }

    /// The time limit of the run; none if steps end it.
    fn limit(&self) -> Option<f64> {
        (self.config.schedule.minutes > 0.0).then_some(60.0 * self.config.schedule.minutes)
    }

    fn stage(&mut self) -> Stage {
        let Progress { pretraining_steps, steps, .. } = self.progress;
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
            Some(limit) => (self.seconds() / limit).max(self.share_of_epochs()),
            None => self.progress.steps as f64 / self.config.schedule.steps.max(1) as f64,
        }
    }

    /// Share that is done of the passes over the frames that end a run early; 0 where there is no such bound.
    fn share_of_epochs(&self) -> f64 {
        let most_frames = self.config.schedule.most_epochs * self.epochs.frames.len() as u64;
        let done = self.progress.steps * self.config.optimiser.batch_frames as u64;
        if most_frames > 0 { done as f64 / most_frames as f64 } else { 0.0 }
    }

    /// Makes one step; its outcome, or that of the one before.
    fn step(&mut self, stage: Stage) -> Result<Option<Outcome>> {
        let begin = Instant::now();
        let step = match stage {
            Stage::Pretraining => self.progress.pretraining_steps,
            Stage::Frames => self.progress.steps,
        };
        let decay = match stage {
            Stage::Pretraining => 1.0,
            Stage::Frames => self.config.optimiser.final_share.powf(self.share_done().min(1.0)),
        };
        let steps = match (stage, self.limit()) {
            (Stage::Pretraining, _) => Some(self.config.schedule.pretraining_steps),
            (Stage::Frames, None) => Some(self.config.schedule.steps),
            (Stage::Frames, Some(_)) => None,
        };
        let mut record = StepRecord::of(stage, step + 1, steps, decay * self.config.optimiser.learning_rate);
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
        Ok(outcome)
    }

    fn pretraining_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let mut random = generator(self.config.seed, Stage::Pretraining, step, 0);
        let batch = self.epochs.canonical.batch(self.config, &mut random);
        record.points = batch.on_points.len() + batch.off_points.len();
        let losses = LossSettings { colour: 0.0, ..self.config.losses.clone() };
        self.engine.pretrain(batch, &losses)
    }

    fn frames_step(&mut self, step: u64, record: &mut StepRecord) -> Result<()> {
        let count = self.config.optimiser.batch_frames as u64;
        let Self { engine, epochs, config, .. } = self;
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
        let settings = &self.config.optimiser;
        let group = |settings: AdamSettings, rate: f64| ParameterGroup { settings, rate: decay * rate };
        FieldRates {
            networks: group(settings.adam, settings.learning_rate),
            geometry_grid: group(settings.grid_adam, settings.grid_learning_rate),
            texture_grid: group(settings.grid_adam, settings.colour_grid_learning_rate),
            logits: group(settings.adam, settings.voxel_learning_rate),
        }
    }

    /// Notes the outcome of the oldest step that has none.
    fn complete(&mut self, outcome: Outcome, observer: &mut dyn Observer) -> Result<()> {
        let Some(mut record) = self.pending.pop_front() else { return Ok(()) };
        if let Some(what) = outcome.not_finite() {
            let frame = if record.frames.is_empty() { "stage 0".into() } else { record.frames.join(", ") };
            return Err(Error::NonFinite { what, step: record.step, frame });
        }
        record.take(outcome);
        if record.stage == Stage::Frames {
            let total = record.losses.get("total").copied().unwrap_or_default();
            self.progress.running_loss = match self.progress.running_loss {
                mean if mean.is_finite() => LOSS_MEMORY * mean + (1.0 - LOSS_MEMORY) * total,
                _ => total,
            };
        }
        self.metrics.write(&record)?;
        observer.event(Event::Step { progress: self.share_done(), record: &record });
        Ok(())
    }

    fn checkpoint(&mut self, observer: &mut dyn Observer) -> Result<()> {
        if let Some(outcome) = self.engine.settle()? {
            self.complete(outcome, observer)?;
        }
        self.progress.seconds = self.seconds();
        // Before the checkpoint they belong to: a run that resumes from it finds all of its steps noted, whenever the power fails.
        self.metrics.sync()?;
        let learned = self.engine.learned()?;
        let path = checkpoint::save(learned, &mut self.progress, &self.run, self.config.schedule.checkpoints_kept)?;
        observer.event(Event::Checkpoint { path: &path });
        Ok(())
    }

    /// The first frame beside the avatar in the same pose.
    fn preview(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let frame = self.epochs.frames.read(0)?;
        let pose = self.body.resolve(frame.parameters())?;
        let extracted = match self.avatar()?.extract_posed(self.body, self.labels, &pose, PREVIEW_RESOLUTION) {
            Err(Error::NoSurface { .. }) => return Ok(()),
            extracted => extracted?,
        };
        let folder = self.run.join(PREVIEWS);
        fs::create_dir_all(&folder).map_err(InputError::io(&folder))?;
        let path = folder.join(format!("step-{:08}.png", self.progress.steps));
        write_png(&path, &preview::sheet(&frame, &extracted.mesh)?)?;
        observer.event(Event::Preview { path: &path });
        Ok(())
    }
}
