//! One subject's work, by whoever holds its folder: what is not done yet of what is asked, and nothing twice.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::digest::Inputs;
use super::folder::SubjectFolder;
use super::plan::{Stage, SubjectPlan};
use super::stages::{Ended, Stages};
use crate::Result;
use crate::runs::Observer;
use xavatar_formats::FolderLock;

/// Whoever watches the work.
pub trait Watcher: Observer {
    /// A stage begins.
    fn stage(&mut self, stage: Stage);

    /// How much of a phase of it is done, 0 to 1, and on what; of training, an [`Event`](crate::runs::Event) says more.
    fn phase(&mut self, phase: &'static str, share: f64, message: &str);

    /// What there was of other inputs or settings was put into this folder.
    fn put_aside(&mut self, folder: PathBuf);
}

/// How a call that worked on a subject has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Worked {
    /// All that is asked is done.
    Done,
    /// It was done by an earlier call.
    Already,
    /// Another process works on it.
    InUse(String),
    /// It was asked to stop; the next call goes on.
    Stopped,
}

/// Works on a subject until all that its plan asks is done, or `stop` is set.
///
/// # Errors
/// What a stage fails with; the folder says it too, and the next call tries again.
pub fn work_on(
    plan: &SubjectPlan,
    folder: &SubjectFolder,
    stop: &AtomicBool,
    watcher: &mut dyn Watcher,
) -> Result<Worked> {
    let lock = match FolderLock::take(folder.path()) {
        Ok(lock) => lock,
        Err(error) => match FolderLock::holder(folder.path())? {
            Some(holder) => return Ok(Worked::InUse(holder)),
            None => return Err(error.into()),
        },
    };
    let worked = locked(plan, folder, stop, watcher);
    if let Err(error) = &worked {
        folder.fail(error.to_string())?;
    }
    drop(lock);
    worked
}

fn locked(plan: &SubjectPlan, folder: &SubjectFolder, stop: &AtomicBool, watcher: &mut dyn Watcher) -> Result<Worked> {
    let known = folder.inputs();
    let inputs = Inputs::of(plan, known.as_ref())?;
    let is_same = known.is_some_and(|known| known.is_same(&inputs));
    if is_same && folder.done(plan)?.is_some() {
        return Ok(Worked::Already);
    }
    if let Some(aside) = folder.begin(&inputs)? {
        watcher.put_aside(aside);
    }
    folder.forget_results()?;
    let mut stages = Stages::new(plan, folder);
    for stage in plan.stages.iter().copied() {
        if stop.load(Ordering::Relaxed) {
            return Ok(Worked::Stopped);
        }
        if stages.is_done(stage)? {
            continue;
        }
        watcher.stage(stage);
        let began = Instant::now();
        let ended = stages.run(stage, stop, watcher);
        let event = match ended {
            Ok(Ended::Done) => "ended",
            Ok(Ended::Stopped) => "stopped",
            Err(_) => "failed",
        };
        folder.note(stage, event, began.elapsed().as_secs_f64())?;
        if ended? == Ended::Stopped {
            return Ok(Worked::Stopped);
        }
    }
    let (steps, metrics) = stages.results()?;
    folder.forget_failure()?;
    folder.finish(plan, steps, metrics)?;
    Ok(Worked::Done)
}
