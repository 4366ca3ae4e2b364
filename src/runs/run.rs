//! One run: where it begins, goes on and ends.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use xavatar_formats::{Choice, FolderLock, Remedy, is_vacant, remove_partial, write_atomically};

use super::cache::Cache;
use super::checkpoint;
use super::event::{Event, Observer};
use super::notes::Notes;
use super::preview;
use crate::avatar::{Avatar, Subject};
use crate::body::BodyModel;
use crate::config::Config;
use crate::data::Source;
use crate::train::{Stage, StepRecord, Trainer, TrainingSpec};
use crate::{Error, InputError, Result};

const CONFIG: &str = "config.toml";

/// How a call that trains has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All steps are done, or the time is up; the avatar is written.
    Finished,
    /// It was asked to stop; a checkpoint is written.
    Stopped,
}

/// A training in a folder, which is this process's alone while the run is open.
pub struct Run<'a> {
    folder: PathBuf,
    spec: TrainingSpec<'a>,
    _lock: FolderLock,
}

impl<'a> Run<'a> {
    /// The run in a folder: begun if there is nothing there yet, else the one that these settings began.
    ///
    /// # Errors
    /// If the settings are for captures of another kind, or the folder holds something else, a run of other settings, or one that another
    /// process works on.
    pub fn open(folder: &Path, spec: TrainingSpec<'a>) -> Result<Self> {
        spec.check()?;
        let is_begun = Self::is_begun(folder)?;
        if is_begun {
            Self::require_settings(folder, spec.config)?;
        }
        let lock = FolderLock::take(folder)?;
        for part in [checkpoint::FOLDER, preview::FOLDER] {
            remove_partial(&folder.join(part))?;
        }
        if !is_begun {
            let settings = spec.config.to_toml()?;
            write_atomically(&folder.join(CONFIG), |file| file.write_all(settings.as_bytes()))?;
        }
        Ok(Self { folder: folder.into(), spec, _lock: lock })
    }

    /// Whether there is anything finished in a folder.
    ///
    /// # Errors
    /// If it cannot be listed.
    pub fn is_begun(folder: &Path) -> Result<bool> {
        Ok(!is_vacant(folder)?)
    }

    /// The settings of the run in a folder.
    ///
    /// # Errors
    /// If the folder holds no run.
    pub fn configuration(folder: &Path) -> Result<Config> {
        let path = folder.join(CONFIG);
        if !path.is_file() {
            return Err(Error::from(InputError::Missing {
                path: folder.into(),
                what: format!("a run ({CONFIG})"),
                remedy: Remedy::choosing(Choice::StartRun, "start one in a new or empty folder"),
            }));
        }
        Config::read(&path)
    }

    /// Refuses the run in a folder if it was started with other settings.
    pub(super) fn require_settings(folder: &Path, config: &Config) -> Result<()> {
        if Self::configuration(folder)? == *config {
            return Ok(());
        }
        Err(Error::from(InputError::Mismatch {
            path: folder.into(),
            found: "a run that was started with other settings".into(),
            expected: "one of these settings, or nothing".into(),
            remedy: "name another folder".into(),
        }))
    }

    /// The run's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub(super) fn spec(&self) -> TrainingSpec<'a> {
        self.spec
    }

    /// Whether the avatar is written.
    pub fn is_finished(&self) -> bool {
        self.folder.join(Avatar::FILE).is_file()
    }

    /// The finished run's avatar.
    ///
    /// # Errors
    /// As [`Avatar::load`].
    pub fn avatar(&self) -> Result<Avatar> {
        Avatar::load(&self.folder)
    }

    /// Trains until all steps are done, the time is up, or `stop` is set; from the newest checkpoint on that is not damaged, if there is
    /// one.
    ///
    /// # Errors
    /// If a capture is bad (unless the settings skip those), a checkpoint cannot be read, a loss or
    /// gradient is not finite (the last checkpoint is kept), or a file cannot be written.
    pub fn train(&self, stop: &AtomicBool, observer: &mut dyn Observer) -> Result<Ending> {
        if self.is_finished() {
            return Ok(Ending::Finished);
        }
        let started = Instant::now();
        let cache = Cache::open(self.spec, &self.folder, observer)?;
        let spec = TrainingSpec { source: &cache, ..self.spec };
        let body = spec.canonical_body()?;
        let spec = TrainingSpec { body: &body, ..spec };
        let trainer = Trainer::new(spec, cache.seen_vertices(), started, |state| {
            checkpoint::restore_newest(&self.folder, state)
        })?;
        let notes = Notes::open(&self.folder, trainer.progress().all_steps() as usize)?;
        Session { run: self, cache: &cache, body: &body, trainer, notes, observer }.train(stop)
    }
}

