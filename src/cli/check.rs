//! `xavatar check`: reads a subject before it is trained, and says what would go wrong.

use std::path::PathBuf;
use std::sync::Mutex;

use serde::Serialize;
use xavatar::data::{
    CheckReport, DistanceReport, RgbdCheckReport, RgbdSubject, SequenceReport, Subject, UnusableFrame, check,
    check_rgbd,
};

use super::inputs::{SubjectArguments, load_body};
use super::progress::Progress;
use super::{Outcome, outputs};

/// Report what would go wrong in training: frames, sizes, units, distances, conventions
///
/// Looks at the scans and at the RGB-D frames, whichever there are.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  xavatar check data/00016 --body models/smplx\n\n\
    Exits with 1 if training would fail: from scans if there are any, else from RGB-D frames.")]
pub struct Check {
    #[command(flatten)]
    subject: SubjectArguments,
    /// Write the report as JSON too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
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
        if let Some(json) = &self.json {
            outputs::new_file(json)?;
        }
        let has_pictures = RgbdSubject::is_in(&self.subject.data);
        let has_scans = || {
            let subject = Subject::open(&self.subject.data);
            subject.is_ok_and(|subject| subject.train.iter().chain(&subject.test).any(|files| files.scan.is_file()))
        };
        let scans = if !has_pictures || has_scans() { Some(self.check_scans()?) } else { None };
        let rgbd = if has_pictures { Some(self.check_rgbd()?) } else { None };
        if let Some(report) = &scans {
            print_report(report);
        }
        if let Some(report) = &rgbd {
            print_rgbd_report(report);
        }
        let is_fit = match (&scans, &rgbd) {
            (Some(scans), _) => scans.problems.is_empty(),
            (None, Some(rgbd)) => rgbd.problems.is_empty(),
            (None, None) => true,
        };
        if let Some(json) = &self.json {
            outputs::write_json(json, &Report { scans, rgbd })?;
        }
        Ok(if is_fit { Outcome::Done } else { Outcome::Unfit })
    }

    fn check_scans(&self) -> anyhow::Result<CheckReport> {
        let opened = self.subject.open()?;
        let total = opened.subject.train.len() + opened.subject.test.len();
        with_progress("scans", total, |done| check(&opened.subject, &opened.body, &opened.labels, done))
    }

    fn check_rgbd(&self) -> anyhow::Result<RgbdCheckReport> {
        let subject = RgbdSubject::open(&self.subject.data)?;
        let (body, labels) = load_body(&self.subject.body, subject.gender)?;
        let total = subject.train.len() + subject.test.len();
        with_progress("RGB-D frames", total, |done| check_rgbd(&subject, &body, &labels, done))
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

fn print_report(report: &CheckReport) {
    println!("subject            {}, {:.2} m", report.gender, report.body_height);
    println!("part labels        {}", report.part_labels);
    print_sequences(&report.sequences);
    println!("measured           {} frames, {} watertight", report.measured_frames, report.watertight_scans);
    if let Some(ratio) = report.scan_to_body_height {
        println!("scan : body height {ratio:.3} ({})", report.scan_unit.unwrap_or("of no known unit"));
    }
    if let Some(hands) = report.hands {
        println!(
            "hands to scan      {:.1} mm as offsets from the mean hand, {:.1} mm as absolute rotations",
            hands.relative_to_mean_mm, hands.flat_mm
        );
    }
    print_distances("scan to body", report.distances.iter());
    print_verdict("ready to train", &report.unusable, &report.warnings, &report.problems);
}

fn print_rgbd_report(report: &RgbdCheckReport) {
    println!("RGB-D of           {}, {:.2} m", report.gender, report.body_height);
    println!("part labels        {}", report.part_labels);
    print_sequences(&report.sequences);
    if let Some(points) = report.points {
        println!("measured           {} frames of about {points} points", report.measured_frames);
    }
    if let Some((ratio, height)) = report.depth_to_body.zip(report.apparent_height) {
        println!("depth : body       {ratio:.3} (a body {height:.4} m tall)");
    }
    print_distances("points to vertices", report.distances.iter());
    print_verdict("ready to train from RGB-D frames", &report.unusable, &report.warnings, &report.problems);
}

fn print_sequences(sequences: &[SequenceReport]) {
    for sequence in sequences {
        let name = format!("{}/{}", sequence.split, sequence.sequence);
        let unusable = match sequence.unusable {
            0 => String::new(),
            unusable => format!(", {unusable} unusable"),
        };
        println!("{name:<18} {} frames{unusable}", sequence.frames);
    }
}

fn print_distances<'a>(name: &str, distances: impl Iterator<Item = (&'a &'static str, &'a DistanceReport)>) {
    println!("{name:<18} {:>10} {:>10}", "median", "95 %");
    for (part, distance) in distances {
        println!("  {part:<16} {:>7.1} mm {:>7.1} mm", distance.median_mm, distance.percentile_95_mm);
    }
}

fn print_verdict(ready: &str, unusable: &[UnusableFrame], warnings: &[String], problems: &[String]) {
    for frame in unusable {
        println!("unusable: {}: {}", frame.frame, frame.reason);
    }
    for warning in warnings {
        println!("warning: {warning}");
    }
    for problem in problems {
        println!("problem: {problem}");
    }
    println!("{}{ready}", if problems.is_empty() { "" } else { "not " });
}
