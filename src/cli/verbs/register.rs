//! `xavatar register`: from scans alone to data that can be trained on.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use xavatar::body::Gender;
use xavatar::data::{Scans, Subject};
use xavatar::formats::read_npy;
use xavatar::landmarks::Models;
use xavatar::register::fit::Known;
use xavatar::register::job::{Job, REPORT_FILE, Up, find_landmarks};
use xavatar::register::landmarks::{LANDMARKS_FILE, LandmarkFiles};
use xavatar::report::{REGISTRATION_PAGE, write_registration_page};

use crate::cli::options::inputs::{SubjectArguments, load_body};
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::output::report::command_line;
use crate::cli::{Outcome, stop, wrong_usage};

/// Register a body model to scans: poses, shape and clothing, as data to train on
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar register scans --body models/smplx --models mediapipe-0.10.14.whl --out data\n  \
    xavatar register scans --body models/smplx --landmarks landmarks.json --out data\n  \
    xavatar register scans --body models/smplx --geometry-only --out data\n  \
    xavatar register scans --body models/smplx --landmarks openpose --take Take3=test --out data\n\n\
    SCANS is a folder of meshes, with a folder for every sequence, or any layout of docs/formats.md; registrations in it are not looked\n\
    at. Landmarks: docs/registration.md. Frames that do not fit are left out of DATA and named; the exit code is 1 if more than a fifth\n\
    is. Ctrl-C stops after the frame; --resume goes on, and ends with the same files to the bit.")]
pub struct Register {
    /// The folder of one person's scans
    #[arg(value_name = "SCANS")]
    scans: PathBuf,
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl
    #[arg(long, value_name = "BODY")]
    body: PathBuf,
    /// The folder for the data: new or empty, unless it is resumed
    #[arg(long, value_name = "DATA")]
    out: PathBuf,
    /// Landmarks in the scans' coordinates: a file, or a folder with a file a frame
    #[arg(long, value_name = "PATH", required_unless_present_any = ["geometry_only", "models"])]
    landmarks: Option<PathBuf>,
    /// MediaPipe's package, whose networks find the landmarks: its wheel of version 0.10.14, or a folder with it
    #[arg(long, value_name = "PACKAGE", conflicts_with = "landmarks")]
    models: Option<PathBuf>,
    /// Without landmarks: people who stand are found by the scans' shapes, and the frames near them from these
    #[arg(long, conflicts_with_all = ["landmarks", "models"])]
    geometry_only: bool,
    /// The subject's shape, ten coefficients as .npy, to be held fixed
    #[arg(long, value_name = "FILE")]
    shape: Option<PathBuf>,
    /// A sequence in tight or no clothes, which the shape is taken from
    #[arg(long, value_name = "SEQUENCE", conflicts_with = "shape")]
    minimal: Option<String>,
    /// A sequence that is for tests, as NAME=test; may be given again [default: folders train and test; else the last of several]
    #[arg(long = "take", value_name = "NAME=test", value_parser = test_sequence)]
    test: Vec<String>,
    /// The axis of the scans' files that points up
    #[arg(long, value_enum, default_value_t = UpAxis::Y, allow_hyphen_values = true)]
    up: UpAxis,
    /// Which body model [default: what gender.txt in SCANS says, else neutral]
    #[arg(long, value_name = "GENDER", value_parser = |text: &str| text.parse::<Gender>().map_err(|_| "expected neutral, male or female"))]
    gender: Option<Gender>,
    /// Go on with the registration in DATA
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    json: JsonArgument,
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum UpAxis {
    #[value(name = "y")]
    Y,
    #[value(name = "-y")]
    MinusY,
    #[value(name = "z")]
    Z,
}

impl From<UpAxis> for Up {
    fn from(axis: UpAxis) -> Self {
        match axis {
            UpAxis::Y => Self::Y,
            UpAxis::MinusY => Self::MinusY,
            UpAxis::Z => Self::Z,
        }
    }
}

impl Register {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        if !self.resume && !files::is_new_or_empty(&self.out)? {
            anyhow::bail!("{}: the folder is not empty; give a new --out, or --resume to go on", self.out.display());
        }
        let mut scans = Scans::open(&self.scans, &self.test)?;
        let gender = self.gender.or(scans.gender).unwrap_or(Gender::Neutral);
        scans.gender = Some(gender);
        let (body_model, labels) = load_body(&self.body, gender)?;
        let up = self.up.into();
        let stop = stop::on_interrupt()?;
        let mut progress = Progress::new();
        let mut show = |phase: &'static str, share: f64, message: &str| progress.show(phase, share, message);
        let landmarks = match (&self.landmarks, &self.models) {
            (Some(path), _) => Some(LandmarkFiles::read(path)?),
            (None, None) => None,
            (None, Some(package)) => {
                match find_landmarks(&scans, &Models::open(package)?, up, &self.out, &mut show, stop)? {
                    Some(found) => Some(found),
                    None => return Ok(stopped()),
                }
            }
        };
        let job = Job {
            scans: &scans,
            body: &body_model,
            labels: &labels,
            landmarks: landmarks.as_ref(),
            up,
            known: Known {
                shape: self.shape.as_deref().map(|path| shape_in(path, body_model.shape_coefficients())).transpose()?,
                bare: false,
            },
            shape_from: self.minimal.clone(),
            out: self.out.clone(),
        };
        let report = job.run(&mut show, stop)?;
        progress.finish();
        let (data, body) = (self.out.display(), self.body.display());
        let Some(report) = report else { return Ok(stopped()) };
        write_registration_page(&self.out, &report, &body_model, command_line())?;
        let files = [REPORT_FILE, REGISTRATION_PAGE].map(|file| self.out.join(file).display().to_string());
        self.json.print(&report, &format!("{report}{}\n", files.join("\n")))?;
        log::info!(
            "try next\n  xavatar check {data} --body {body}\n  xavatar train {data} --body {body} --out runs/avatar --minutes 3"
        );
        Ok(if report.is_fit() { Outcome::Done } else { Outcome::Unfit })
    }
}

