//! `xavatar check`: reads a subject before it is trained, and says what would go wrong.

use std::fmt::{self, Formatter};
use std::sync::Mutex;

use serde::Serialize;
use xavatar::data::{
    CheckReport, DistanceReport, Finding, RgbdCheckReport, RgbdSubject, SequenceReport, Subject, UnusableFrame, check,
    check_rgbd,
};
use xavatar::register::job::score_registration;

use crate::cli::options::inputs::{SubjectArguments, load_body};
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, option};

/// Report what would go wrong in training: frames, units, places, distances, conventions, broken scans
///
/// Looks at the scans and at the RGB-D frames, whichever there are.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar check data/00016 --body models/smplx\n  \
    xavatar check data/anna --body models/smplx --fix\n  \
    xavatar check data/anna --body models/smplx --registration\n\n\
    Exits with 1 if training would fail: from scans if there are any, else from RGB-D frames.\n\
    Each finding has a name; `xavatar train --accept NAME` trains in spite of it.")]
pub struct Check {
    #[command(flatten)]
    subject: SubjectArguments,
    /// Where one unit, turn, mirror or shift brings all scans onto their bodies, or the person has to be told from ground, record it in
    /// DATA/mended.toml, which every verb applies as it reads the scans, and check again. No file of the data is changed
    #[arg(long)]
    fix: bool,
    /// Score the registrations instead: how far each body lies from its scan, clothes counted, part by part, the worst frames first
    #[arg(long, conflicts_with = "fix")]
    registration: bool,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was found of each kind of frames.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    scans: Option<CheckReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rgbd: Option<RgbdCheckReport>,
}

impl Check {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        if self.registration {
            return self.score_registration();
        }
        let has_pictures = RgbdSubject::is_in(&self.subject.data);
        let has_scans = || Subject::open(&self.subject.data).is_ok_and(|subject| subject.has_scans());
        let scans = if !has_pictures || has_scans() { Some(self.check_scans()?) } else { None };
        let scans = match scans {
            Some(report) if self.fix => Some(self.mended(report)?),
            scans => scans,
        };
        let rgbd = if has_pictures { Some(self.check_rgbd()?) } else { None };
        let report = Report { scans, rgbd };
        self.json.print(&report, &report)?;
        Ok(if report.is_fit() { Outcome::Done } else { Outcome::Unfit })
    }

    fn score_registration(&self) -> anyhow::Result<Outcome> {
        let opened = self.subject.open()?;
        let mut progress = Progress::new();
        let mut observe = |phase, share, message: &str| progress.show(phase, share, message);
        let report = score_registration(&opened.subject, &opened.body, &opened.labels, &mut observe)?;
        progress.finish();
        self.json.print(&report, &report)?;
        Ok(if report.is_fit() { Outcome::Done } else { Outcome::Unfit })
    }

    fn check_scans(&self) -> anyhow::Result<CheckReport> {
        let opened = self.subject.open()?;
        let total = opened.subject.train.len() + opened.subject.test.len();
        with_progress("scans", total, |done| Ok(check(&opened.subject, &opened.body, &opened.labels, done)?))
    }

    /// Records what mends the scans, if it is one placement, and checks them again.
    fn mended(&self, found: CheckReport) -> anyhow::Result<CheckReport> {
        let Some(placement) = found.mend else {
            log::info!(
                "nothing to record: no unit, turn, mirror or shift mends all scans, and they show the person alone"
            );
            return Ok(found);
        };
        found.problems.iter().for_each(|problem| log::info!("found: {problem}"));
        log::info!("recorded in {}", placement.write(&self.subject.data)?.display());
        self.check_scans()
    }

    fn check_rgbd(&self) -> anyhow::Result<RgbdCheckReport> {
        let subject = RgbdSubject::open(&self.subject.data)?;
        let (body, labels) = load_body(&self.subject.body, subject.gender)?;
        let total = subject.train.len() + subject.test.len();
        with_progress("pictures", total, |done| Ok(check_rgbd(&subject, &body, &labels, done)?))
    }
}

impl Report {
    /// Whether what `train` would choose can be trained on.
    fn is_fit(&self) -> bool {
        match (&self.scans, &self.rgbd) {
            (Some(scans), _) => scans.is_fit(),
            (None, Some(rgbd)) => rgbd.problems.is_empty(),
            (None, None) => true,
        }
    }
}

