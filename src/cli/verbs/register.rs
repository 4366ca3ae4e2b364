//! `xavatar register`: from scans, or a depth camera's pictures, alone to data that can be trained on.

use std::path::{Path, PathBuf};

use xavatar::register::job::{REPORT_FILE, Recordings};
use xavatar::register::landmarks::LANDMARKS_FILE;
use xavatar::report::{REGISTRATION_PAGE, write_registration_page};

use crate::cli::options::captured::Kind;
use crate::cli::options::inputs::SubjectArguments;
use crate::cli::options::scans::ScanArguments;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::output::report::command_line;
use crate::cli::{Outcome, wrong_usage};

/// Register a body model to scans, or to a depth camera's pictures: poses, shape and clothing, as data to train on
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar register scans --body models/smplx --models mediapipe-0.10.14.whl --out data\n  \
    xavatar register scans --body models/smplx --landmarks landmarks.json --out data\n  \
    xavatar register scans --body models/smplx --geometry-only --out data\n  \
    xavatar register scans --body models/smplx --landmarks openpose --take Take3=test --out data\n  \
    xavatar register scans --body models/smplx --geometry-only --start gvhmr.pt --out data\n  \
    xavatar register --rgbd pictures --body models/smplx --models mediapipe-0.10.14.whl --out data\n\n\
    SCANS is a folder of meshes, with a folder for every sequence, or any layout of docs/formats.md; registrations in it are not looked\n\
    at. Landmarks: docs/registration.md. Frames that do not fit are left out of DATA and named; the exit code is 1 if more than a fifth\n\
    is. Ctrl-C stops after the frame; --resume goes on, and ends with the same files to the bit.")]
pub struct Register {
    #[command(flatten)]
    scans: ScanArguments,
    /// The folder for the data: new or empty, unless it is resumed
    #[arg(long, value_name = "DATA")]
    out: PathBuf,
    /// A sequence that is for tests, as NAME=test; may be given again [default: folders train and test; else the last of several]
    #[arg(long = "take", value_name = "NAME=test", value_parser = test_sequence)]
    test: Vec<String>,
    /// Also write each body moved vertex by vertex onto its scan, clothes and all, to DATA/offsets
    #[arg(long)]
    offsets: bool,
    /// Go on with the registration in DATA
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    json: JsonArgument,
}

impl Register {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        if self.scans.is_rgbd() && self.offsets {
            wrong_usage!(
                "--offsets moves bodies onto whole surfaces, of which a depth camera sees one side: leave it out"
            );
        }
        files::new_or_resumed(&self.out, self.resume)?;
        let mut scans = self.scans.open(&self.test)?;
        scans.offsets = self.offsets;
        let mut progress = Progress::new();
        let registered = scans.registered(&self.out, &mut progress, |job, observe, stop| job.run(observe, stop))?;
        progress.finish();
        let (data, body) = (self.out.display(), self.scans.body.display());
        let Some(report) = registered else { return Ok(stopped()) };
        write_registration_page(&self.out, &report, &scans.body, command_line())?;
        let files = [REPORT_FILE, REGISTRATION_PAGE].map(|file| self.out.join(file).display().to_string());
        self.json.print(&report, &format!("{report}{}\n", files.join("\n")))?;
        log::info!(
            "try next\n  xavatar check {data} --body {body}\n  xavatar train {data} --body {body} --out runs/avatar --minutes 3"
        );
        Ok(if report.is_fit() { Outcome::Done } else { Outcome::Unfit })
    }
}

pub fn stopped() -> Outcome {
    log::info!("stopped; the same command with --resume goes on");
    Outcome::Stopped
}

/// Registers the scans or pictures in `data` if no body is registered to them: into the folder beside the run's, which later calls take
/// as it is. Landmarks are those of `landmarks.json` among them; without, people are found by the shapes that they show. Returns where
/// the data are; none if the registration was stopped.
pub fn registered_first(
    SubjectArguments { data, body }: &SubjectArguments,
    kind: Kind,
    run: &Path,
    models: Option<PathBuf>,
) -> anyhow::Result<Option<PathBuf>> {
    let Some(recordings) = Recordings::without_bodies(data, kind.into())? else { return Ok(Some(data.into())) };
    let what = match kind {
        Kind::Scans => "scans",
        Kind::Rgbd => "pictures",
    };
    let mut name = run.file_name().unwrap_or_default().to_os_string();
    name.push("-registered");
    let out = run.with_file_name(name);
    if out.join(REPORT_FILE).is_file() {
        log::info!("the registration of these {what} is in {}", out.display());
        return Ok(Some(out));
    }
    let landmarks = data.join(LANDMARKS_FILE);
    let landmarks = Some(landmarks).filter(|landmarks| models.is_none() && landmarks.is_file());
    let how = match (&models, &landmarks) {
        (Some(_), _) => "by landmarks found in pictures of them",
        (None, Some(_)) => "by landmarks.json",
        (None, None) => "by the shapes they show",
    };
    log::info!("no body is registered to these {what}: registering one {how}, into {}", out.display());
    let register = Register {
        scans: ScanArguments::new((recordings.folder().into(), kind), body.clone(), landmarks, models),
        out: out.clone(),
        test: Vec::new(),
        offsets: false,
        resume: true,
        json: JsonArgument::default(),
    };
    match register.run()? {
        Outcome::Stopped => Ok(None),
        Outcome::Done => Ok(Some(out)),
        Outcome::Unfit => {
            anyhow::bail!(
                "{}: too few frames could be registered; see {REGISTRATION_PAGE} in it, and give landmarks",
                out.display()
            )
        }
    }
}

fn test_sequence(text: &str) -> Result<String, String> {
    let name = text.strip_suffix("=test").filter(|name| !name.is_empty());
    name.map(str::to_owned).ok_or_else(|| "expected NAME=test".into())
}
