//! How far all subjects are: a table for people, scripts and spreadsheets, and a page that leads to every subject's own.

use std::fmt;
use std::io::Write;
use std::time::Duration;

use serde::Serialize;

use super::folder::{State, SubjectFolder};
use super::manifest::Manifest;
use super::page;
use super::plan::Stage;
use crate::{InputError, Result};
use xavatar_formats::{FolderLock, Shown, create_folder, write_atomically};

/// The tables in the folder of all: for scripts, for spreadsheets.
pub const TABLE_FILES: [&str; 2] = ["subjects.json", "subjects.csv"];
/// The page in the folder of all.
pub const INDEX_FILE: &str = "index.html";
/// How often it is tried to be the one who writes the tables, and the time between.
const TURNS: usize = 200;
const TURN: Duration = Duration::from_millis(50);

/// One subject.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryRow {
    /// Its name.
    pub name: String,
    /// How far it is.
    #[serde(flatten)]
    pub state: State,
}

/// How many subjects there are of each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Totals {
    /// All of them.
    pub subjects: usize,
    /// Those whose work is complete.
    pub done: usize,
    /// Those that failed.
    pub failed: usize,
    /// Those that a process works on.
    pub running: usize,
    /// Those that were begun and are nobody's now.
    pub stopped: usize,
    /// Those that nobody has begun.
    pub waiting: usize,
}

/// How far all subjects are. `Display` prints the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// How many there are of each state.
    pub totals: Totals,
    /// One row a subject, in the manifest's order.
    pub subjects: Vec<SummaryRow>,
}

/// A row of the spreadsheet; what is not known is empty.
#[derive(Default, Serialize)]
struct Cells<'a> {
    name: &'a str,
    state: &'static str,
    steps: Option<u64>,
    seconds_per_step: Option<f64>,
    register_seconds: Option<f64>,
    train_seconds: Option<f64>,
    eval_seconds: Option<f64>,
    export_seconds: Option<f64>,
    frames: Option<usize>,
    cd_mm: Option<f64>,
    nc: Option<f64>,
    iou: Option<f64>,
    reason: &'a str,
}

impl Summary {
    /// How far the subjects of a manifest are now.
    ///
    /// # Errors
    /// As [`SubjectFolder::state`].
    pub fn of(manifest: &Manifest) -> Result<Self> {
        let row = |plan| -> Result<SummaryRow> {
            let state = SubjectFolder::new(&manifest.out, plan).state(plan)?;
            Ok(SummaryRow { name: plan.name.clone(), state })
        };
        let subjects: Vec<SummaryRow> = manifest.subjects.iter().map(row).collect::<Result<_>>()?;
        let mut totals = Totals { subjects: subjects.len(), ..Totals::default() };
        for row in &subjects {
            *match row.state {
                State::Waiting => &mut totals.waiting,
                State::Running { .. } => &mut totals.running,
                State::Stopped => &mut totals.stopped,
                State::Failed { .. } => &mut totals.failed,
                State::Done(_) => &mut totals.done,
            } += 1;
        }
        Ok(Self { totals, subjects })
    }

    /// Writes the tables and the page of the state as it is now. Of several processes that end together, the last to write sees all others'
    /// work: each looks and writes while it holds the folder.
    ///
    /// # Errors
    /// If a file cannot be written, or the folder stays another's for seconds.
    pub fn write(manifest: &Manifest) -> Result<Self> {
        create_folder(&manifest.out)?;
        let mut lock = FolderLock::take(&manifest.out);
        for _ in 0..TURNS {
            if lock.is_ok() || FolderLock::holder(&manifest.out)?.is_none() {
                break;
            }
            std::thread::sleep(TURN);
            lock = FolderLock::take(&manifest.out);
        }
        let _lock = lock.or_else(|_| FolderLock::take(&manifest.out))?;
        let summary = Self::of(manifest)?;
        let [json, csv] = TABLE_FILES.map(|file| manifest.out.join(file));
        let text = serde_json::to_string_pretty(&summary).map_err(|error| InputError::io(&json)(error.into()))?;
        write_atomically(&json, |file| writeln!(file, "{text}"))?;
        write_atomically(&csv, |file| summary.write_csv(file))?;
        let html = page::html(manifest, &summary)?;
        write_atomically(&manifest.out.join(INDEX_FILE), |file| file.write_all(html.as_bytes()))?;
        Ok(summary)
    }

