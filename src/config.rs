//! Everything a user may turn, once: presets are files in `configs/`, `--set key=value` overrides any key.
//!
//! A run's folder holds the complete configuration as used. Unknown keys are errors that suggest the nearest known one.

mod rgbd;

use std::path::Path;

use serde::{Deserialize, Serialize};
use xavatar_deformer::SearchSettings;
use xavatar_formats::read_text;
use xavatar_network::{AdamSettings, GeometryShape, Representation, TextureShape};

use crate::canonical_grid::VoxelShape;
use crate::{Error, InputError, Result};

pub use rgbd::RgbdSettings;

/// The built-in presets: name, contents.
const PRESETS: [(&str, &str); 6] = [
    ("paper-scan", include_str!("../configs/paper-scan.toml")),
    ("fast", include_str!("../configs/fast.toml")),
    ("demo", include_str!("../configs/demo.toml")),
    ("paper-rgbd", include_str!("../configs/paper-rgbd.toml")),
    ("fast-rgbd", include_str!("../configs/fast-rgbd.toml")),
    ("demo-rgbd", include_str!("../configs/demo-rgbd.toml")),
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
    /// When search starts are given up and roots are the same.
    pub search: SearchSettings,
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

/// Extents of the networks, and what the geometry means.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldSettings {
    /// Occupancy logits or signed distances.
    pub representation: Representation,
    /// The geometry field.
    pub geometry: GeometryShape,
    /// The texture field.
    pub texture: TextureShape,
    /// The skinning field.
    pub skinning: SkinningSettings,
    /// Probability that a training frame's condition is replaced by zeros, so that unseen poses are no surprise.
    pub condition_dropout: f64,
}

/// The kind of skinning field, and its extents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum SkinningSettings {
    /// A network (thesis).
    Network(SkinningShape),
    /// Logits at the nodes of a grid, from the body model's weights on; the search runs on them.
    Voxels(VoxelShape),
}

/// The extents of the skinning network.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkinningShape {
    /// Hidden layers (thesis: 5).
    pub depth: usize,
    /// Units a layer (thesis: 128).
    pub width: usize,
    /// Frequencies of the point's encoding (thesis: 0).
    pub frequencies: usize,
    /// Factor on the logits (thesis: 20).
    pub blend: u32,
}

/// Which bones start the search for a point's correspondences (thesis table 5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Starts {
    /// Those of the point's part.
    Part,
    /// The body's bones for every point (ablation A1).
    Body,
    /// All bones for every point (ablation A2).
    All,
}

/// The skinning field that the search evaluates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum SearchedField {
    /// The network itself (thesis).
    Exact,
    /// Its weights on a grid over the canonical box; each root is then polished on the network.
    Baked {
        /// Nodes of the grid along x, y and z.
        nodes: [usize; 3],
        /// Training steps after which the network is sampled anew.
        refresh_steps: u64,
    },
}

/// Which of a training point's candidates is its correspondence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Assignment {
    /// The one that the geometry field itself prefers (thesis).
    Field,
    /// The one deepest in the canonical body: a hand beside a thigh cannot grow a second hand onto the thigh.
    Body,
}

/// Where surface points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SamplingStrategy {
    /// More on face and hands (thesis ch. 4.2.4).
    PartAware,
    /// Uniformly by area (ablation A3).
    Uniform,
}

/// Which surface supervises the hands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HandSupervision {
    /// The registered body: volumetric scans fuse fingers.
    Registration,
    /// What was captured: the scan, or the points that a camera sees.
    Scan,
}

