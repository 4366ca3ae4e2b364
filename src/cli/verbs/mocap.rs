//! `xavatar mocap`: from scans alone to the motion in them.

use std::path::PathBuf;

use xavatar::register::job::REPORT_FILE;

use super::register::stopped;
use crate::cli::Outcome;
use crate::cli::options::scans::ScanArguments;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;

/// Capture the motion of scans without markers: a motion file for every sequence, which other verbs take
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar mocap scans --body models/smplx --models mediapipe-0.10.14.whl --fps 30 --out motions\n  \
    xavatar mocap scans --body models/smplx --landmarks landmarks.json --out motions\n  \
    xavatar animate runs/00016 motions/Take1.npz --body models/smplx --out animation\n\n\
    As register, but what is left are poses alone, in our own format of docs/motion.md. Frames that do not fit are named, and lie between\n\
    their neighbours in the motion; the exit code is 1 if more than a fifth does not fit.")]
pub struct Mocap {
    #[command(flatten)]
    scans: ScanArguments,
    /// The folder for the motions: new or empty, unless it is resumed
    #[arg(long, value_name = "MOTIONS")]
    out: PathBuf,
    /// Go on with the capture in MOTIONS
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    json: JsonArgument,
}

impl Mocap {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        files::new_or_resumed(&self.out, self.resume)?;
        let scans = self.scans.open(&[])?;
        let mut progress = Progress::new();
        let captured = scans.registered(&self.out, &mut progress, |job, observe, stop| job.capture(observe, stop))?;
        progress.finish();
        let Some((report, motions)) = captured else { return Ok(stopped()) };
        let report_file = self.out.join(REPORT_FILE);
        let written: Vec<String> =
            motions.iter().chain([&report_file]).map(|file| file.display().to_string()).collect();
        self.json.print(&report, &format!("{report}{}\n", written.join("\n")))?;
        Ok(if report.is_fit() { Outcome::Done } else { Outcome::Unfit })
    }
}
