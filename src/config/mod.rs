//! Everything a user may turn, once: presets are files in `configs/`, `--set key=value` overrides any key.
//!
//! A run's folder holds the complete configuration as used. Unknown keys are errors that suggest the nearest known one.

mod fields;
mod losses;
mod optimiser;
mod presets;
mod rgbd;
mod sampling;
mod schedule;
mod search;

use std::path::Path;

use serde::{Deserialize, Serialize};
use xavatar_deformer::SearchSettings;
use xavatar_formats::read_text;
use xavatar_network::Representation;

use crate::{Error, InputError, Result};

pub use fields::{FieldSettings, SkinningSettings, SkinningShape, VoxelShape};
pub use losses::LossSettings;
pub use optimiser::OptimiserSettings;
pub use presets::{preset_for_rgbd, preset_names};
pub use rgbd::RgbdSettings;
pub use sampling::{HandSupervision, SamplingSettings, SamplingStrategy};
pub use schedule::Schedule;
pub use search::{Assignment, SearchedField, Starts};

/// Sections and keys of versions before that mean nothing any more: what was written with them is read without.
const RETIRED: [(&str, &str); 10] = [
    ("losses", "free_space"),
    ("losses", "bone_points"),
    ("rgbd", "free_points"),
    ("sampling", "uniform_points"),
    ("sampling", "extent"),
    ("search", "divergence"),
    ("search", "merge_distance"),
    ("optimiser", "adam"),
    ("optimiser", "grid_adam"),
    ("schedule", "checkpoints_kept"),
];

/// A complete configuration of one training run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The preset it started from.
    pub preset: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Leave out frames that cannot be used instead of stopping at the first.
    pub skip_bad_frames: bool,
    /// Extents of the networks.
    pub fields: FieldSettings,
    /// How exact roots of the search are, and when a start is given up.
    pub search: SearchSettings,
    /// How far the head is bowed in canonical space if hair hangs down the back, radians.
    #[serde(default)]
    pub bowed_head: f32,
    /// Which bones start the search.
    pub starts: Starts,
    /// On which field the search runs.
    pub searched_field: SearchedField,
    /// Which candidate a training point is assigned to.
    pub assignment: Assignment,
    /// Points drawn from each frame.
    pub sampling: SamplingSettings,
    /// Further points of each frame of an RGB-D camera; without it, the frames are scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rgbd: Option<RgbdSettings>,
    /// Weights of the loss terms.
    pub losses: LossSettings,
    /// Adam and its learning rate.
    pub optimiser: OptimiserSettings,
    /// How long, and how often to save and show.
    pub schedule: Schedule,
}

impl Config {
    /// The configuration of a preset.
    ///
    /// # Errors
    /// [`InputError::Value`] names the presets if there is none of this name.
    pub fn preset(name: &str) -> Result<Self> {
        Self::preset_with(name, &[])
    }

    /// A preset with overrides `("losses.normal", "0.5")` applied.
    ///
    /// # Errors
    /// [`InputError::Value`] for an unknown preset, or naming the first key whose value is of the wrong kind or range;
    /// [`Error::UnknownSetting`] for a key.
    pub fn preset_with(name: &str, settings: &[(String, String)]) -> Result<Self> {
        let config = presets::with_settings(name, settings)?;
        config.check()?;
        Ok(config)
    }

