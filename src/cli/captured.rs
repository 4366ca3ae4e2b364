//! What a subject was captured with, scans or an RGB-D camera: asked for with `--from`, else seen from the folder.

use clap::ValueEnum;
use xavatar::body::{BodyModel, PartLabels};
use xavatar::config::{Config, preset_for_rgbd};
use xavatar::data::{CheckedFrames, RgbdFrames, RgbdSubject, Subject};
use xavatar::train::TrainingFrames;

use super::inputs::{AcceptArguments, Registered, SubjectArguments, SubjectFrames, load_body};

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
        let has_scans = || Subject::open(&subject.data).is_ok_and(|subject| subject.has_scans());
        match asked {
            Some(kind) => kind,
            None if RgbdSubject::is_in(&subject.data) && !has_scans() => Self::Rgbd,
            None => Self::Scans,
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

/// Training frames with the body that they are registered with.
pub struct Captured {
    frames: Frames,
    pub body: BodyModel,
    pub labels: PartLabels,
}

enum Frames {
    Scans(SubjectFrames),
    Rgbd(RgbdFrames),
}

impl Captured {
    /// Finds a subject's training frames of one kind.
    pub fn open(arguments: &SubjectArguments, kind: Kind) -> xavatar::Result<Self> {
        match kind {
            Kind::Scans => {
                let Registered { subject, body, labels } = arguments.open()?;
                Ok(Self { frames: Frames::Scans(SubjectFrames::new(&subject, &subject.train)), body, labels })
            }
            Kind::Rgbd => {
                let subject = RgbdSubject::open(&arguments.data)?;
                let (body, labels) = load_body(&arguments.body, subject.gender)?;
                Ok(Self { frames: Frames::Rgbd(subject.training_frames()), body, labels })
            }
        }
    }

    /// Scans that are looked at as they are read; none for RGB-D frames.
    pub fn checked(&self, accepted: &AcceptArguments) -> Option<CheckedFrames<'_>> {
        match &self.frames {
            Frames::Scans(frames) => Some(CheckedFrames::new(frames, &self.body, accepted.defects())),
            Frames::Rgbd(_) => None,
        }
    }

    /// The frames, for a trainer.
    pub fn frames(&self) -> TrainingFrames<'_> {
        match &self.frames {
            Frames::Scans(frames) => TrainingFrames::Scans(frames),
            Frames::Rgbd(frames) => TrainingFrames::Rgbd(frames),
        }
    }
}