/// Points drawn from each frame at each step (METHOD section 4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SamplingSettings {
    /// P: shares of it go to body, face and hands.
    pub points: usize,
    /// Share of P on the body (thesis: 1/3).
    pub body_share: f64,
    /// Share of P on the face, half of it around eyes and mouth (thesis: 1/3).
    pub face_share: f64,
    /// Share of P on each hand (thesis: 1/8).
    pub hand_share: f64,
    /// Further points drawn uniformly in the cube of `extent`.
    pub uniform_points: usize,
    /// Canonical points drawn in the canonical box, kept where the body model alone decides between inside and outside.
    ///
    /// Not in the thesis: without them, space that only ever poses into the body may become body, and shows in a new pose.
    pub far_points: usize,
    /// Half the edge of that cube, metres.
    pub extent: f32,
    /// Standard deviation of the noise that moves surface points off the surface, metres.
    pub deviation: f32,
    /// Share of the points off the surface that get `wide_deviation` instead.
    pub wide_share: f32,
    /// A larger standard deviation, so that the interior is sampled too, metres.
    pub wide_deviation: f32,
    /// Where surface points are drawn.
    pub strategy: SamplingStrategy,
    /// Which surface supervises the hands.
    pub hand_supervision: HandSupervision,
}

/// Weights of the loss terms (METHOD section 5); zero leaves a term out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossSettings {
    /// Binary cross-entropy of occupancy off the surface.
    pub occupancy: f64,
    /// Absolute error of the truncated signed distance off the surface, per metre.
    pub distance: f64,
    /// Distances are truncated here, metres.
    pub truncation: f64,
    /// Squared error of the deformed normal.
    pub normal: f64,
    /// Absolute error of the colour.
    pub colour: f64,
    /// Passes over the training frames before the colour is trained.
    pub colour_from_epoch: u64,
    /// Binary cross-entropy of points on bones being inside.
    pub bone: f64,
    /// Points a bone.
    pub bone_points: usize,
    /// Squared error of the weights at joints.
    pub joint: f64,
    /// Squared error of the weights at canonical vertices of hands and face.
    pub surface: f64,
    /// Squared error of the weights around and inside the canonical body against the nearest surface point's.
    ///
    /// Not in the thesis: without it, the weights deep inside are free, and the search finds roots there for empty space.
    pub volume: f64,
    /// (|grad f| - 1)^2 around the canonical body.
    pub eikonal: f64,
    /// Points for it a frame.
    pub eikonal_points: usize,
    /// Distance by which the field leaves its bounds in the air that a camera looks through, per metre.
    ///
    /// Not in the thesis, and 0 in the presets: measured, it brought nothing (docs/rgbd-training.md).
    #[serde(default)]
    pub free_space: f64,
}

/// Adam and its learning rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OptimiserSettings {
    /// Learning rate of the networks at the first step.
    pub learning_rate: f64,
    /// That of the geometry's hash grid.
    pub grid_learning_rate: f64,
    /// That of the texture's: colours are larger numbers than distances in metres.
    pub colour_grid_learning_rate: f64,
    /// That of the skinning logits of a grid.
    pub voxel_learning_rate: f64,
    /// Share of it that is left at the last step, falling exponentially; 1 keeps it constant.
    pub final_share: f64,
    /// The joint norm of all gradients is clipped to this.
    pub clip: f64,
    /// Frames a step.
    pub batch_frames: usize,
    /// Adam's constants.
    pub adam: AdamSettings,
    /// Those for hash grids, whose entries are updated only when a sample touches them.
    pub grid_adam: AdamSettings,
}

/// How long to train, and how often to save and show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Steps on the user's frames.
    pub steps: u64,
    /// Wall time of the whole command; 0 for no limit. When given, it ends training instead of `steps`.
    pub minutes: f64,
    /// Passes over the training frames that end training before `minutes` do: more would fit what the frames have of their
    /// own, as wrinkles, and unseen poses would suffer. 0 for no such bound.
    #[serde(default)]
    pub most_epochs: u64,
    /// Steps of stage 0, on the body model.
    pub pretraining_steps: u64,
    /// Steps between checkpoints.
    pub checkpoint_steps: u64,
    /// Checkpoints that are kept.
    pub checkpoints_kept: usize,
    /// Steps between previews; 0 for none.
    pub preview_steps: u64,
}

impl Config {
    /// The configuration of a preset.
    ///
    /// # Errors
    /// [`Error::Value`] names the presets if there is none of this name.
    pub fn preset(name: &str) -> Result<Self> {
        Self::preset_with(name, &[])
    }

