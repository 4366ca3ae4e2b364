//! The run itself: which step comes next, when to save, when to stop.
//!
//! A run that was stopped and resumed at a step does what an uninterrupted one does, to the bit, with the same number of threads.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use xavatar_deformer::{BakedWeights, StartGroups, VoxelSkinning};
use xavatar_network::{Adam, NetworkUpdate, ParameterGroup, SummedGradient};

use super::captured::TrainingFrames;
use super::checkpoint::{Progress, State, checkpoints};
use super::frame_store::FrameStore;
use super::losses::{LossEvaluator, LossTerms};
use super::metrics_log::MetricsLog;
use super::pretraining::CanonicalBody;
use super::step::{Drawn, add_time};
use super::{Event, Observer, Stage, StepRecord, preview};
use crate::avatar::{Avatar, Subject};
use crate::body::{BodyModel, PartLabels};
use crate::canonical_grid::CanonicalGrid;
use crate::config::{Config, SkinningSettings};
use crate::correspondence::{bake, start_groups, union_start_groups};
use crate::fields::{Fields, Skinning};
use crate::render::write_png;
use crate::{Error, InputError, Result};
use xavatar_formats::write_atomically;

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
    pub(super) config: &'a Config,
    body: &'a BodyModel,
    labels: &'a PartLabels,
    run: PathBuf,
    pub(super) subject: Subject,
    pub(super) canonical: CanonicalBody<'a>,
    pub(super) frames: FrameStore<'a>,
    pub(super) groups: StartGroups,
    /// What the next frame is trained on, drawn while the one before was.
    pub(super) drawn: Option<Drawn<'a>>,
    /// The grid that the search runs on; sampled every few steps.
    pub(super) baked: Option<BakedWeights<f32>>,
    /// Where skinning is learned on a grid: that grid.
    pub(super) grid: Option<CanonicalGrid>,
    /// The gradient of its logits (P); empty without one.
    pub(super) voxel_gradient: Vec<f32>,
    pub(super) state: State,
    pub(super) losses: LossEvaluator<f32>,
    metrics: MetricsLog,
    started: Instant,
    /// Seconds that earlier commands spent on this run.
    earlier_seconds: f64,
}

