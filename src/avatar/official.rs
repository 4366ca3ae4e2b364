//! Avatars from checkpoints of the released X-Avatar code (METHOD section 9).
//!
//! A `.pth` holds three state dicts, a Lightning `.ckpt` one with prefixes; beside it lies `meta_info.npz` with gender, shape and
//! representation. Parameters have this library's names and shapes: the networks' extents are read off them, and nothing is
//! converted. The skeleton comes from the user's own body model; what the checkpoint keeps of one is left out.

use std::path::{Path, PathBuf};

use xavatar_network::{GeometryShape, KinematicTree, Representation, TextureShape};

use super::{Avatar, Subject};
use crate::body::{BodyModel, Gender, Skeleton, smplx};
use crate::config::{Config, SkinningSettings, SkinningShape};
use crate::fields::{Condition, Fields, PerField, canonical_box};
use crate::formats::{Array, ArrayMap, Value, read_npz, read_torch};
use crate::{Error, InputError, Result};
use xavatar_formats::TensorFile;

const CHECKPOINT: &str = "X-Avatar checkpoint";
/// Factor on the skinning logits, fixed in the released code.
const BLEND: u32 = 20;
/// State dicts of a `.pth`, with what precedes a parameter's name in each.
const STATE_DICTS: PerField<(&str, &str)> = PerField {
    geometry: ("shapenet_state_dict", ""),
    texture: ("colornet_state_dict", ""),
    skinning: ("deformer_state_dict", "lbs_network."),
};
/// What precedes a parameter's name in the one state dict of a `.ckpt`.
const PREFIXES: PerField<&str> =
    PerField { geometry: "shape_net.", texture: "color_net.", skinning: "deformer.lbs_network." };

/// What `meta_info.npz` says of a checkpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct OfficialMeta {
    /// The body model's gender.
    pub gender: Gender,
    /// Shape coefficients.
    pub betas: Vec<f32>,
    /// What the geometry network's output means.
    pub representation: Representation,
}

impl OfficialMeta {
    /// Reads a `meta_info.npz`.
    ///
    /// # Errors
    /// [`InputError::Mismatch`] names the array that is missing or says something unknown.
    pub fn read(path: &Path) -> Result<Self> {
        let arrays = read_npz(path)?;
        let refuse = |found: String, expected: &str| {
            Error::from(InputError::Mismatch {
                path: path.into(),
                found,
                expected: expected.into(),
                remedy: "pass the meta_info.npz that lies beside the checkpoint".into(),
            })
        };
        let text = |key: &str| {
            let text = arrays.get(key).and_then(Array::text);
            text.ok_or_else(|| refuse(found(&arrays, key), &format!("text `{key}`")))
        };
        let betas = arrays.get("betas").and_then(Array::to_f32);
        Ok(Self {
            gender: text("gender")?.parse().map_err(|_| refuse(found(&arrays, "gender"), "neutral, female or male"))?,
            betas: betas
                .filter(|betas| betas.len() == smplx::SHAPES && betas.iter().all(|beta| beta.is_finite()))
                .ok_or_else(|| refuse(found(&arrays, "betas"), "10 finite numbers `betas`"))?,
            representation: match text("representation")? {
                "occ" => Representation::Occupancy,
                "sdf" => Representation::SignedDistance,
                _ => return Err(refuse(found(&arrays, "representation"), "`representation` \"occ\" or \"sdf\"")),
            },
        })
    }
}

fn found(arrays: &ArrayMap, key: &str) -> String {
    arrays.get(key).map_or_else(|| format!("no `{key}`"), |array| format!("`{key}` {}", array.description()))
}

