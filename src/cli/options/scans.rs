//! What verbs that register bodies have in common: to which scans or pictures, which body, and by which landmarks.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::ValueEnum;
use xavatar::InputError;
use xavatar::body::{BodyModel, Gender, PartLabels};
use xavatar::data::{RgbdPictures, Scans};
use xavatar::formats::read_npy;
use xavatar::landmarks::Models;
use xavatar::register::fit::Known;
use xavatar::register::job::{Job, Observer, Recordings, StartPoses, Up, find_landmarks};
use xavatar::register::landmarks::LandmarkFiles;

use super::captured::Kind;
use super::inputs::load_body;
use super::motion::positive;
use crate::cli::output::progress::Progress;
use crate::cli::{stop, wrong_usage};

/// Scans or pictures, the body to register to them, and landmarks.
#[derive(clap::Args)]
pub struct ScanArguments {
    /// The folder of one person's scans
    #[arg(value_name = "SCANS", required_unless_present = "rgbd", conflicts_with = "rgbd")]
    scans: Option<PathBuf>,
    /// Instead of scans: one person's pictures by a depth camera, in a layout of docs/rgbd.md
    #[arg(long, value_name = "FOLDER")]
    rgbd: Option<PathBuf>,
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl
    #[arg(long, value_name = "BODY")]
    pub body: PathBuf,
    /// Landmarks in the coordinates of the scans, or of the cameras' world: a file, or a folder with a file a frame
    #[arg(long, value_name = "PATH", required_unless_present_any = ["geometry_only", "models"])]
    landmarks: Option<PathBuf>,
    /// MediaPipe's package, whose networks find the landmarks: its wheel of version 0.10.14, or a folder with it
    #[arg(long, value_name = "PACKAGE", conflicts_with = "landmarks")]
    models: Option<PathBuf>,
    /// Without landmarks: people who stand are found by the scans' shapes, and the frames near them from these
    #[arg(long, conflicts_with_all = ["landmarks", "models"])]
    geometry_only: bool,
    /// Poses that another program found, tried as starts: a motion of docs/motion.md, or a folder with one for every sequence
    #[arg(long, value_name = "MOTION")]
    start: Option<PathBuf>,
    /// The subject's shape, ten coefficients as .npy, to be held fixed
    #[arg(long, value_name = "FILE")]
    shape: Option<PathBuf>,
    /// A sequence in tight or no clothes, which the shape is taken from
    #[arg(long, value_name = "SEQUENCE", conflicts_with = "shape")]
    minimal: Option<String>,
    /// Frames a second of the sequences, if frames follow each other: bodies then move as smoothly as people do
    #[arg(long, value_name = "F", value_parser = positive)]
    fps: Option<f32>,
    /// The axis of the scans' files, or of the cameras' world, that points up
    #[arg(long, value_enum, default_value_t = UpAxis::Y, allow_hyphen_values = true)]
    up: UpAxis,
    /// Which body model [default: what gender.txt, or rgbd.toml, says; else neutral]
    #[arg(long, value_name = "GENDER", value_parser = |text: &str| text.parse::<Gender>().map_err(|_| "expected neutral, male or female"))]
    gender: Option<Gender>,
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

/// Scans or pictures that were found, with the body for them.
pub struct OpenScans<'a> {
    arguments: &'a ScanArguments,
    recordings: Recordings,
    gender: Gender,
    labels: PartLabels,
    known: Known,
    /// The body.
    pub body: BodyModel,
    /// Whether bodies are also to be moved vertex by vertex onto their scans.
    pub offsets: bool,
}

impl ScanArguments {
    /// Scans or pictures in a folder, and the body alone; without landmarks, by what shape they show.
    pub fn new(
        (folder, kind): (PathBuf, Kind),
        body: PathBuf,
        landmarks: Option<PathBuf>,
        models: Option<PathBuf>,
    ) -> Self {
        let (scans, rgbd) = match kind {
            Kind::Scans => (Some(folder), None),
            Kind::Rgbd => (None, Some(folder)),
        };
        Self {
            scans,
            rgbd,
            body,
            geometry_only: landmarks.is_none() && models.is_none(),
            landmarks,
            models,
            start: None,
            shape: None,
            minimal: None,
            fps: None,
            up: UpAxis::Y,
            gender: None,
        }
    }

    /// Whether there are pictures in place of scans.
    pub fn is_rgbd(&self) -> bool {
        self.rgbd.is_some()
    }

    /// Finds the scans, of which the sequences of these names are for tests, or the pictures, and loads the body.
    pub fn open(&self, test: &[String]) -> anyhow::Result<OpenScans<'_>> {
        let recordings = match (&self.scans, &self.rgbd) {
            (_, Some(_)) if !test.is_empty() => wrong_usage!(
                "--take: which pictures are for tests, their folders train and test say, or `split` in rgbd.toml (docs/rgbd.md)"
            ),
            (_, Some(folder)) => Recordings::Rgbd(RgbdPictures::open(folder)?),
            (Some(folder), None) => Recordings::Scans(Scans::open(folder, test)?),
            (None, None) => wrong_usage!("give SCANS, or --rgbd FOLDER"),
        };
        let gender = self.gender.or(recordings.gender()).unwrap_or(Gender::Neutral);
        let (body, labels) = load_body(&self.body, gender)?;
        let shape = self.shape.as_deref().map(|path| shape_in(path, body.shape_coefficients())).transpose()?;
        let known = Known { shape, bare: false };
        Ok(OpenScans { arguments: self, recordings, gender, labels, known, body, offsets: false })
    }
}

impl OpenScans<'_> {
    /// Finds landmarks and has `work` done with the job; none if it was stopped, and what it keeps in `out` is gone on with.
    pub fn registered<T>(
        &self,
        out: &Path,
        progress: &mut Progress,
        work: impl FnOnce(&Job<'_>, &mut Observer<'_>, &AtomicBool) -> Result<Option<T>, InputError>,
    ) -> anyhow::Result<Option<T>> {
        let ScanArguments { landmarks, models, start, minimal, up, fps, .. } = self.arguments;
        let (recordings, up) = (&self.recordings, (*up).into());
        let stop = stop::on_interrupt()?;
        let read = |path: &PathBuf| StartPoses::read(path, recordings, &self.body);
        let starts = start.as_ref().map(read).transpose()?;
        let mut show = |phase: &'static str, share: f64, message: &str| progress.show(phase, share, message);
        let landmarks = match (landmarks, models) {
            (Some(path), _) => Some(LandmarkFiles::read(path)?),
            (None, None) => None,
            (None, Some(package)) => {
                match find_landmarks(recordings, &Models::open(package)?, up, out, &mut show, stop)? {
                    Some(found) => Some(found),
                    None => return Ok(None),
                }
            }
        };
        let job = Job {
            recordings,
            gender: self.gender,
            body: &self.body,
            labels: &self.labels,
            landmarks: landmarks.as_ref(),
            starts: starts.as_ref(),
            up,
            known: self.known.clone(),
            shape_from: minimal.clone(),
            frames_per_second: fps.map(f64::from),
            offsets: self.offsets,
            out: out.into(),
        };
        Ok(work(&job, &mut show, stop)?)
    }
}

fn shape_in(path: &Path, count: usize) -> anyhow::Result<Vec<f64>> {
    let array = read_npy(path)?;
    match array.to_f64().filter(|values| values.len() == count && values.iter().all(|value| value.is_finite())) {
        Some(shape) => Ok(shape),
        None => wrong_usage!("{}: {} as a shape, expected {count} finite numbers", path.display(), array.description()),
    }
}
