//! `xavatar ablate`: train and measure the method without one part after another, in one table.

use std::path::PathBuf;

use xavatar::config::Config;
use xavatar::data::CheckedFrames;
use xavatar::runs::{Ablation, Batch, Run, RunRow, RunTable, Variant, Yardstick};
use xavatar::train::TrainingSpec;

use crate::cli::options::inputs::{AcceptArguments, Split, SubjectArguments};
use crate::cli::options::training::TrainingArguments;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::measured_run::finish;
use crate::cli::{Outcome, WrongUsage, stop};

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
    #[arg(long, value_name = "R", default_value_t = 512, value_parser = crate::cli::options::meshes::resolution)]
    resolution: usize,
    #[command(flatten)]
    json: JsonArgument,
}

impl Ablate {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let variants = Ablation::ALL.map(|ablation| self.configuration(ablation).map(|config| (ablation, config)));
        let variants: Vec<_> = variants.into_iter().collect::<Result<_, _>>().map_err(WrongUsage::from)?;
        let runs: Vec<_> = variants.iter().map(|(ablation, config)| (ablation.folder().to_owned(), config)).collect();
        let batch = Batch::open(&self.out, "ablations", &runs, &[])?;
        self.json.check()?;
        let opened = self.subject.open()?;
        let stop = stop::on_interrupt()?;
        let split = self.split.into();
        let (training, scans) = (opened.subject.training_frames(), opened.subject.frames(split));
        let source = CheckedFrames::new(&training, &opened.body, self.accepted.defects());
        let yardstick = Yardstick { scans: &scans, split, resolution: self.resolution };
        let mut table = RunTable::default();
        for (ablation, config) in &variants {
            let spec = TrainingSpec { config, source: &source, body: &opened.body, labels: &opened.labels };
            let run = Run::open(&batch.folder_of(ablation.folder()), spec)?;
            let Some(metrics) = finish(&run, ablation.name(), &yardstick, stop)? else {
                log::info!("stopped; the same command again goes on");
                return Ok(Outcome::Stopped);
            };
            table.rows.push(RunRow { key: Variant { ablation: *ablation }, metrics });
            batch.write(&table)?;
        }
        self.json.print(&table, &format!("{table}{}", batch.json().display()))?;
        Ok(Outcome::Done)
    }

    fn configuration(&self, ablation: Ablation) -> xavatar::Result<Config> {
        let own = ablation.settings().iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        Config::preset_with(
            self.training.preset(),
            &self.training.settings().into_iter().chain(own).collect::<Vec<_>>(),
        )
    }
}
