//! `subject.toml`: what a folder of scans and registrations does not say itself (docs/formats.md).

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::rules::HandZero;
use crate::Split;
use crate::placement::ScanPlacement;
use crate::rgbd::Shape;
use xavatar_body::Gender;
use xavatar_formats::{Error, Result, read_text};

const FORMAT: &str = "description of a subject";

/// The file. Paths are relative to it.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Description {
    pub gender: Option<Gender>,
    /// The subject's shape; without it the mean of its registrations'.
    pub betas: Option<Shape>,
    pub hands: Option<HandZero>,
    /// The folder that the data are in, if not the description's.
    pub data: Option<PathBuf>,
    /// Sequences to measure on; the others are for training.
    pub test: Vec<String>,
    /// How scans are brought onto their bodies.
    pub scans: Option<ScanPlacement>,
    #[serde(rename = "sequence")]
    pub sequences: Vec<DescribedSequence>,
}

/// A sequence, where folders have other names than layouts know.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DescribedSequence {
    pub name: Option<String>,
    #[serde(default = "train")]
    pub split: Split,
    #[serde(default)]
    pub folder: PathBuf,
    #[serde(default = "scans")]
    pub scans: PathBuf,
    #[serde(default = "fits")]
    pub fits: PathBuf,
}

fn train() -> Split {
    Split::Train
}

fn scans() -> PathBuf {
    "scans".into()
}

fn fits() -> PathBuf {
    "fits".into()
}

impl Description {
    pub const FILE: &str = "subject.toml";

    /// The description in a folder; an empty one if there is none.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Malformed`] naming the line or the value.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(Self::FILE);
        if !path.is_file() {
            return Ok(Self::default());
        }
        let text = read_text(&path)?;
        let malformed = |place: String, found: String, expected: &str| Error::Malformed {
            path: path.clone(),
            format: FORMAT,
            place,
            found,
            expected: expected.into(),
        };
        let description: Self = toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            malformed(format!("line {line}"), error.message().into(), "what docs/formats.md describes")
        })?;
        if let Some(Shape::Numbers(betas)) = &description.betas
            && !betas.iter().all(|beta| beta.is_finite())
        {
            return Err(malformed("`betas`".into(), format!("{betas:?}"), "finite numbers"));
        }
        if let Some(scans) = &description.scans {
            scans.checked(&path)?;
        }
        Ok(description)
    }
}
