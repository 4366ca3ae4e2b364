//! What a run has noted in its `metrics.jsonl`.

use std::path::Path;

use serde::Deserialize;

use super::Stage;
use super::metrics_log::METRICS;
use crate::{Error, Result};

/// Mean wall time of a run's steps on frames, seconds; none if it has made none.
///
/// # Errors
/// [`Error::Io`] if the run has no metrics, [`Error::Malformed`] if they are not a trainer's.
pub fn seconds_per_step(run: &Path) -> Result<Option<f64>> {
    #[derive(Deserialize)]
    struct Step {
        stage: Stage,
        seconds: f64,
    }
    let path = run.join(METRICS);
    let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
    let (mut seconds, mut steps) = (0.0, 0);
    for (number, line) in (1..).zip(text.lines()) {
        let step: Step = serde_json::from_str(line).map_err(|error| Error::Malformed {
            path: path.clone(),
            format: "metrics",
            place: format!("line {number}"),
            found: error.to_string(),
            expected: "a step as the trainer writes it".into(),
        })?;
        if step.stage == Stage::Frames {
            seconds += step.seconds;
            steps += 1;
        }
    }
    Ok((steps > 0).then(|| seconds / f64::from(steps)))
}
