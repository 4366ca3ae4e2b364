//! What a run has noted: the steps in its `metrics.jsonl`, the pictures in its `previews/`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use xavatar_formats::read_bytes;

use super::notes::METRICS;
use super::preview;
use crate::train::Stage;
use crate::{InputError, Result};

/// A step as it was noted: what of a [`StepRecord`](crate::train::StepRecord) is looked at later.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NotedStep {
    /// The stage.
    pub stage: Stage,
    /// Steps done in this stage.
    pub step: u64,
    /// Wall time of the step.
    pub seconds: f64,
    /// Points drawn, on and off the surface.
    pub points: usize,
    /// Loss terms, unweighted, and their weighted sum `total`.
    pub losses: BTreeMap<String, f64>,
}

/// Whether a run has noted anything.
pub fn has_notes(run: &Path) -> bool {
    run.join(METRICS).is_file()
}

/// The steps that a run has made, in order. Lines that are damaged are left out: notes are no reason to lose a run.
///
/// # Errors
/// [`InputError::Io`] if the run has no metrics.
pub fn noted_steps(run: &Path) -> Result<Vec<NotedStep>> {
    let path = run.join(METRICS);
    let bytes = read_bytes(&path)?;
    let lines = bytes.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let parsed: Vec<Option<NotedStep>> = lines.map(|line| serde_json::from_slice(line).ok()).collect();
    let (total, steps) = (parsed.len(), parsed.into_iter().flatten().collect::<Vec<_>>());
    if steps.len() < total {
        log::warn!("{}: {} of {total} steps are damaged and left out", path.display(), total - steps.len());
    }
    Ok(steps)
}

/// Mean wall time of a run's steps on frames, seconds; none if it has made none.
///
/// # Errors
/// As [`noted_steps`].
pub fn seconds_per_step(run: &Path) -> Result<Option<f64>> {
    let steps = noted_steps(run)?;
    let seconds: Vec<f64> = steps.iter().filter(|step| step.stage == Stage::Frames).map(|step| step.seconds).collect();
    Ok((!seconds.is_empty()).then(|| seconds.iter().sum::<f64>() / seconds.len() as f64))
}

/// The previews of a run with the steps after which they were made, in order; none if it made none.
///
/// # Errors
/// [`Error::Io`] if their folder cannot be read.
pub fn previews(run: &Path) -> Result<Vec<(u64, PathBuf)>> {
    let folder = run.join(preview::FOLDER);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(InputError::io(&folder))? {
        let path = entry.map_err(InputError::io(&folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let step =
            name.strip_prefix("step-").and_then(|name| name.strip_suffix(".png")).and_then(|step| step.parse().ok());
        found.extend(step.map(|step| (step, path)));
    }
    found.sort();
    Ok(found)
}