    fn write_csv(&self, file: &mut impl Write) -> std::io::Result<()> {
        let mut writer = csv::Writer::from_writer(file);
        for row in &self.subjects {
            writer.serialize(row.cells())?;
        }
        writer.flush()
    }
}

impl State {
    /// In one word.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running { .. } => "running",
            Self::Stopped => "stopped",
            Self::Failed { .. } => "failed",
            Self::Done(_) => "done",
        }
    }

    /// What else there is to say: why it failed, or who works on it.
    pub(super) fn words(&self) -> &str {
        match self {
            Self::Failed { reason } => reason,
            Self::Running { holder } => holder,
            _ => "",
        }
    }
}

impl SummaryRow {
    fn cells(&self) -> Cells<'_> {
        let (name, state, reason) = (self.name.as_str(), self.state.name(), self.state.words());
        let State::Done(mark) = &self.state else { return Cells { name, state, reason, ..Cells::default() } };
        let seconds = |stage: Stage| mark.seconds.get(&stage).copied();
        let all = mark.metrics.as_ref().and_then(|metrics| metrics.mean.all);
        Cells {
            name,
            state,
            reason,
            steps: mark.steps,
            seconds_per_step: mark.metrics.as_ref().and_then(|metrics| metrics.seconds_per_step),
            register_seconds: seconds(Stage::Register),
            train_seconds: seconds(Stage::Train),
            eval_seconds: seconds(Stage::Evaluate),
            export_seconds: seconds(Stage::Export),
            frames: mark.metrics.as_ref().map(|metrics| metrics.frames),
            cd_mm: all.map(|all| all.cd_mm),
            nc: all.map(|all| all.nc),
            iou: all.map(|all| all.iou),
        }
    }
}

impl Totals {
    /// Each state's name and number, but for those of which there is none.
    pub(super) fn named(self) -> impl Iterator<Item = (&'static str, usize)> {
        let Self { done, failed, running, stopped, waiting, .. } = self;
        let all =
            [("done", done), ("failed", failed), ("running", running), ("stopped", stopped), ("waiting", waiting)];
        all.into_iter().filter(|(_, count)| *count > 0)
    }
}

impl fmt::Display for Totals {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named: Vec<_> = self.named().map(|(name, count)| format!("{count} {name}")).collect();
        let plural = if self.subjects == 1 { "" } else { "s" };
        write!(formatter, "{} subject{plural}: {}", self.subjects, named.join(", "))
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.subjects.iter().map(|row| row.name.len()).max().unwrap_or_default().max("subject".len());
        writeln!(formatter, "{:width$} state     steps  CD mm     NC    IoU  hours", "subject")?;
        let number = |value: Option<f64>, digits: usize| value.map_or("-".into(), |value| format!("{value:.digits$}"));
        for row in &self.subjects {
            let cells = row.cells();
            let hours = match &row.state {
                State::Done(mark) => Some(mark.seconds.values().sum::<f64>() / 3600.0),
                _ => None,
            };
            let steps = cells.steps.map_or("-".into(), |steps| steps.to_string());
            let (distance, normals, overlap) = (number(cells.cd_mm, 2), number(cells.nc, 3), number(cells.iou, 3));
            write!(
                formatter,
                "{:width$} {:8} {steps:>6} {distance:>6} {normals:>6} {overlap:>6} {:>6}",
                cells.name,
                cells.state,
                number(hours, 2)
            )?;
            writeln!(formatter, "{}{}", if cells.reason.is_empty() { "" } else { "  " }, Shown(cells.reason))?;
        }
        write!(formatter, "{}", self.totals)
    }
}
