//! A subject's folder as a source of captures, whatever kind is in it.

use std::path::Path;

use super::{CaptureKind, Source};
use crate::{RgbdSubject, Subject};
use xavatar_formats::Result;

/// The training frames of one kind in a subject's folder.
///
/// # Errors
/// Those of [`Subject::open`] or [`RgbdSubject::open`].
pub fn training_captures(folder: &Path, kind: CaptureKind) -> Result<Box<dyn Source>> {
    Ok(match kind {
        CaptureKind::Scans => Box::new(Subject::open(folder)?.training_frames()),
        CaptureKind::Rgbd => Box::new(RgbdSubject::open(folder)?.training_frames()),
    })
}

/// Whether a folder has RGB-D frames and no scan to learn from.
pub fn has_only_rgbd(folder: &Path) -> bool {
    let has_scans =
        || Subject::open(folder).is_ok_and(|subject| subject.train.iter().any(|files| files.scan.is_file()));
    RgbdSubject::is_in(folder) && !has_scans()
}