/// One call of [`Run::train`].
struct Session<'s, 'a> {
    run: &'s Run<'a>,
    cache: &'s Cache,
    /// In the avatar's canonical pose.
    body: &'s BodyModel,
    trainer: Trainer<'s>,
    notes: Notes,
    observer: &'s mut dyn Observer,
}

impl Session<'_, '_> {
    fn train(mut self, stop: &AtomicBool) -> Result<Ending> {
        let schedule = &self.run.spec.config.schedule;
        while !self.trainer.is_done() {
            if stop.load(Ordering::Relaxed) {
                self.checkpoint()?;
                return Ok(Ending::Stopped);
            }
            if self.trainer.is_refinement_due() {
                self.refine_poses(stop)?;
                continue;
            }
            let stage = self.trainer.stage();
            if let Some(record) = self.trainer.step()? {
                self.note(&record)?;
            }
            let steps = self.trainer.progress().steps;
            if self.trainer.progress().all_steps().is_multiple_of(schedule.checkpoint_steps) {
                self.checkpoint()?;
            }
            let every = schedule.preview_steps;
            if stage == Stage::Frames && every > 0 && steps.is_multiple_of(every) {
                self.preview()?;
            }
            if stage == Stage::Frames && self.observer.wants_avatar() {
                self.settle()?;
                let avatar = Box::new(self.avatar()?);
                self.observer.event(Event::Avatar { avatar });
            }
        }
        self.checkpoint()?;
        self.avatar()?.save(&self.run.folder.join(Avatar::FILE))?;
        Ok(Ending::Finished)
    }

    fn refine_poses(&mut self, stop: &AtomicBool) -> Result<()> {
        self.settle()?;
        let Self { trainer, observer, .. } = self;
        let refined = trainer.refine_poses(|done, total| {
            observer.event(Event::Refining { done, total });
            !stop.load(Ordering::Relaxed)
        })?;
        if let Some(refined) = refined {
            observer.event(Event::Refined { refined });
        }
        Ok(())
    }

    fn note(&mut self, record: &StepRecord) -> Result<()> {
        self.notes.write(record)?;
        self.observer.event(Event::Step { progress: self.trainer.share_done(), record });
        Ok(())
    }

    /// Waits for the last step, and notes it.
    fn settle(&mut self) -> Result<()> {
        match self.trainer.settle()? {
            Some(record) => self.note(&record),
            None => Ok(()),
        }
    }

    fn checkpoint(&mut self) -> Result<()> {
        self.settle()?;
        // Before the checkpoint they belong to: a run that goes on from it finds all of its steps noted, whenever the power fails.
        self.notes.sync()?;
        let (learned, progress) = self.trainer.state()?;
        let path = checkpoint::save(learned, progress, &self.run.folder)?;
        self.observer.event(Event::Checkpoint { path: &path });
        Ok(())
    }

    /// The first capture beside the avatar in the same pose.
    fn preview(&mut self) -> Result<()> {
        self.settle()?;
        let (avatar, capture) = (self.avatar()?, self.cache.read(0)?);
        let TrainingSpec { labels, .. } = self.run.spec;
        if let Some(path) = preview::write(&self.run.folder, &avatar, self.body, labels, &capture)? {
            self.observer.event(Event::Preview { path: &path });
        }
        Ok(())
    }

    /// The avatar as it is now.
    fn avatar(&mut self) -> Result<Avatar> {
        let (source, bounds) = (self.cache, self.trainer.bounds());
        let subject = Subject::of(self.body, source.gender(), source.betas(), bounds, source.ids().len())?;
        let (learned, progress) = self.trainer.state()?;
        let (fields, config, steps) = (learned.fields.clone(), self.run.spec.config.clone(), progress.steps);
        Ok(Avatar { fields, config, subject, steps })
    }
}