fn stopped() -> Outcome {
    log::info!("stopped; the same command with --resume goes on");
    Outcome::Stopped
}

/// Registers the scans in `data` if no body is registered to them: into the folder beside the run's, which later calls take as it is.
/// Landmarks are those of `landmarks.json` among the scans; without, people are found by the scans' shapes. Returns where the data
/// are; none if the registration was stopped.
pub fn registered_first(
    SubjectArguments { data, body }: &SubjectArguments,
    run: &Path,
    models: Option<PathBuf>,
) -> anyhow::Result<Option<PathBuf>> {
    if Subject::has_registrations(data) {
        return Ok(Some(data.into()));
    }
    // What is wrong with data that are no scans either is for the one who opens them to say.
    let Ok(scans) = Scans::open(data, &[]) else { return Ok(Some(data.into())) };
    let mut name = run.file_name().unwrap_or_default().to_os_string();
    name.push("-registered");
    let out = run.with_file_name(name);
    if out.join(REPORT_FILE).is_file() {
        log::info!("the scans' registration is in {}", out.display());
        return Ok(Some(out));
    }
    let landmarks = data.join(LANDMARKS_FILE);
    let landmarks = Some(landmarks).filter(|landmarks| models.is_none() && landmarks.is_file());
    let how = match (&models, &landmarks) {
        (Some(_), _) => "by landmarks found in pictures of them",
        (None, Some(_)) => "by landmarks.json",
        (None, None) => "by their shapes alone",
    };
    log::info!("no body is registered to these scans: registering them {how}, into {}", out.display());
    let register = Register {
        scans: scans.folder,
        body: body.clone(),
        out: out.clone(),
        geometry_only: landmarks.is_none() && models.is_none(),
        landmarks,
        models,
        shape: None,
        minimal: None,
        test: Vec::new(),
        up: UpAxis::Y,
        gender: None,
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

fn shape_in(path: &Path, count: usize) -> anyhow::Result<Vec<f64>> {
    let array = read_npy(path)?;
    match array.to_f64().filter(|values| values.len() == count && values.iter().all(|value| value.is_finite())) {
        Some(shape) => Ok(shape),
        None => wrong_usage!("{}: {} as a shape, expected {count} finite numbers", path.display(), array.description()),
    }
}

fn test_sequence(text: &str) -> Result<String, String> {
    let name = text.strip_suffix("=test").filter(|name| !name.is_empty());
    name.map(str::to_owned).ok_or_else(|| "expected NAME=test".into())
}