    /// Reads a run's `config.toml`.
    ///
    /// # Errors
    /// [`InputError::Io`] or [`InputError::Malformed`], naming the file.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &read_text(path)?)
    }

    /// As [`read`](Self::read), of the text of the file at `path`.
    ///
    /// # Errors
    /// [`InputError::Malformed`], naming the file; [`InputError::Value`] for a value out of range.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let config = Self::written(text).map_err(|error| malformed(path, &error))?;
        config.check()?;
        Ok(config)
    }

    /// The configuration that a run or an avatar was written with, by this version or one before.
    pub(crate) fn written(text: &str) -> std::result::Result<Self, toml::de::Error> {
        let refused: toml::de::Error = match toml::from_str(text) {
            Ok(config) => return Ok(config),
            Err(error) => error,
        };
        let Ok(mut table) = text.parse::<toml::Table>() else { return Err(refused) };
        for (section, key) in RETIRED {
            if let Some(toml::Value::Table(section)) = table.get_mut(section) {
                section.remove(key);
            }
        }
        table.try_into().map_err(|_| refused)
    }

    /// The text of `config.toml`.
    ///
    /// # Errors
    /// [`InputError::Value`] for a number that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String> {
        Ok(toml::to_string(self).map_err(|error| InputError::Value {
            name: "configuration".into(),
            found: error.to_string(),
            expected: "numbers that TOML can hold".into(),
        })?)
    }

    fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.bowed_head) {
            return Err(Error::from(InputError::Value {
                name: "bowed_head".into(),
                found: self.bowed_head.to_string(),
                expected: "0 to 1 radian".into(),
            }));
        }
        self.fields.check()?;
        self.searched_field.check()?;
        self.sampling.check()?;
        self.losses.check()?;
        self.optimiser.check()?;
        self.schedule.check()?;
        if let Some(rgbd) = &self.rgbd {
            rgbd.check(&self.sampling)?;
        }
        match self.fields.representation {
            Representation::Occupancy if self.rgbd.is_some() => {
                refuse("fields.representation", "occupancy", "signed_distance for RGB-D frames, which show no inside")
            }
            Representation::Occupancy if self.losses.distance > 0.0 => {
                refuse("losses.distance", self.losses.distance, "0 for an occupancy field, which has no distances")
            }
            Representation::SignedDistance if self.losses.occupancy > 0.0 => {
                refuse("losses.occupancy", self.losses.occupancy, "0 for a signed distance field, which has no logits")
            }
            _ => Ok(()),
        }
    }
}

/// The settings of a section that are numbers, and no counts, by their dotted keys.
fn numbers(section: &str, settings: &impl Serialize) -> Result<Vec<(String, f64)>> {
    let table = toml::Table::try_from(settings).map_err(|error| InputError::Value {
        name: section.into(),
        found: error.to_string(),
        expected: "settings that TOML can hold".into(),
    })?;
    Ok(table.into_iter().filter_map(|(key, value)| Some((format!("{section}.{key}"), value.as_float()?))).collect())
}

fn positive(name: &str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { refuse(name, value, "a positive number") }
}

fn within(name: &str, value: f64, maximum: f64) -> Result<()> {
    if (0.0..=maximum).contains(&value) { Ok(()) } else { refuse(name, value, &format!("between 0 and {maximum}")) }
}

fn refuse(name: &str, found: impl ToString, expected: &str) -> Result<()> {
    Err(Error::from(InputError::Value { name: name.into(), found: found.to_string(), expected: expected.into() }))
}

fn malformed(path: &Path, error: &toml::de::Error) -> Error {
    Error::from(InputError::Malformed {
        path: path.into(),
        format: "configuration",
        place: error.span().map_or("the file".into(), |span| format!("byte {}", span.start)),
        found: error.message().into(),
        expected: "the keys of a preset in configs/".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(key: &str, value: &str) -> Result<Config> {
        Config::preset_with("fast", &[(key.into(), value.into())])
    }

    #[test]
    fn what_was_written_with_retired_keys_is_read_without() {
        let config = Config::preset("fast-rgbd").unwrap();
        let written = config.to_toml().unwrap();
        let with_retired = |text: String, (section, key): (&str, &str)| {
            let header = format!("[{section}]\n");
            assert!(text.contains(&header), "{section}");
            text.replace(&header, &format!("{header}{key} = 5\n"))
        };
        let before = RETIRED.into_iter().fold(written.clone(), with_retired);
        assert_eq!(Config::written(&before).unwrap(), config);
        assert!(Config::written(&written.replace("[losses]\n", "[losses]\nfree_speech = 1.0\n")).is_err());
    }

    #[test]
    fn values_out_of_range_are_refused() {
        for (key, value) in [
            ("optimiser.learning_rate", "0"),
            ("optimiser.learning_rate", "nan"),
            ("sampling.points", "-5"),
            ("sampling.points", "many"),
            ("fields.condition_dropout", "1.5"),
            ("losses.bone", "-1"),
            ("losses.occupancy", "1"),
        ] {
            assert!(matches!(set(key, value), Err(Error::Input(InputError::Value { .. }))), "{key} = {value}");
        }
    }
}
