//! The extents of the three fields.

use serde::{Deserialize, Serialize};
use xavatar_network::{GeometryShape, Representation, TextureShape};

use super::{positive, within};
use crate::Result;

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

/// How fine a skinning field's grid is: on a whole body; on a hand or a head alone it is finer, in proportion to its size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VoxelShape {
    /// Edge of a cell, metres.
    pub spacing: f32,
    /// Edge of a cell around hands and face, metres.
    pub fine_spacing: f32,
}

impl FieldSettings {
    pub(super) fn check(&self) -> Result<()> {
        within("fields.condition_dropout", self.condition_dropout, 1.0)?;
        match &self.skinning {
            SkinningSettings::Network(shape) => positive("fields.skinning.blend", shape.blend.into()),
            SkinningSettings::Voxels(shape) => {
                positive("fields.skinning.spacing", shape.spacing.into())?;
                positive("fields.skinning.fine_spacing", shape.fine_spacing.into())
            }
        }
    }
}
