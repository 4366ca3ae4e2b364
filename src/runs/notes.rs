//! What a run notes of its steps: `metrics.jsonl` with all of a [`StepRecord`], and the scalars among it for TensorBoard.
//!
//! A run that is resumed continues both files after its checkpoint's last step: what came later is made again, and noted once.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use super::event_file::{EVENTS, scalars_record, version_record, whole_records};
use crate::train::{Stage, StepRecord};
use crate::{InputError, Result};
use xavatar_formats::{read_bytes, write_atomically};

/// A line a step.
pub(super) const METRICS: &str = "metrics.jsonl";

/// The open files of a run.
pub(super) struct Notes {
    lines: (PathBuf, fs::File),
    events: (PathBuf, fs::File),
}

impl Notes {
    /// Opens the files in the folder `run` for appending, without what they say of steps after the first `steps` of both stages.
    pub fn open(run: &Path, steps: usize) -> Result<Self> {
        let lines = continue_file(run.join(METRICS), |file| {
            let lines = file.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n"));
            lines.take(steps).collect::<Vec<_>>().concat()
        })?;
        let events = continue_file(run.join(EVENTS), |file| match whole_records(file, 1 + steps) {
            [] => version_record(now()),
            records => records.to_vec(),
        })?;
        Ok(Self { lines, events })
    }

    /// Notes a step.
    pub fn write(&mut self, record: &StepRecord) -> Result<()> {
        let line = serde_json::to_string(record).map_err(|error| InputError::io(&self.lines.0)(error.into()))? + "\n";
        let event = scalars_record(now(), record.step, &scalars(record));
        for ((path, file), bytes) in [(&mut self.lines, line.as_bytes()), (&mut self.events, &event)] {
            file.write_all(bytes).map_err(InputError::io(path))?;
        }
        Ok(())
    }

    /// Returns once everything is on the disk.
    pub fn sync(&self) -> Result<()> {
        Ok([&self.lines, &self.events]
            .into_iter()
            .try_for_each(|(path, file)| file.sync_data().map_err(InputError::io(path)))?)
    }
}

/// Replaces a file by what `keep` keeps of it, nothing if there is none, and opens it for appending.
fn continue_file(path: PathBuf, keep: impl FnOnce(&[u8]) -> Vec<u8>) -> Result<(PathBuf, fs::File)> {
    let found = if path.exists() { read_bytes(&path)? } else { Vec::new() };
    let kept = keep(&found);
    write_atomically(&path, |file| file.write_all(&kept))?;
    let file = fs::OpenOptions::new().append(true).open(&path).map_err(InputError::io(&path))?;
    Ok((path, file))
}

/// What TensorBoard shows of a step, by tag: `body/...` of stage 0, `avatar/...` of the steps on frames.
fn scalars(record: &StepRecord) -> Vec<(String, f64)> {
    let stage = match record.stage {
        Stage::Pretraining => "body",
        Stage::Frames => "avatar",
    };
    let mut scalars: Vec<_> =
        record.losses.iter().map(|(name, loss)| (format!("{stage}/loss/{name}"), *loss)).collect();
    let mut insert = |name: &str, value: f64| scalars.push((format!("{stage}/{name}"), value));
    insert("learning rate", record.learning_rate);
    insert("gradient norm", record.gradient_norm);
    insert("seconds a step", record.seconds);
    if record.stage == Stage::Frames {
        insert("share of starts converged", record.converged);
        insert("points without root", record.points_without_root as f64);
    }
    scalars
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}
