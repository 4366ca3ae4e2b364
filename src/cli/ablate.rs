//! `xavatar ablate`: train and measure the method without one part after another, in one table.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use xavatar::avatar::{Animator, Avatar};
use xavatar::config::Config;
use xavatar::evaluate::{Ablation, AblationRow, AblationTable, Evaluation};
use xavatar::train::{Ending, Trainer, seconds_per_step};

use super::inputs::{Registered, Split, SubjectArguments, SubjectFrames};
use super::json::JsonArgument;
use super::progress::Progress;
use super::training::TrainingArguments;
use super::{Outcome, WrongUsage, outputs, stop};

/// Train and measure the method without one part after another (table 5.1 of the thesis)
///
/// full; A1: starts from body bones only; A2: starts from all bones; A3: uniform sampling; A4: without the losses that hold the
/// skinning weights. All are trained with the same preset, seed and time or steps.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
    xavatar ablate data/00016 --body models/smplx --out runs/ablations --minutes 10\n\n\
    Writes ablations.json and ablations.md, and a run's folder a variant. The same call again goes on where one was stopped.")]
pub struct Ablate {
    #[command(flatten)]
    subject: SubjectArguments,
    /// The folder for the runs and the table: new, empty, or that of the same call before
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    training: TrainingArguments,
    /// Which frames to measure on
    #[arg(long, value_enum, default_value_t = Split::Test)]
    split: Split,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = super::extract::resolution)]
    resolution: usize,
    #[command(flatten)]
    json: JsonArgument,
}

/// A measured variant, with what it was measured on.
#[derive(Serialize, Deserialize)]
struct Measured {
    split: Split,
    resolution: usize,
    row: AblationRow,
}

impl Ablate {
    const JSON: &str = "ablations.json";
    const MARKDOWN: &str = "ablations.md";
    /// In a variant's folder once it is measured.
    const MEASURED: &str = "ablation.json";

    pub fn run(self) -> anyhow::Result<Outcome> {
        let variants = Ablation::ALL.map(|ablation| self.configuration(ablation).map(|config| (ablation, config)));
        let variants: Vec<_> = variants.into_iter().collect::<Result<_, _>>().map_err(WrongUsage)?;
        self.refuse_other_folders(&variants)?;
        self.json.check()?;
        let opened = self.subject.open()?;
        outputs::existing_folder(&self.out)?;
        let stop = stop::on_interrupt()?;
        let mut table = AblationTable::default();
        for (ablation, config) in &variants {
            let Some(row) = self.row(*ablation, config, &opened, stop)? else {
                log::info!("stopped; the same command again goes on");
                return Ok(Outcome::Stopped);
            };
            table.rows.push(row);
            outputs::write_json(&self.out.join(Self::JSON), &table)?;
            outputs::write_text(&self.out.join(Self::MARKDOWN), &table.markdown())?;
        }
        self.json.print(&table, &format!("{table}{}", self.out.join(Self::JSON).display()))?;
        Ok(Outcome::Done)
    }

    fn configuration(&self, ablation: Ablation) -> xavatar::Result<Config> {
        let own = ablation.settings().iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        Config::preset_with(
            self.training.preset(),
            &self.training.settings().into_iter().chain(own).collect::<Vec<_>>(),
        )
    }

    /// Refuses a folder with anything else in it, or with runs of other settings.
    fn refuse_other_folders(&self, variants: &[(Ablation, Config)]) -> anyhow::Result<()> {
        if outputs::is_new_or_empty(&self.out)? {
            return Ok(());
        }
        for entry in std::fs::read_dir(&self.out).with_context(|| self.out.display().to_string())? {
            let name = entry?.file_name();
            let own = [Self::JSON, Self::MARKDOWN].into_iter().chain(Ablation::ALL.map(Ablation::folder));
            // A call that was killed may have left a partial file.
            let is_partial = name.to_string_lossy().starts_with(".partial-");
            if !is_partial && !own.into_iter().any(|own| name == own) {
                bail!("{}: the folder is not empty, and not of ablations; give a new --out", self.out.display());
            }
        }
        for (ablation, config) in variants {
            let run = self.out.join(ablation.folder());
            if is_run(&run) && Trainer::configuration(&run)? != *config {
                bail!("{}: the run was started with other settings; give a new --out", run.display());
            }
        }
        Ok(())
    }

    /// Trains and measures a variant as far as that is not done; none if it was stopped.
    fn row(
        &self,
        ablation: Ablation,
        config: &Config,
        opened: &Registered,
        stop: &AtomicBool,
    ) -> anyhow::Result<Option<AblationRow>> {
        let run = self.out.join(ablation.folder());
        let mut progress = Progress::new();
        if run.join(Avatar::FILE).is_file() {
            log::info!("{}: trained already", ablation.name());
        } else {
            log::info!("{}: training", ablation.name());
            let frames = SubjectFrames::new(&opened.subject, &opened.subject.train);
            let begin = if is_run(&run) { Trainer::resume } else { Trainer::start };
            let mut trainer = begin(config, &frames, &opened.body, &opened.labels, &run, &mut progress)?;
            let ending = trainer.run(stop, &mut progress)?;
            progress.finish();
            if ending == Ending::Stopped {
                return Ok(None);
            }
        }
        if let Some(row) = self.measured_before(&run) {
            return Ok(Some(row));
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let avatar = Avatar::load(&run)?;
        let animator = Animator::new(&avatar, &opened.body, &opened.labels)?;
        let files = self.split.files(&opened.subject);
        let evaluation = Evaluation {
            body: &opened.body,
            labels: &opened.labels,
            baseline: None,
            samples: Evaluation::SAMPLES,
            seed: 0,
        };
        let mut done = 0;
        let mut progress = Progress::new();
        let report = evaluation.run(
            SubjectFrames::new(&opened.subject, files).iter(),
            |frame| Ok(animator.extract(&frame.parameters, self.resolution)?.mesh),
            |frame| {
                done += 1;
                progress.show("measuring", f64::from(done) / files.len() as f64, &frame.frame);
            },
        )?;
        progress.finish();
        let row = AblationRow {
            ablation,
            steps: avatar.steps,
            seconds_per_step: seconds_per_step(&run)?,
            frames: report.per_frame.len(),
            mean: report.mean(),
        };
        let measured = Measured { split: self.split, resolution: self.resolution, row };
        outputs::write_json(&run.join(Self::MEASURED), &measured)?;
        // As later calls read it: a number may lose its last bit on the way.
        Ok(Some(self.measured_before(&run).unwrap_or(measured.row)))
    }

    /// The row of an earlier call, if it was measured on the same.
    fn measured_before(&self, run: &Path) -> Option<AblationRow> {
        let text = std::fs::read_to_string(run.join(Self::MEASURED)).ok()?;
        let measured: Measured = serde_json::from_str(&text).ok()?;
        (measured.split == self.split && measured.resolution == self.resolution).then_some(measured.row)
    }
}

/// Whether a run was begun in the folder.
fn is_run(folder: &Path) -> bool {
    !matches!(outputs::is_new_or_empty(folder), Ok(true))
}
