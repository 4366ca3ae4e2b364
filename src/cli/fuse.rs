//! `xavatar fuse`: how the error falls as the camera sees more of the turn, in one table and a plot.

use std::path::PathBuf;

use anyhow::{Context, bail};
use image::RgbImage;
use xavatar::body::Role;
use xavatar::config::Config;
use xavatar::data::{RgbdSource, RgbdSubject};
use xavatar::evaluate::{FusionRow, FusionTable, SomeFrames, turned};
use xavatar::render::{Plot, Series, write_png};
use xavatar::train::TrainingFrames;

use super::captured::Kind;
use super::inputs::{Registered, Split, SubjectArguments, SubjectFrames};
use super::json::JsonArgument;
use super::measured_run::{MeasuredRun, RunMetrics, Yardstick};
use super::progress::Progress;
use super::training::TrainingArguments;
use super::{Outcome, WrongUsage, outputs, stop};

/// Train on more and more of the camera's turn around the subject, and measure how the error falls
///
/// Needs RGB-D frames to train on and scans to measure with. The turn of each sequence begins at its first frame.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar fuse data/00016 --body models/smplx --out runs/fusion --minutes 3\n  \
    xavatar fuse data/00016 --body models/smplx --out runs/views --turns 90,180,360 --equal-frames --minutes 3\n\n\
    Writes fusion.json, fusion.md and fusion.png, and a run's folder a row. The same call again goes on where one was stopped.")]
pub struct Fuse {
    #[command(flatten)]
    subject: SubjectArguments,
    /// The folder for the runs, the table and the plot: new, empty, or that of the same call before
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Parts of the turn, degrees
    #[arg(long, value_name = "DEGREES", value_delimiter = ',', value_parser = degrees, default_value = "45,90,180,360")]
    turns: Vec<f64>,
    /// Train every row on as many frames as the smallest part has, spread evenly over the row's part
    #[arg(long)]
    equal_frames: bool,
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

impl Fuse {
    const JSON: &str = "fusion.json";
    const MARKDOWN: &str = "fusion.md";
    const PLOT: &str = "fusion.png";

    pub fn run(mut self) -> anyhow::Result<Outcome> {
        self.turns.sort_by(f64::total_cmp);
        self.turns.dedup();
        let preset = Kind::Rgbd.preset(self.training.preset());
        let config = Config::preset_with(preset, &self.training.settings()).map_err(WrongUsage::from)?;
        let runs: Vec<_> = self.turns.iter().map(|turn| (*turn, self.run_of(*turn, &config))).collect();
        self.refuse_other_folders(&runs)?;
        self.json.check()?;
        let Registered { subject, body, labels } = self.subject.open()?;
        let source = RgbdSubject::open(&self.subject.data)?.training_frames();
        outputs::existing_folder(&self.out)?;
        let stop = stop::on_interrupt()?;
        let yardstick = Yardstick {
            body: &body,
            labels: &labels,
            scans: &SubjectFrames::new(&subject, self.split.files(&subject)),
            split: self.split,
            resolution: self.resolution,
        };
        let mut progress = Progress::new();
        let total = source.ids().len();
        let turned = turned(&source, |done| {
            progress.show("cameras", done as f64 / total as f64, &format!("{done} of {total} read"));
        })?;
        progress.finish();
        let smallest = SomeFrames::within(&source, &turned, self.turns[0], None)?.ids().len();
        let mut table = FusionTable::default();
        for (turn, run) in &runs {
            let frames = SomeFrames::within(&source, &turned, *turn, self.equal_frames.then_some(smallest))?;
            let trained_on = frames.ids().len();
            let Some(measured) = run.finish(TrainingFrames::Rgbd(&frames), &yardstick, stop)? else {
                log::info!("stopped; the same command again goes on");
                return Ok(Outcome::Stopped);
            };
            let RunMetrics { steps, seconds_per_step, frames, mean } = measured;
            table.rows.push(FusionRow { turn: *turn, trained_on, steps, seconds_per_step, frames, mean });
            outputs::write_json(&self.out.join(Self::JSON), &table)?;
            outputs::write_text(&self.out.join(Self::MARKDOWN), &table.markdown())?;
        }
        let plot = self.out.join(Self::PLOT);
        write_png(&plot, &picture(&table)?)?;
        let files = format!("{}\n{}", self.out.join(Self::JSON).display(), plot.display());
        self.json.print(&table, &format!("{table}{files}"))?;
        Ok(Outcome::Done)
    }

    fn run_of<'a>(&self, turn: f64, config: &'a Config) -> MeasuredRun<'a> {
        MeasuredRun { name: format!("{turn} degrees"), folder: self.out.join(format!("turn-{turn}")), config }
    }

    /// Refuses a folder with anything else in it, or with runs of other settings.
    fn refuse_other_folders(&self, runs: &[(f64, MeasuredRun)]) -> anyhow::Result<()> {
        if outputs::is_new_or_empty(&self.out)? {
            return Ok(());
        }
        for entry in std::fs::read_dir(&self.out).with_context(|| self.out.display().to_string())? {
            let name = entry?.file_name();
            let own = [Self::JSON, Self::MARKDOWN, Self::PLOT];
            let is_run = runs.iter().any(|(_, run)| run.folder.file_name() == Some(&name));
            // A call that was killed may have left a partial file.
            let is_partial = name.to_string_lossy().starts_with(".partial-");
            if !is_partial && !is_run && !own.iter().any(|own| name == *own) {
                bail!("{}: the folder is not empty, and not of these turns; give a new --out", self.out.display());
            }
        }
        runs.iter().try_for_each(|(_, run)| run.refuse_other_settings())
    }
}

/// The chamfer distances of the table as lines.
fn picture(table: &FusionTable) -> xavatar::formats::Result<RgbImage> {
    let parts = [("all", None), ("hands", Some(Role::Hands)), ("face", Some(Role::Face))];
    let has = |role: Role| table.rows.iter().any(|row| row.mean.by_role.contains_key(&role));
    let series = parts.into_iter().filter(|(_, role)| role.is_none_or(has)).map(|(name, role)| Series {
        name: name.into(),
        points: table
            .rows
            .iter()
            .map(|row| (row.turn, role.map_or(row.mean.all, |role| row.mean.of(role))))
            .map(|(turn, metrics)| (turn, metrics.map_or(f64::NAN, |metrics| metrics.cd_mm)))
            .collect(),
    });
    let plot = Plot {
        title: "Error by the part of the turn that the camera saw".into(),
        x_label: "turn, degrees".into(),
        y_label: "CD, mm".into(),
        from_zero: true,
        series: series.collect(),
        size: (800, 500),
    };
    plot.draw()
}

fn degrees(text: &str) -> Result<f64, String> {
    let turn: f64 = text.trim().parse().map_err(|_| "expected a number of degrees")?;
    if turn > 0.0 && turn <= 3600.0 { Ok(turn) } else { Err("expected more than 0 degrees".into()) }
}
