//! Measuring a finished run: its avatar against scans, once.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};
use xavatar_formats::{read_bytes, write_atomically};

use super::event::{Event, Observer};
use super::history::seconds_per_step;
use super::run::Run;
use crate::avatar::Animator;
use crate::data::{Source, Split};
use crate::evaluate::{Evaluation, FrameMetrics};
use crate::train::TrainingSpec;
use crate::{InputError, Result};

/// In a run's folder once it is measured.
const FILE: &str = "measured.json";

/// What runs are measured on.
#[derive(Clone, Copy)]
pub struct Yardstick<'a> {
    /// Scans of the subject.
    pub scans: &'a dyn Source,
    /// Which of its frames they are.
    pub split: Split,
    /// Cells along the longest side of the box around the body.
    pub resolution: usize,
}

/// What came out of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunMetrics {
    /// Steps on frames that it was trained for.
    pub steps: u64,
    /// Mean wall time of such a step.
    pub seconds_per_step: Option<f64>,
    /// Frames that it was measured on.
    pub frames: usize,
    /// The mean of the metrics over those frames.
    pub mean: FrameMetrics,
}

/// With what it was measured on.
#[derive(Serialize, Deserialize)]
struct Measured {
    split: Split,
    resolution: usize,
    metrics: RunMetrics,
}

impl Run<'_> {
    /// Measures the finished run's avatar, unless that is done; none if `stop` is set before it is begun.
    ///
    /// # Errors
    /// If the run has no avatar yet, or a scan cannot be read or compared.
    pub fn measure(
        &self,
        yardstick: &Yardstick,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Result<Option<RunMetrics>> {
        let file = self.folder().join(FILE);
        if let Some(metrics) = yardstick.measured_before(&file) {
            return Ok(Some(metrics));
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let metrics = self.compare(yardstick, observer)?;
        let measured = Measured { split: yardstick.split, resolution: yardstick.resolution, metrics };
        let text = serde_json::to_string_pretty(&measured).map_err(|error| InputError::io(&file)(error.into()))?;
        write_atomically(&file, |out| writeln!(out, "{text}"))?;
        // As later calls read it: a number may lose its last bit on the way.
        Ok(Some(yardstick.measured_before(&file).unwrap_or(measured.metrics)))
    }

    fn compare(&self, yardstick: &Yardstick, observer: &mut dyn Observer) -> Result<RunMetrics> {
        let TrainingSpec { body, labels, .. } = self.spec();
        let Yardstick { scans, resolution, .. } = *yardstick;
        let avatar = self.avatar()?;
        let animator = Animator::new(&avatar, body, labels)?;
        let evaluation = Evaluation {
            body,
            labels,
            baseline: None,
            regions: false,
            pictures: false,
            samples: Evaluation::SAMPLES,
            seed: 0,
        };
        let (mut done, total) = (0, scans.ids().len());
        let report = evaluation.run(
            (0..total).map(|index| scans.scan(index)),
            |_, pose| Ok(animator.extract(pose, resolution)?.mesh),
            |frame| {
                done += 1;
                observer.event(Event::Measured { done, total, frame: &frame.frame });
            },
        )?;
        Ok(RunMetrics {
            steps: avatar.steps,
            seconds_per_step: seconds_per_step(self.folder())?,
            frames: report.per_frame.len(),
            mean: report.mean(),
        })
    }
}

impl Yardstick<'_> {
    /// The result of an earlier call, if it was measured on the same.
    fn measured_before(&self, file: &Path) -> Option<RunMetrics> {
        let measured: Measured = serde_json::from_slice(&read_bytes(file).ok()?).ok()?;
        (measured.split == self.split && measured.resolution == self.resolution).then_some(measured.metrics)
    }
}
