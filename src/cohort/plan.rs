//! What is to be done with one subject.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::config::{Config, preset_for_rgbd};
use crate::data::{CaptureKind, Defect, Split};
use crate::{Error, InputError, Result};

/// A part of the work on a subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// A body is registered to scans that have none.
    Register,
    /// The avatar is trained.
    Train,
    /// It is measured against scans.
    #[serde(rename = "eval")]
    Evaluate,
    /// It is written for other programs.
    Export,
}

impl Stage {
    /// All of them, in order.
    pub const ALL: [Self; 4] = [Self::Register, Self::Train, Self::Evaluate, Self::Export];

    /// As a manifest says it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Register => "register",
            Self::Train => "train",
            Self::Evaluate => "eval",
            Self::Export => "export",
        }
    }
}

/// A subject of a manifest.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubjectPlan {
    /// Its name, and that of its folder.
    pub name: String,
    /// Its scans or RGB-D frames.
    pub data: PathBuf,
    /// Body model file, or the folder that holds SMPL-X's.
    pub body: PathBuf,
    /// Landmarks to register by; without, `landmarks.json` among the scans, or else their shapes alone.
    pub landmarks: Option<PathBuf>,
    /// What is done, in order.
    #[serde(default = "all_stages")]
    pub stages: Vec<Stage>,
    /// Which frames it is measured on.
    #[serde(default = "test_frames")]
    pub split: Split,
    /// Cells along the longest side of the box around the body, for measuring and exporting.
    #[serde(default = "usual_resolution")]
    pub resolution: usize,
    /// Texels along a side of the exported texture; 0 for a colour a vertex.
    #[serde(default = "usual_texture")]
    pub texture: u32,
    #[serde(default = "usual_preset")]
    preset: String,
    #[serde(default)]
    set: toml::Table,
    #[serde(default)]
    accept: Vec<String>,
}

fn all_stages() -> Vec<Stage> {
    Stage::ALL.into()
}

fn test_frames() -> Split {
    Split::Test
}

fn usual_resolution() -> usize {
    256
}

fn usual_texture() -> u32 {
    2048
}

fn usual_preset() -> String {
    "fast".into()
}

impl SubjectPlan {
    /// Its training's configuration, for scans or for RGB-D frames.
    ///
    /// # Errors
    /// Those of [`Config::preset_with`].
    pub fn config(&self, kind: CaptureKind) -> Result<Config> {
        let preset = match kind {
            CaptureKind::Rgbd => preset_for_rgbd(&self.preset),
            CaptureKind::Scans => &self.preset,
        };
        let text = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let settings: Vec<_> = self.set.iter().map(|(key, value)| (key.clone(), text(value))).collect();
        Config::preset_with(preset, &settings)
    }

    /// Faults of scans that are trained on all the same.
    ///
    /// # Errors
    /// [`InputError::Value`] for a name that is none of a fault.
    pub fn accepted(&self) -> Result<Vec<Defect>> {
        let defect =
            |name: &String| name.parse::<Defect>().map_err(|error| refused("accept", name.clone(), &error.to_string()));
        self.accept.iter().map(defect).collect()
    }

    /// Whether a stage is asked for.
    pub fn has(&self, stage: Stage) -> bool {
        self.stages.contains(&stage)
    }

    /// What the avatar depends on beside its data, as text that is equal for equal settings.
    pub(super) fn training_settings(&self) -> Result<String> {
        Ok(format!(
            "{}accept = {:?}\nregister = {}\n",
            self.config(CaptureKind::Scans)?.to_toml()?,
            self.accept,
            self.has(Stage::Register)
        ))
    }

    /// What the results depend on beside the avatar.
    pub(super) fn result_settings(&self) -> String {
        format!("{:?} {:?} {} {}", self.stages, self.split, self.resolution, self.texture)
    }

    /// With paths that are relative to `folder`; stages in order.
    pub(super) fn under(mut self, folder: &Path) -> Self {
        let place = |path: &mut PathBuf| *path = folder.join(&*path);
        place(&mut self.data);
        place(&mut self.body);
        self.landmarks.iter_mut().for_each(place);
        self.stages.sort();
        self.stages.dedup();
        self
    }

    pub(super) fn check(&self) -> Result<()> {
        self.accepted()?;
        self.config(CaptureKind::Scans)?;
        if self.resolution < 2 {
            return Err(refused("resolution", self.resolution.to_string(), "2 cells or more"));
        }
        if !self.has(Stage::Train) && (self.has(Stage::Evaluate) || self.has(Stage::Export)) {
            return Err(refused("stages", format!("{:?}", self.stages), "train among them: the others need an avatar"));
        }
        Ok(())
    }
}

fn refused(key: &str, found: String, expected: &str) -> Error {
    Error::from(InputError::Value { name: key.into(), found, expected: expected.into() })
}
