//! `rgbd.toml`: how a plain folder of RGB-D pictures is laid out (docs/rgbd.md).

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::cameras::PixelOrigin;
use crate::Split;
use xavatar_body::Gender;
use xavatar_formats::{Error, Result, read_text};

const FORMAT: &str = "RGB-D layout";

/// The file. Paths are relative to it, those of a sequence to its folder.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layout {
    /// Needless for pictures that no body is registered to yet, as is the shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gender: Option<Gender>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub betas: Option<Shape>,
    pub depth_unit: DepthUnit,
    #[serde(default)]
    pub pixel_origin: PixelOrigin,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<Calibration>,
    #[serde(default, rename = "sequence")]
    pub sequences: Vec<Sequence>,
}

/// The subject's shape: the numbers, or an npy file of them.
#[derive(Deserialize, Serialize)]
#[serde(untagged, expecting = "`betas` has to be numbers or the name of an npy file")]
pub(crate) enum Shape {
    Numbers(Vec<f32>),
    File(PathBuf),
}

/// What one unit of a depth picture is.
#[derive(Deserialize, Serialize)]
#[serde(untagged, expecting = "`depth_unit` has to be \"metres\", \"millimetres\" or the number of metres in one unit")]
pub(super) enum DepthUnit {
    Named(NamedUnit),
    Metres(f32),
}

#[derive(Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum NamedUnit {
    Metres,
    Millimetres,
}

/// One camera for all sequences: pixels, or a file that has them.
#[derive(Deserialize, Serialize)]
#[serde(untagged, expecting = "`intrinsics` has to be fx, fy, cx and cy, or the name of a file with a 3 x 3 matrix")]
pub(super) enum Calibration {
    Numbers(FocalLengths),
    File(PathBuf),
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FocalLengths {
    pub fx: f32,
    pub fy: f32,
    pub cx: f32,
    pub cy: f32,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sequence {
    pub split: Split,
    pub folder: PathBuf,
    /// The folder's name if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(default = "colour_folder")]
    pub colour: PathBuf,
    #[serde(default = "depth_folder")]
    pub depth: PathBuf,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<PathBuf>,
    /// A file, or a folder with one a frame; `cameras.npz`, `.toml` or `.json`, whichever is there, if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cameras: Option<PathBuf>,
    #[serde(default = "bodies_folder")]
    pub bodies: PathBuf,
}

fn colour_folder() -> PathBuf {
    "colour".into()
}

fn depth_folder() -> PathBuf {
    "depth".into()
}

fn bodies_folder() -> PathBuf {
    "SMPLX".into()
}

impl DepthUnit {
    fn metres(&self) -> f32 {
        match self {
            Self::Named(NamedUnit::Metres) => 1.0,
            Self::Named(NamedUnit::Millimetres) => 1e-3,
            Self::Metres(metres) => *metres,
        }
    }
}

impl Layout {
    pub const FILE: &str = "rgbd.toml";

    /// Reads the file in a subject's folder.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Malformed`] naming the line or the setting.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(Self::FILE);
        let text = read_text(&path)?;
        let layout: Self = toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            malformed(&path, format!("line {line}"), error.message(), "what docs/rgbd.md describes")
        })?;
        let unit = layout.metres_per_unit();
        if !(unit.is_finite() && unit > 0.0) {
            return Err(malformed(&path, "`depth_unit`".into(), &unit.to_string(), "a positive number of metres"));
        }
        if let Some(Shape::Numbers(betas)) = &layout.betas
            && !betas.iter().all(|beta| beta.is_finite())
        {
            return Err(malformed(&path, "`betas`".into(), &format!("{betas:?}"), "finite numbers"));
        }
        Ok(layout)
    }

    /// Metres in one unit of the depth pictures.
    pub fn metres_per_unit(&self) -> f32 {
        self.depth_unit.metres()
    }
}

fn malformed(path: &Path, place: String, found: &str, expected: &str) -> Error {
    Error::Malformed { path: path.into(), format: FORMAT, place, found: found.into(), expected: expected.into() }
}
