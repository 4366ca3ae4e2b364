//! `xavatar fuse`: how the error falls as the camera sees more of the turn, in one table and a figure.

use std::path::PathBuf;

use xavatar::body::Role;
use xavatar::config::Config;
use xavatar::data::{RgbdSubject, Source};
use xavatar::report::LineFigure;
use xavatar::runs::{Batch, Run, RunRow, RunTable, SomeCaptures, Turn, Yardstick, turned};
use xavatar::train::TrainingSpec;

use crate::cli::options::captured::Kind;
use crate::cli::options::inputs::{Registered, Split, SubjectArguments};
use crate::cli::options::training::TrainingArguments;
use crate::cli::output::files::write_text;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::measured_run::finish;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, WrongUsage, stop};

/// Train on more and more of the camera's turn around the subject, and measure how the error falls
///
/// Needs RGB-D frames to train on and scans to measure with. The turn of each sequence begins at its first frame.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar fuse data/00016 --body models/smplx --out runs/fusion --minutes 3\n  \
    xavatar fuse data/00016 --body models/smplx --out runs/views --turns 90,180,360 --equal-frames --minutes 3\n\n\
    Writes fusion.json, fusion.md and fusion.svg, and a run's folder a row. The same call again goes on where one was stopped.")]
pub struct Fuse {
    #[command(flatten)]
    subject: SubjectArguments,
    /// The folder for the runs, the table and the figure: new, empty, or that of the same call before
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
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = crate::cli::options::meshes::resolution)]
    resolution: usize,
    #[command(flatten)]
    json: JsonArgument,
}

impl Fuse {
    const FIGURE: &str = "fusion.svg";

    pub fn run(mut self) -> anyhow::Result<Outcome> {
        self.turns.sort_by(f64::total_cmp);
        self.turns.dedup();
        let preset = Kind::Rgbd.preset(self.training.preset());
        let config = Config::preset_with(preset, &self.training.settings()).map_err(WrongUsage::from)?;
        let runs: Vec<_> = self.turns.iter().map(|turn| (folder_of(*turn), &config)).collect();
        self.json.check()?;
        let Registered { subject, body, labels } = self.subject.open()?;
        let source = RgbdSubject::open(&self.subject.data)?.training_frames();
        let batch = Batch::open(&self.out, "fusion", &runs, &[Self::FIGURE])?;
        let stop = stop::on_interrupt()?;
        let split = self.split.into();
        let yardstick = Yardstick { scans: &subject.frames(split), split, resolution: self.resolution };
        let mut progress = Progress::new();
        let total = source.ids().len();
        let picture = |index: usize| source.picture(index);
        let turned = turned(source.ids(), picture, |done| {
            progress.show("cameras", done as f64 / total as f64, &format!("{done} of {total} read"));
        })?;
        progress.finish();
        let smallest = SomeCaptures::within(&source, &turned, self.turns[0], None)?.ids().len();
        let mut table = RunTable::default();
        for &turn in &self.turns {
            let captures = SomeCaptures::within(&source, &turned, turn, self.equal_frames.then_some(smallest))?;
            let spec = TrainingSpec { config: &config, source: &captures, body: &body, labels: &labels };
            let run = Run::open(&batch.folder_of(&folder_of(turn)), spec)?;
            let Some(metrics) = finish(&run, &format!("{turn} degrees"), &yardstick, stop)? else {
                log::info!("stopped; the same command again goes on");
                return Ok(Outcome::Stopped);
            };
            table.rows.push(RunRow { key: Turn { turn, trained_on: captures.ids().len() }, metrics });
            batch.write(&table)?;
        }
        let figure = self.out.join(Self::FIGURE);
        write_text(&figure, &figure_of(&table).svg()?)?;
        let files = format!("{}\n{}", batch.json().display(), figure.display());
        self.json.print(&table, &format!("{table}{files}"))?;
        Ok(Outcome::Done)
    }
}

fn folder_of(turn: f64) -> String {
    format!("turn-{turn}")
}

/// The chamfer distances of the table as lines.
fn figure_of(table: &RunTable<Turn>) -> LineFigure {
    let parts = [("all", None), ("hands", Some(Role::Hands)), ("face", Some(Role::Face))];
    let has = |role: Role| table.rows.iter().any(|row| row.metrics.mean.by_role.contains_key(&role));
    let error = |row: &RunRow<Turn>, role: Option<Role>| {
        let mean = &row.metrics.mean;
        role.map_or(mean.all, |role| mean.of(role)).map_or(f64::NAN, |metrics| metrics.cd_mm)
    };
    let line = |(name, role): (&str, Option<Role>)| {
        let points = table.rows.iter().map(|row| (row.key.turn, error(row, role)));
        (name.to_owned(), points.collect())
    };
    LineFigure {
        title: "Error by the part of the turn that the camera saw".into(),
        axes: "turn, degrees; CD, mm".into(),
        lines: parts.into_iter().filter(|(_, role)| role.is_none_or(has)).map(line).collect(),
    }
}

fn degrees(text: &str) -> Result<f64, String> {
    let turn: f64 = text.trim().parse().map_err(|_| "expected a number of degrees")?;
    if turn > 0.0 && turn <= 3600.0 { Ok(turn) } else { Err("expected more than 0 degrees".into()) }
}