impl<'a> Trainer<'a> {
    /// Starts a run in a new or empty folder.
    ///
    /// # Errors
    /// If the folder holds anything, a frame is bad (unless the configuration skips those), or the configuration is refused or for
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
        fs::create_dir_all(run).map_err(InputError::io(run))?;
        if fs::read_dir(run).map_err(InputError::io(run))?.next().is_some() {
            return Err(Error::from(InputError::Value {
                name: format!("the run folder {}", run.display()),
                found: "not empty".into(),
                expected: "a new or empty folder; continue a run with --resume".into(),
            }));
        }
        let text = config.to_toml()?;
        write_atomically(&run.join(CONFIG), |file| file.write_all(text.as_bytes()))?;
        Self::open(config, frames, body, labels, run, observer)
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
                remedy: "start one without --resume".into(),
            }));
        }
        Config::read(&run.join(CONFIG))
    }

    /// Continues a run from its newest checkpoint; from the start if it had none yet.
    ///
    /// # Errors
    /// If a checkpoint cannot be read; delete it to continue from the one before.
    pub fn resume(
        config: &'a Config,
        frames: TrainingFrames,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        frames.check(config)?;
        Self::open(config, frames, body, labels, run, observer)
    }

    fn open(
        config: &'a Config,
        frames: TrainingFrames,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let started = Instant::now();
        let mut canonical = CanonicalBody::new(body, labels, &frames.betas(), config)?;
        let groups = match config.fields.skinning {
            SkinningSettings::Network(_) => start_groups(config.starts)?,
            // Pruned starts cost little: a point beside a hand finds the hand's root, and the body's.
            SkinningSettings::Voxels(_) => union_start_groups(config.starts)?,
        };
        let (skinning, grid) = match &config.fields.skinning {
            SkinningSettings::Network(shape) => (Skinning::network(shape)?, None),
            SkinningSettings::Voxels(shape) => {
                let grid = CanonicalGrid::new(body, labels, &frames.betas(), *shape)?;
                let mut voxels = grid.skinning(body)?;
                grid.prune_starts(&mut voxels, &groups)?;
                (Skinning::Voxels(voxels), Some(grid))
            }
        };
        let mut fields = Fields::new(&config.fields, skinning, canonical.bounds())?;
        fields.initialise(config.seed);
        let voxel_gradient = fields.skinning.voxels().map_or(Vec::new(), VoxelSkinning::zero_gradient);
        let mut adam: Vec<_> = fields.networks().iter().map(|network| Adam::new(network.parameters().len())).collect();
        if !voxel_gradient.is_empty() {
            adam.push(Adam::new(voxel_gradient.len()));
        }
        let progress = Progress { running_loss: f64::INFINITY, best_loss: f64::INFINITY, ..Progress::default() };
        let mut state = State { fields, adam, progress, baked_skinning: None };
        if let Some(newest) = checkpoints(run)?.first() {
            state.load(newest)?;
        }
        // The grid that an uninterrupted run would be searching on.
        let bounds = canonical.bounds();
        let mut baked = None;
        if let Some(parameters) = &state.baked_skinning {
            let mut skinning = state.fields.skinning.clone();
            if let Skinning::Network(field) = &mut skinning {
                field.mlp_mut().update(|target| target.copy_from_slice(parameters));
            }
            baked = bake(&skinning, config.searched_field, bounds)?;
        }
        let store = FrameStore::open(config, frames, body, labels, run, observer)?;
        canonical.stand_in(store.seen_vertices());
        let subject = Subject {
            gender: frames.gender(),
            betas: frames.betas(),
            joints: canonical.joints().to_vec(),
            bounds,
            frames: store.len(),
        };
        Ok(Self {
            losses: LossEvaluator::new(&state.fields, rayon::current_num_threads()),
            metrics: MetricsLog::open(run, (state.progress.pretraining_steps + state.progress.steps) as usize)?,
            earlier_seconds: state.progress.seconds,
            groups,
            grid,
            voxel_gradient,
            baked,
            drawn: None,
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
            self.metrics.write(&record)?;
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
            Some(limit) => (self.seconds() / limit).max(self.share_of_epochs()),
            None => self.state.progress.steps as f64 / self.config.schedule.steps.max(1) as f64,
        }
    }

    /// Share that is done of the passes over the frames that end a run early; 0 where there is no such bound.
    fn share_of_epochs(&self) -> f64 {
        let most_frames = self.config.schedule.most_epochs * self.frames.len() as u64;
        let done = self.state.progress.steps * self.config.optimiser.batch_frames as u64;
        if most_frames > 0 { done as f64 / most_frames as f64 } else { 0.0 }
    }

    fn step(&mut self, stage: Stage) -> Result<StepRecord> {
        let begin = Instant::now();
        let settings = &self.config.optimiser;
        let step = match stage {
            Stage::Pretraining => self.state.progress.pretraining_steps,
            Stage::Frames => self.state.progress.steps,
        };
        let decay = match stage {
            Stage::Pretraining => 1.0,
            Stage::Frames => settings.final_share.powf(self.share_done().min(1.0)),
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
            learning_rate: decay * settings.learning_rate,
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
        self.update(decay, &mut record)?;
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

    /// Clips the gradients and moves the parameters, at `decay` times the first step's learning rates.
    fn update(&mut self, decay: f64, record: &mut StepRecord) -> Result<()> {
        let settings = &self.config.optimiser;
        let State { fields, adam, .. } = &mut self.state;
        let voxel_gradient = &mut self.voxel_gradient;
        if let Some(voxels) = fields.skinning.voxels() {
            let pull = voxels.pull_to_initial(self.config.losses.volume as f32, voxel_gradient)?;
            record.losses.insert("volume", f64::from(pull));
        }
        let gradients = self.losses.sum_gradients(fields);
        let of_voxels = voxel_gradient.iter().map(|g| f64::from(*g) * f64::from(*g)).sum::<f64>();
        let squares = gradients.iter().map(SummedGradient::squared_norm).sum::<f64>() + of_voxels;
        record.gradient_norm = squares.sqrt();
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
        let factor = (settings.clip / record.gradient_norm).min(1.0);
        let group = |rate: f64| ParameterGroup { settings: settings.adam, rate: decay * rate };
        let of_grids = [settings.grid_learning_rate, settings.colour_grid_learning_rate, 0.0];
        let networks = fields.networks_mut().into_iter().zip(of_grids);
        for (((network, rate), adam), gradient) in networks.zip(adam.iter_mut()).zip(gradients) {
            let grid = ParameterGroup { settings: settings.grid_adam, rate: decay * rate };
            let update = NetworkUpdate { network: group(settings.learning_rate), grid, factor };
            adam.step_network(&update, gradient, network);
        }
        if let (Some(voxels), Some(adam)) = (fields.skinning.voxels_mut(), adam.last_mut()) {
            let rate = decay * settings.voxel_learning_rate;
            voxels.update(|logits| adam.step(settings.adam, rate, factor, voxel_gradient, logits));
            voxel_gradient.fill(0.0);
        }
        Ok(())
    }

    fn checkpoint(&mut self, observer: &mut dyn Observer) -> Result<()> {
        self.state.progress.seconds = self.seconds();
        let path = self.state.save(&self.run, self.config.schedule.checkpoints_kept)?;
        self.metrics.sync()?;
        observer.event(Event::Checkpoint { path: &path });
        Ok(())
    }

    /// The first frame beside the avatar in the same pose.
    fn preview(&self, observer: &mut dyn Observer) -> Result<()> {
        let frame = self.frames.read(0)?;
        let extracted =
            match self.avatar().extract_posed(self.body, self.labels, frame.parameters(), PREVIEW_RESOLUTION) {
                Err(Error::NoSurface { .. }) => return Ok(()),
                extracted => extracted?,
            };
        let folder = self.run.join(PREVIEWS);
        fs::create_dir_all(&folder).map_err(InputError::io(&folder))?;
        let path = folder.join(format!("step-{:08}.png", self.state.progress.steps));
        write_png(&path, &preview::sheet(&frame, &extracted.mesh)?)?;
        observer.event(Event::Preview { path: &path });
        Ok(())
    }
}