    /// A preset with overrides `("losses.normal", "0.5")` applied.
    ///
    /// # Errors
    /// [`Error::Value`] for an unknown preset or a value of the wrong kind or range, [`Error::UnknownSetting`] for a key.
    pub fn preset_with(name: &str, settings: &[(String, String)]) -> Result<Self> {
        let names: Vec<_> = PRESETS.iter().map(|(name, _)| *name).collect();
        let (_, text) = PRESETS.iter().find(|(preset, _)| *preset == name).ok_or_else(|| {
            Error::from(InputError::Value {
                name: "preset".into(),
                found: format!("`{name}`"),
                expected: format!("one of {}", names.join(", ")),
            })
        })?;
        let mut table: toml::Table = text.parse().map_err(|error| malformed(Path::new(name), &error))?;
        for (key, value) in settings {
            override_key(&mut table, key, value)?;
        }
        let config: Self = table.try_into().map_err(|error: toml::de::Error| {
            Error::from(InputError::Value {
                name: settings.iter().map(|(key, _)| key.as_str()).collect::<Vec<_>>().join(", "),
                found: settings.iter().map(|(_, value)| value.as_str()).collect::<Vec<_>>().join(", "),
                expected: error.message().into(),
            })
        })?;
        config.validate()?;
        Ok(config)
    }

