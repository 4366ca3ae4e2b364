//! What `xavatar info` says of a subject's folder: its layout, and the frames there are.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::Serialize;
use xavatar::body::Gender;
use xavatar::data::{FrameId, RgbdSubject, ScanPlacement, Subject};

/// A subject's folder.
#[derive(Serialize)]
pub struct SubjectDescription {
    layout: &'static str,
    gender: Gender,
    betas: Vec<f32>,
    /// Frames with a scan by `split/sequence`.
    scans: BTreeMap<String, usize>,
    /// RGB-D frames by `split/sequence`.
    pictures: BTreeMap<String, usize>,
    /// What `check --fix` recorded.
    placement: Option<ScanPlacement>,
}

impl SubjectDescription {
    /// Looks at a folder; the error is that of opening it as a subject with scans.
    pub fn of(folder: &Path) -> xavatar::Result<Self> {
        let pictures = RgbdSubject::is_in(folder).then(|| RgbdSubject::open(folder)).transpose()?;
        let frames = pictures.iter().flat_map(|subject| subject.train.iter().chain(&subject.test));
        let by_sequence = counted(frames.map(|files| &files.id));
        match (Subject::open(folder), pictures) {
            (Ok(subject), _) => Ok(Self {
                layout: subject.layout.name(),
                gender: subject.gender,
                betas: subject.betas,
                scans: counted(
                    subject
                        .train
                        .iter()
                        .chain(&subject.test)
                        .filter(|files| files.scan.path().is_some())
                        .map(|files| &files.id),
                ),
                pictures: by_sequence,
                placement: ScanPlacement::read(folder)?,
            }),
            (Err(_), Some(subject)) => Ok(Self {
                layout: RgbdSubject::LAYOUT_FILE,
                gender: subject.gender,
                betas: subject.betas,
                scans: BTreeMap::new(),
                pictures: by_sequence,
                placement: None,
            }),
            (Err(error), None) => Err(error.into()),
        }
    }
}

fn counted<'a>(ids: impl Iterator<Item = &'a FrameId>) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for id in ids {
        *counts.entry(format!("{}/{}", id.split, id.sequence)).or_default() += 1;
    }
    counts
}

impl fmt::Display for SubjectDescription {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { layout, gender, betas, scans, pictures, placement } = self;
        writeln!(formatter, "a {gender} subject, laid out as {layout}")?;
        writeln!(formatter, "betas: {betas:?}")?;
        for (frames, kind) in [(scans, "scans"), (pictures, "RGB-D frames")] {
            for (sequence, count) in frames {
                writeln!(formatter, "{sequence}: {count} {kind}")?;
            }
        }
        match placement {
            Some(_) => writeln!(formatter, "scans are placed by {}", ScanPlacement::FILE),
            None => Ok(()),
        }
    }
}
