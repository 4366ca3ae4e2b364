//! A run that is one row of a table: trained, then measured. What an earlier call has done is not done again.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::bail;
use serde::{Deserialize, Serialize};
use xavatar::avatar::{Animator, Avatar};
use xavatar::body::{BodyModel, PartLabels};
use xavatar::config::Config;
use xavatar::evaluate::{Evaluation, FrameMetrics};
use xavatar::formats::read_text;
use xavatar::train::{Ending, Trainer, TrainingFrames, seconds_per_step};

use super::inputs::{Split, SubjectFrames};
use super::outputs;
use super::progress::Progress;

/// A run and what it is trained with.
pub struct MeasuredRun<'a> {
    /// For messages.
    pub name: String,
    pub folder: PathBuf,
    pub config: &'a Config,
}

/// What runs are measured on.
pub struct Yardstick<'a> {
    pub body: &'a BodyModel,
    pub labels: &'a PartLabels,
    /// Frames with scans.
    pub scans: &'a SubjectFrames,
    pub split: Split,
    /// Cells along the longest side of the box around the body.
    pub resolution: usize,
}

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunMetrics {
    /// Steps on frames.
    pub steps: u64,
    /// Mean wall time of such a step.
    pub seconds_per_step: Option<f64>,
    /// Frames that were measured.
    pub frames: usize,
    /// The mean over those frames.
    pub mean: FrameMetrics,
}

/// With what it was measured on.
#[derive(Serialize, Deserialize)]
struct Measured {
    split: Split,
    resolution: usize,
    metrics: RunMetrics,
}

/// In a run's folder once it is measured.
const FILE: &str = "measured.json";

impl MeasuredRun<'_> {
    /// Refuses a folder with a run of other settings.
    pub fn refuse_other_settings(&self) -> anyhow::Result<()> {
        if self.is_begun() && Trainer::configuration(&self.folder)? != *self.config {
            bail!("{}: the run was started with other settings; give a new --out", self.folder.display());
        }
        Ok(())
    }

    /// Trains and measures as far as that is not done; none if it was stopped.
    pub fn finish(
        &self,
        frames: TrainingFrames<'_>,
        yardstick: &Yardstick,
        stop: &AtomicBool,
    ) -> anyhow::Result<Option<RunMetrics>> {
        if self.folder.join(Avatar::FILE).is_file() {
            log::info!("{}: trained already", self.name);
        } else {
            log::info!("{}: training", self.name);
            let mut progress = Progress::new();
            let begin = if self.is_begun() { Trainer::resume } else { Trainer::start };
            let mut trainer =
                begin(self.config, frames, yardstick.body, yardstick.labels, &self.folder, &mut progress)?;
            let ending = trainer.run(stop, &mut progress)?;
            progress.finish();
            if ending == Ending::Stopped {
                return Ok(None);
            }
        }
        let file = self.folder.join(FILE);
        if let Some(metrics) = yardstick.measured_before(&file) {
            return Ok(Some(metrics));
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let metrics = yardstick.measure(&self.folder)?;
        let measured = Measured { split: yardstick.split, resolution: yardstick.resolution, metrics };
        outputs::write_json(&file, &measured)?;
        // As later calls read it: a number may lose its last bit on the way.
        Ok(Some(yardstick.measured_before(&file).unwrap_or(measured.metrics)))
    }

    fn is_begun(&self) -> bool {
        !matches!(outputs::is_new_or_empty(&self.folder), Ok(true))
    }
}

impl Yardstick<'_> {
    fn measure(&self, run: &Path) -> anyhow::Result<RunMetrics> {
        let avatar = Avatar::load(run)?;
        let animator = Animator::new(&avatar, self.body, self.labels)?;
        let evaluation =
            Evaluation { body: self.body, labels: self.labels, baseline: None, samples: Evaluation::SAMPLES, seed: 0 };
        let (mut done, total) = (0, self.scans.len());
        let mut progress = Progress::new();
        let report = evaluation.run(
            self.scans.iter(),
            |_, pose| Ok(animator.extract(pose, self.resolution)?.mesh),
            |frame| {
                done += 1;
                progress.show("measuring", f64::from(done) / total as f64, &frame.frame);
            },
        )?;
        progress.finish();
        Ok(RunMetrics {
            steps: avatar.steps,
            seconds_per_step: seconds_per_step(run)?,
            frames: report.per_frame.len(),
            mean: report.mean(),
        })
    }

    /// The result of an earlier call, if it was measured on the same.
    fn measured_before(&self, file: &Path) -> Option<RunMetrics> {
        let measured: Measured = serde_json::from_str(&read_text(file).ok()?).ok()?;
        (measured.split == self.split && measured.resolution == self.resolution).then_some(measured.metrics)
    }
}