impl Avatar {
    /// The avatar of an official checkpoint, on the skeleton of `body` in the shape that `meta` says.
    ///
    /// # Errors
    /// Those of [`read_torch`]; [`InputError::Mismatch`] names a network or parameter that is not as METHOD section 9 says.
    pub fn from_official(checkpoint: &Path, meta: &OfficialMeta, body: &BodyModel) -> Result<Self> {
        let value = read_torch(checkpoint)?;
        let networks = Networks::of(checkpoint, &value)?;
        let (skeleton, condition) = (body.skeleton(), Condition::new(body.skeleton(), body.expression_coefficients()));
        let config = networks.configuration(meta.representation, &condition, skeleton)?;
        let bounds = canonical_box(body.skeleton(), &body.canonical_vertices(&meta.betas, &[])?);
        let fields = Fields::read(&networks.tensors, checkpoint, &config.fields, skeleton, &condition, bounds)
            .map_err(|error| networks.refuse(error.to_string(), "parameters that fit one another"))?;
        let mut known = TensorFile::default();
        fields.insert_into(&mut known);
        let [found, known] = [&networks.tensors, &known].map(|file| file.tensors.len());
        if found != known {
            return Err(networks.refuse(format!("{found} parameters"), &format!("{known}")));
        }
        // The checkpoint does not say how many frames there were.
        let subject = Subject::of(body, meta.gender, &meta.betas, bounds, 0)?;
        let steps = match value.get("global_step") {
            Some(&Value::Int(steps)) => u64::try_from(steps).unwrap_or(0),
            _ => 0,
        };
        Ok(Self { fields, config, subject, steps })
    }
}

/// The parameters of a checkpoint, as an avatar file would hold them.
struct Networks {
    path: PathBuf,
    /// `field.parameter`.
    tensors: TensorFile,
}

/// The extents of one network.
struct Extents {
    /// Columns of the first layer.
    inputs: usize,
    depth: usize,
    width: usize,
    /// The layer that the encoded input joins, and how long that is.
    skip: Option<(usize, usize)>,
    outputs: usize,
}

impl Networks {
    fn of(path: &Path, value: &Value) -> Result<Self> {
        let mut networks = Self { path: path.into(), tensors: TensorFile::default() };
        if let Some(state) = value.get("state_dict") {
            for (field, prefix) in PREFIXES.named() {
                networks.insert(field, prefix, state)?;
            }
        } else {
            for (field, (key, prefix)) in STATE_DICTS.named() {
                let state = value.get(key).ok_or_else(|| {
                    networks.refuse(
                        format!("no `{key}`"),
                        "`shapenet_state_dict`, `deformer_state_dict` and `colornet_state_dict`, or a `state_dict`",
                    )
                })?;
                networks.insert(field, prefix, state)?;
            }
        }
        Ok(networks)
    }

    /// Takes one network's parameters out of a state dict.
    fn insert(&mut self, field: &str, prefix: &str, state: &Value) -> Result<()> {
        let Value::Dict(entries) = state else {
            return Err(self.refuse(format!("{} of parameters", state.kind()), "a dict"));
        };
        let before = self.tensors.tensors.len();
        for (key, value) in entries {
            let Value::Text(key) = key else { continue };
            let Some(name) = key.strip_prefix(prefix) else { continue };
            let Value::Array(array) = value else {
                return Err(self.refuse(format!("{} `{key}`", value.kind()), "a tensor"));
            };
            let values = array.to_f32().unwrap_or_default();
            self.tensors.tensors.insert(format!("{field}.{name}"), (array.shape.clone(), values));
        }
        if self.tensors.tensors.len() == before {
            return Err(self.refuse(format!("no parameter `{prefix}...` of the {field} network"), "that network"));
        }
        Ok(())
    }