/// Runs a check that says when each of `total` frames is done.
fn with_progress<T>(
    name: &'static str,
    total: usize,
    run: impl FnOnce(&(dyn Fn() + Sync)) -> xavatar::Result<T>,
) -> anyhow::Result<T> {
    let progress = Mutex::new((0, Progress::new()));
    let report = run(&|| {
        if let Ok(mut shown) = progress.lock() {
            shown.0 += 1;
            let done = shown.0;
            shown.1.show(name, done as f64 / total as f64, &format!("{done} of {total} read"));
        }
    })?;
    if let Ok((_, progress)) = progress.into_inner() {
        progress.finish();
    }
    Ok(report)
}

/// The report in lines to read.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.scans.iter().try_for_each(|report| write_scans(f, report))?;
        self.rgbd.iter().try_for_each(|report| write_rgbd(f, report))
    }
}

fn write_scans(f: &mut Formatter<'_>, report: &CheckReport) -> fmt::Result {
    writeln!(f, "subject            {}, {:.2} m; {}", report.gender, report.body_height, report.layout)?;
    writeln!(f, "part labels        {}", report.part_labels)?;
    write_sequences(f, &report.sequences)?;
    writeln!(
        f,
        "inspected          {} scans, {} watertight, {} with colours",
        report.inspected_frames, report.watertight_scans, report.coloured_scans
    )?;
    if let Some(ratio) = report.scan_to_body_height {
        writeln!(f, "scan : body height {ratio:.3}")?;
    }
    if let Some(hands) = report.hands {
        writeln!(
            f,
            "hands to scan      {:.1} mm as offsets from the mean hand, {:.1} mm as absolute rotations",
            hands.relative_to_mean_mm, hands.flat_mm
        )?;
    }
    write_distances(f, "scan to body", report.distances.iter())?;
    write_verdict(f, "ready to train", &report.unusable, &report.warnings, &report.problems)
}

fn write_rgbd(f: &mut Formatter<'_>, report: &RgbdCheckReport) -> fmt::Result {
    writeln!(f, "RGB-D of           {}, {:.2} m", report.gender, report.body_height)?;
    writeln!(f, "part labels        {}", report.part_labels)?;
    write_sequences(f, &report.sequences)?;
    if let Some(points) = report.points {
        writeln!(f, "measured           {} frames of about {points} points", report.measured_frames)?;
    }
    if let Some(ratio) = report.depth_to_body {
        writeln!(f, "depth : body       {ratio:.3}")?;
    }
    write_distances(f, "points to vertices", report.distances.iter())?;
    write_verdict(f, "ready to train from RGB-D", &report.unusable, &report.warnings, &report.problems)
}

fn write_sequences(f: &mut Formatter<'_>, sequences: &[SequenceReport]) -> fmt::Result {
    for sequence in sequences {
        let name = format!("{}/{}", sequence.split, sequence.sequence);
        let unusable = match sequence.unusable {
            0 => String::new(),
            unusable => format!(", {unusable} unusable"),
        };
        writeln!(f, "{name:<18} {} frames{unusable}", sequence.frames)?;
    }
    Ok(())
}

fn write_distances<'a>(
    f: &mut Formatter<'_>,
    name: &str,
    distances: impl Iterator<Item = (&'a String, &'a DistanceReport)>,
) -> fmt::Result {
    writeln!(f, "{name:<18} {:>10} {:>10}", "median", "95 %")?;
    for (part, distance) in distances {
        writeln!(f, "  {part:<16} {:>7.1} mm {:>7.1} mm", distance.median_mm, distance.percentile_95_mm)?;
    }
    Ok(())
}

fn write_finding(f: &mut Formatter<'_>, kind: &str, Finding { name, message, choice, .. }: &Finding) -> fmt::Result {
    let advice = choice.map_or_else(String::new, |choice| format!(" ({})", option(choice)));
    writeln!(f, "{kind} ({name}): {message}{advice}")
}

fn write_verdict(
    f: &mut Formatter<'_>,
    ready: &str,
    unusable: &[UnusableFrame],
    warnings: &[Finding],
    problems: &[Finding],
) -> fmt::Result {
    for frame in unusable {
        writeln!(f, "unusable: {}: {}", frame.frame, frame.reason)?;
    }
    for warning in warnings {
        write_finding(f, "warning", warning)?;
    }
    for problem in problems {
        write_finding(f, "problem", problem)?;
    }
    writeln!(f, "{}{ready}", if problems.is_empty() { "" } else { "not " })
}
