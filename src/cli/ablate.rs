//! `xavatar ablate`: train and measure the method without one part after another, in one table.

use std::path::PathBuf;

use anyhow::{Context, bail};
use xavatar::config::Config;
use xavatar::data::CheckedFrames;
use xavatar::evaluate::{Ablation, AblationRow, AblationTable};
use xavatar::train::TrainingFrames;

use super::inputs::{AcceptArguments, Split, SubjectArguments, SubjectFrames};
use super::json::JsonArgument;
use super::measured_run::{MeasuredRun, RunMetrics, Yardstick};
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
    #[command(flatten)]
    accepted: AcceptArguments,
    /// Which frames to measure on
    #[arg(long, value_enum, default_value_t = Split::Test)]
    split: Split,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 512, value_parser = super::extract::resolution)]
    resolution: usize,
    #[command(flatten)]
    json: JsonArgument,
}

impl Ablate {
    const JSON: &str = "ablations.json";
    const MARKDOWN: &str = "ablations.md";

    pub fn run(self) -> anyhow::Result<Outcome> {
        let variants = Ablation::ALL.map(|ablation| self.configuration(ablation).map(|config| (ablation, config)));
        let variants: Vec<_> = variants.into_iter().collect::<Result<_, _>>().map_err(WrongUsage::from)?;
        self.refuse_other_folders(&variants)?;
        self.json.check()?;
        let opened = self.subject.open()?;
        outputs::existing_folder(&self.out)?;
        let stop = stop::on_interrupt()?;
        let scans = SubjectFrames::new(&opened.subject, &opened.subject.train);
        let frames = CheckedFrames::new(&scans, &opened.body, self.accepted.defects());
        let yardstick = Yardstick {
            body: &opened.body,
            labels: &opened.labels,
            scans: &SubjectFrames::new(&opened.subject, self.split.files(&opened.subject)),
            split: self.split,
            resolution: self.resolution,
        };
        let mut table = AblationTable::default();
        for (ablation, config) in &variants {
            let run = self.variant(*ablation, config);
            let Some(measured) = run.finish(TrainingFrames::Scans(&frames), &yardstick, stop)? else {
                log::info!("stopped; the same command again goes on");
                return Ok(Outcome::Stopped);
            };
            let RunMetrics { steps, seconds_per_step, frames, mean } = measured;
            table.rows.push(AblationRow { ablation: *ablation, steps, seconds_per_step, frames, mean });
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
        variants.iter().try_for_each(|(ablation, config)| self.variant(*ablation, config).refuse_other_settings())
    }

    fn variant<'a>(&self, ablation: Ablation, config: &'a Config) -> MeasuredRun<'a> {
        MeasuredRun { name: ablation.name().into(), folder: self.out.join(ablation.folder()), config }
    }
}