    /// The configuration of the paper for scans or RGB-D, with the extents of these networks.
    fn configuration(
        &self,
        representation: Representation,
        condition: &Condition,
        skeleton: &Skeleton,
    ) -> Result<Config> {
        let geometry = self.extents("geometry")?;
        let texture = self.extents("texture")?;
        let skinning = self.extents("skinning")?;
        let [embedded, entries] = self.shape("geometry.lin_p0.weight")?;
        if entries != condition.width() {
            return Err(self.refuse(
                format!("a condition of {entries} entries"),
                &format!("{}: body pose and expression of {}", condition.width(), skeleton.family),
            ));
        }
        let logits = KinematicTree::new(&skeleton.parents)?.logits();
        if skinning.outputs != logits {
            return Err(self.refuse(
                format!("a skinning network of {} logits", skinning.outputs),
                &format!("{logits}: the hierarchical softmax over {}", skeleton.family),
            ));
        }
        let encoded = |extents: &Extents, condition: usize| extents.inputs.checked_sub(condition);
        let mut config = Config::preset(match representation {
            Representation::Occupancy => "paper-scan",
            Representation::SignedDistance => "paper-rgbd",
        })?;
        config.fields.representation = representation;
        config.fields.geometry = GeometryShape {
            depth: geometry.depth,
            width: geometry.width,
            frequencies: self.frequencies("geometry", encoded(&geometry, embedded), 3, &geometry)?,
            skip: geometry.skip.map(|(layer, _)| layer),
            embedded,
            grid: None,
        };
        config.fields.texture = TextureShape {
            depth: texture.depth,
            width: texture.width,
            frequencies: self.frequencies("texture", encoded(&texture, embedded + geometry.width), 6, &texture)?,
            skip: texture.skip.map(|(layer, _)| layer),
            grid: None,
            normal: true,
            features: true,
        };
        config.fields.skinning = SkinningSettings::Network(SkinningShape {
            depth: skinning.depth,
            width: skinning.width,
            frequencies: self.frequencies("skinning", encoded(&skinning, 0), 3, &skinning)?,
            blend: BLEND,
        });
        Ok(config)
    }

    /// Reads a network's extents off its layers.
    fn extents(&self, field: &str) -> Result<Extents> {
        let has = |layer: &usize| self.tensors.tensors.contains_key(&format!("{field}.lin{layer}.bias"));
        let layers = (0..).take_while(has).map(|layer| self.shape(&format!("{field}.lin{layer}.weight_v")));
        let layers: Vec<_> = layers.collect::<Result<_>>()?;
        let [[_, inputs], [_, width], ..] = layers[..] else {
            return Err(
                self.refuse(format!("{} layers `lin0` ... in the {field} network", layers.len()), "at least two")
            );
        };
        let depth = layers.len() - 1;
        let narrow = (0..depth).find(|layer| layers[*layer][0] < width);
        let skip = narrow.map(|layer| (layer + 1, width - layers[layer][0]));
        Ok(Extents { inputs, depth, width, skip, outputs: layers[depth][0] })
    }

    /// The number of frequencies that encode `coordinates` numbers as `encoded`, which must be what the skip joins.
    fn frequencies(&self, field: &str, encoded: Option<usize>, coordinates: usize, extents: &Extents) -> Result<usize> {
        let refuse = || {
            self.refuse(
                format!("a {field} network of {} inputs", extents.inputs),
                &format!("{coordinates} encoded coordinates and the condition"),
            )
        };
        let encoded = encoded.filter(|encoded| extents.skip.is_none_or(|(_, joined)| joined == *encoded));
        let bands = encoded.filter(|encoded| encoded % coordinates == 0).map(|encoded| encoded / coordinates);
        bands.filter(|bands| bands % 2 == 1).map(|bands| bands / 2).ok_or_else(refuse)
    }

    fn shape(&self, name: &str) -> Result<[usize; 2]> {
        let shape = self.tensors.tensors.get(name).map(|(shape, _)| shape.as_slice());
        match shape {
            Some(&[rows, columns]) => Ok([rows, columns]),
            Some(other) => Err(self.refuse(format!("`{name}` of shape {other:?}"), "rows and columns")),
            None => Err(self.refuse(format!("no `{name}`"), "that parameter")),
        }
    }

    fn refuse(&self, found: String, expected: &str) -> Error {
        Error::from(InputError::Mismatch {
            path: self.path.clone(),
            found,
            expected: expected.into(),
            remedy: format!("pass an {CHECKPOINT} of a SMPL-X subject (.pth, or Lightning's .ckpt)").into(),
        })
    }
}
