//! `xavatar check`: reads a subject before it is trained, and says what would go wrong.

use std::fmt;
use std::sync::Mutex;

use xavatar::data::{CheckReport, check};

use super::Outcome;
use super::inputs::SubjectArguments;
use super::json::JsonArgument;
use super::progress::Progress;

/// Report what would go wrong in training: frames, sizes, distances, conventions
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  xavatar check data/00016 --body models/smplx\n\nExits with 1 if training would fail."
)]
pub struct Check {
    #[command(flatten)]
    subject: SubjectArguments,
    #[command(flatten)]
    json: JsonArgument,
}

impl Check {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
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
        self.json.print(&report, &Table(&report))?;
        Ok(if report.problems.is_empty() { Outcome::Done } else { Outcome::Unfit })
    }
}

/// The report in lines to read.
struct Table<'a>(&'a CheckReport);

impl fmt::Display for Table<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.0;
        writeln!(formatter, "subject            {}, {:.2} m", report.gender, report.body_height)?;
        writeln!(formatter, "part labels        {}", report.part_labels)?;
        for sequence in &report.sequences {
            let name = format!("{}/{}", sequence.split, sequence.sequence);
            let unusable = match sequence.unusable {
                0 => String::new(),
                unusable => format!(", {unusable} unusable"),
            };
            writeln!(formatter, "{name:<18} {} frames{unusable}", sequence.frames)?;
        }
        writeln!(
            formatter,
            "measured           {} frames, {} watertight",
            report.measured_frames, report.watertight_scans
        )?;
        if let Some(ratio) = report.scan_to_body_height {
            writeln!(formatter, "scan : body height {ratio:.3} ({})", report.scan_unit.unwrap_or("of no known unit"))?;
        }
        if let Some(hands) = report.hands {
            writeln!(
                formatter,
                "hands to scan      {:.1} mm as offsets from the mean hand, {:.1} mm as absolute rotations",
                hands.relative_to_mean_mm, hands.flat_mm
            )?;
        }
        writeln!(formatter, "scan to body       {:>10} {:>10}", "median", "95 %")?;
        for (part, distance) in &report.distances {
            writeln!(formatter, "  {part:<16} {:>7.1} mm {:>7.1} mm", distance.median_mm, distance.percentile_95_mm)?;
        }
        for frame in &report.unusable {
            writeln!(formatter, "unusable: {}: {}", frame.frame, frame.reason)?;
        }
        for warning in &report.warnings {
            writeln!(formatter, "warning: {warning}")?;
        }
        for problem in &report.problems {
            writeln!(formatter, "problem: {problem}")?;
        }
        writeln!(formatter, "{}", if report.problems.is_empty() { "ready to train" } else { "not ready to train" })
    }
}
