//! What a subject was captured with, scans or an RGB-D camera: asked for with `--from`, else seen from the folder.

use clap::ValueEnum;
use xavatar::body::{BodyModel, PartLabels};
use xavatar::config::{Config, preset_for_rgbd};
use xavatar::data::{CaptureKind, CapturedSubject, CheckedFrames, Source};
use xavatar::train::TrainingSpec;

use crate::cli::options::inputs::{AcceptArguments, SubjectArguments, load_body};

/// A kind of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Textured scans
    Scans,
    /// Pictures of an RGB-D camera
    Rgbd,
}

impl Kind {
    /// The kind that was asked for; else scans, unless the folder has only RGB-D frames.
    pub fn of(subject: &SubjectArguments, asked: Option<Self>) -> Self {
        match asked {
            Some(kind) => kind,
            None => CaptureKind::of(&subject.data).into(),
        }
    }

    /// The kind that a configuration is for.
    pub fn of_run(config: &Config) -> Self {
        if config.rgbd.is_some() { Self::Rgbd } else { Self::Scans }
    }

    /// The variation of a preset for this kind of frames, by its name or the other kind's.
    pub fn preset(self, name: &str) -> &str {
        match self {
            Self::Rgbd => preset_for_rgbd(name),
            Self::Scans => name,
        }
    }
}

impl From<Kind> for CaptureKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Scans => Self::Scans,
            Kind::Rgbd => Self::Rgbd,
        }
    }
}

impl From<CaptureKind> for Kind {
    fn from(kind: CaptureKind) -> Self {
        match kind {
            CaptureKind::Scans => Self::Scans,
            CaptureKind::Rgbd => Self::Rgbd,
        }
    }
}

/// Training captures with the body that they are registered with.
pub struct Captured {
    source: Box<dyn Source>,
    pub body: BodyModel,
    pub labels: PartLabels,
}

impl Captured {
    /// Finds a subject's training captures of one kind.
    pub fn open(arguments: &SubjectArguments, kind: Kind) -> xavatar::Result<Self> {
        let subject = CapturedSubject::open(&arguments.data, kind.into())?;
        let (body, labels) = load_body(&arguments.body, subject.gender())?;
        Ok(Self { source: subject.training(&body)?, body, labels })
    }

    /// The captures, of which scans are looked at as they are read.
    pub fn checked(&self, accepted: &AcceptArguments) -> CheckedFrames<'_> {
        CheckedFrames::new(self.source.as_ref(), &self.body, accepted.defects())
    }

    /// All that a run on `source` takes.
    pub fn spec<'a>(&'a self, config: &'a Config, source: &'a dyn Source) -> TrainingSpec<'a> {
        TrainingSpec { config, source, body: &self.body, labels: &self.labels }
    }
}
