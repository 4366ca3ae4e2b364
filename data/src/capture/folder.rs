//! A subject's folder as a source of captures of one kind.

use std::path::Path;

use super::{CaptureKind, Source, Split};
use crate::{RgbdSubject, Subject};
use xavatar_body::{BodyModel, Gender};
use xavatar_formats::Result;

/// A subject on disk whose captures are of one kind.
#[derive(Clone, Debug)]
pub enum CapturedSubject {
    /// Scans.
    Scans(Box<Subject>),
    /// Pictures of an RGB-D camera.
    Rgbd(Box<RgbdSubject>),
}

impl CaptureKind {
    /// Scans, unless a folder has RGB-D frames and no scan to learn from.
    #[must_use]
    pub fn of(folder: &Path) -> Self {
        let has_scans = || Subject::open(folder).is_ok_and(|subject| subject.has_scans());
        if RgbdSubject::is_in(folder) && !has_scans() { Self::Rgbd } else { Self::Scans }
    }
}

impl CapturedSubject {
    /// Finds the captures of one kind in a subject's folder.
    ///
    /// # Errors
    /// Those of [`Subject::open`] or [`RgbdSubject::open`].
    pub fn open(folder: &Path, kind: CaptureKind) -> Result<Self> {
        Ok(match kind {
            CaptureKind::Scans => Self::Scans(Box::new(Subject::open(folder)?)),
            CaptureKind::Rgbd => Self::Rgbd(Box::new(RgbdSubject::open(folder)?)),
        })
    }

    /// Which body model fits the subject.
    pub fn gender(&self) -> Gender {
        match self {
            Self::Scans(subject) => subject.gender,
            Self::Rgbd(subject) => subject.gender,
        }
    }

    /// The training captures, registered with `body`.
    ///
    /// # Errors
    /// As [`Subject::settled`].
    pub fn training(self, body: &BodyModel) -> Result<Box<dyn Source>> {
        Ok(match self {
            Self::Scans(subject) => Box::new(subject.settled(body)?.training_frames()),
            Self::Rgbd(subject) => Box::new(subject.training_frames()),
        })
    }

    /// The captures for training, and those for tests, registered with `body`.
    ///
    /// # Errors
    /// As [`Subject::settled`].
    pub fn both(self, body: &BodyModel) -> Result<[Box<dyn Source>; 2]> {
        Ok(match self {
            Self::Scans(subject) => {
                let subject = subject.settled(body)?;
                [Box::new(subject.training_frames()), Box::new(subject.frames(Split::Test))]
            }
            Self::Rgbd(subject) => [Box::new(subject.training_frames()), Box::new(subject.test_frames())],
        })
    }
}
