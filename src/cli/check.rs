//! `xavatar check`: reads a subject before it is trained, and says what would go wrong.

use std::path::PathBuf;
use std::sync::Mutex;

use xavatar::data::{CheckReport, check};

use super::inputs::SubjectArguments;
use super::progress::Progress;
use super::{Outcome, outputs};

/// Report what would go wrong in training: frames, sizes, distances, conventions
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  xavatar check data/00016 --body models/smplx\n\nExits with 1 if training would fail."
)]
pub struct Check {
    #[command(flatten)]
    subject: SubjectArguments,
    /// Write the report as JSON too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Check {
    pub fn run(self) -> anyhow::Result<Outcome> {
        if let Some(json) = &self.json {
            outputs::new_file(json)?;
        }
        let opened = self.subject.open()?;
        let total = opened.subject.train.len() + opened.subject.test.len();
        let progress = Mutex::new((0, Progress::new()));
        let report = check(&opened.subject, &opened.body, &opened.labels, &|| {
            if let Ok(mut shown) = progress.lock() {
                shown.0 += 1;
                let done = shown.0;
                shown.1.show("frames", done as f64 / total as f64, &format!("{done} of {total} read"));
            }
        })?;
        if let Ok((_, progress)) = progress.into_inner() {
            progress.finish();
        }
        print_report(&report);
        if let Some(json) = &self.json {
            outputs::write_json(json, &report)?;
        }
        Ok(if report.problems.is_empty() { Outcome::Done } else { Outcome::Unfit })
    }
}

fn print_report(report: &CheckReport) {
    println!("subject            {}, {:.2} m", report.gender, report.body_height);
    println!("part labels        {}", report.part_labels);
    for sequence in &report.sequences {
        let name = format!("{}/{}", sequence.split, sequence.sequence);
        let unusable = match sequence.unusable {
            0 => String::new(),
            unusable => format!(", {unusable} unusable"),
        };
        println!("{name:<18} {} frames{unusable}", sequence.frames);
    }
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
    println!("scan to body       {:>10} {:>10}", "median", "95 %");
    for (part, distance) in &report.distances {
        println!("  {part:<16} {:>7.1} mm {:>7.1} mm", distance.median_mm, distance.percentile_95_mm);
    }
    for frame in &report.unusable {
        println!("unusable: {}: {}", frame.frame, frame.reason);
    }
    for warning in &report.warnings {
        println!("warning: {warning}");
    }
    for problem in &report.problems {
        println!("problem: {problem}");
    }
    println!("{}", if report.problems.is_empty() { "ready to train" } else { "not ready to train" });
}