    /// Reads a run's `config.toml`.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Malformed`], naming the file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        let config: Self = toml::from_str(&text).map_err(|error| malformed(path, &error))?;
        config.validate()?;
        Ok(config)
    }

    /// The text of `config.toml`.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    fn validate(&self) -> Result<()> {
        let positive = |name: &str, value: f64| match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => refuse(name, value, "a positive number"),
        };
        let within = |name: &str, value: f64, maximum: f64| match (0.0..=maximum).contains(&value) {
            true => Ok(()),
            false => refuse(name, value, &format!("between 0 and {maximum}")),
        };
        positive("optimiser.learning_rate", self.optimiser.learning_rate)?;
        positive("optimiser.grid_learning_rate", self.optimiser.grid_learning_rate)?;
        positive("optimiser.colour_grid_learning_rate", self.optimiser.colour_grid_learning_rate)?;
        within("optimiser.voxel_learning_rate", self.optimiser.voxel_learning_rate, 1e3)?;
        positive("optimiser.clip", self.optimiser.clip)?;
        positive("optimiser.final_share", self.optimiser.final_share)?;
        positive("optimiser.batch_frames", self.optimiser.batch_frames as f64)?;
        positive("sampling.extent", self.sampling.extent.into())?;
        positive("sampling.deviation", self.sampling.deviation.into())?;
        within("sampling.points", self.sampling.points as f64, 1e7)?;
        positive("sampling.points", self.sampling.points as f64)?;
        for (name, share) in [
            ("sampling.body_share", self.sampling.body_share),
            ("sampling.face_share", self.sampling.face_share),
            ("sampling.hand_share", self.sampling.hand_share),
        ] {
            within(name, share, 1.0)?;
        }
        positive("losses.truncation", self.losses.truncation)?;
        positive("schedule.checkpoint_steps", self.schedule.checkpoint_steps as f64)?;
        positive("schedule.checkpoints_kept", self.schedule.checkpoints_kept as f64)?;
        match &self.fields.skinning {
            SkinningSettings::Network(shape) => positive("fields.skinning.blend", shape.blend.into())?,
            SkinningSettings::Voxels(shape) => {
                for (name, spacing) in [("spacing", shape.spacing), ("fine_spacing", shape.fine_spacing)] {
                    positive(&format!("fields.skinning.{name}"), spacing.into())?;
                }
            }
        }
        if let SearchedField::Baked { nodes, refresh_steps } = self.searched_field {
            positive("searched_field.refresh_steps", refresh_steps as f64)?;
            for count in nodes {
                within("searched_field.nodes", count as f64, 512.0)?;
            }
        }
        within("sampling.wide_share", self.sampling.wide_share.into(), 1.0)?;
        positive("sampling.wide_deviation", self.sampling.wide_deviation.into())?;
        within("fields.condition_dropout", self.fields.condition_dropout, 1.0)?;
        within("schedule.minutes", self.schedule.minutes, 1e6)?;
        within("schedule.most_epochs", self.schedule.most_epochs as f64, 1e9)?;
        for (name, weight) in [
            ("losses.occupancy", self.losses.occupancy),
            ("losses.distance", self.losses.distance),
            ("losses.normal", self.losses.normal),
            ("losses.colour", self.losses.colour),
            ("losses.bone", self.losses.bone),
            ("losses.joint", self.losses.joint),
            ("losses.surface", self.losses.surface),
            ("losses.volume", self.losses.volume),
            ("losses.eikonal", self.losses.eikonal),
            ("losses.free_space", self.losses.free_space),
        ] {
            within(name, weight, 1e6)?;
        }
        if let Some(rgbd) = &self.rgbd {
            within("rgbd.eyes_mouth_share", rgbd.eyes_mouth_share, self.sampling.face_share)?;
            within("rgbd.hand_depth", rgbd.hand_depth.into(), 1.0)?;
            within("rgbd.free_points", rgbd.free_points as f64, 1e7)?;
            within("rgbd.unseen_points", rgbd.unseen_points as f64, 1e7)?;
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

/// Replaces the value of a dotted key that the preset has, reading `value` as TOML or else as a bare string.
fn override_key(table: &mut toml::Table, key: &str, value: &str) -> Result<()> {
    let unknown = |table: &toml::Table| {
        let mut keys = Vec::new();
        collect_keys(table, "", &mut keys);
        let nearest = keys.into_iter().min_by_key(|known| strsim::damerau_levenshtein(known, key));
        Error::UnknownSetting { key: key.into(), nearest: nearest.unwrap_or_default() }
    };
    let complete = table.clone();
    let (parents, last) = key.rsplit_once('.').map_or((None, key), |(parents, last)| (Some(parents), last));
    let mut target = table;
    for name in parents.into_iter().flat_map(|parents| parents.split('.')) {
        target = match target.get_mut(name) {
            Some(toml::Value::Table(inner)) => inner,
            _ => return Err(unknown(&complete)),
        };
    }
    let Some(slot) = target.get_mut(last).filter(|slot| !slot.is_table()) else { return Err(unknown(&complete)) };
    let parsed = format!("value = {value}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("value"));
    *slot = match (parsed.unwrap_or_else(|| value.into()), &slot) {
        (toml::Value::Integer(integer), toml::Value::Float(_)) => toml::Value::Float(integer as f64),
        (value, _) => value,
    };
    Ok(())
}

fn collect_keys(table: &toml::Table, prefix: &str, keys: &mut Vec<String>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => collect_keys(inner, &format!("{prefix}{key}."), keys),
            _ => keys.push(format!("{prefix}{key}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(key: &str, value: &str) -> Result<Config> {
        Config::preset_with("fast", &[(key.into(), value.into())])
    }

    #[test]
    fn every_preset_is_valid_and_survives_its_own_text() {
        for (name, _) in PRESETS {
            let config = Config::preset(name).unwrap();
            assert_eq!(config.preset, name);
            assert_eq!(toml::from_str::<Config>(&config.to_toml()).unwrap(), config);
        }
    }

    #[test]
    fn settings_override_the_preset() {
        assert_eq!(set("losses.normal", "0.25").unwrap().losses.normal, 0.25);
        assert_eq!(set("losses.normal", "3").unwrap().losses.normal, 3.0);
        assert_eq!(set("sampling.strategy", "uniform").unwrap().sampling.strategy, SamplingStrategy::Uniform);
        assert_eq!(set("fields.geometry.width", "64").unwrap().fields.geometry.width, 64);
    }

    #[test]
    fn unknown_keys_suggest_the_nearest() {
        for (key, nearest) in [("losses.normals", "losses.normal"), ("optimizer.clip", "optimiser.clip")] {
            match set(key, "1") {
                Err(Error::UnknownSetting { nearest: found, .. }) => assert_eq!(found, nearest),
                other => panic!("{other:?}"),
            }
        }
        assert!(matches!(set("losses", "1"), Err(Error::UnknownSetting { .. })));
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
