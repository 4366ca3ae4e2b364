//! Fields as named tensors: how checkpoints and avatar files hold them, under `field.parameter`.

use std::path::Path;

use glam::Vec3;
use xavatar_formats::TensorFile;
use xavatar_network::{Bounds, HashGridShape, Mlp};

use super::{Condition, Fields, Skinning};
use crate::body::Skeleton;
use crate::config::{FieldSettings, SkinningSettings};
use crate::{Error, InputError, Result};

const GEOMETRY: &str = "geometry";
const TEXTURE: &str = "texture";

impl Fields<f32> {
    /// The fields of these settings that are stored in the file at `path`; grids fill `bounds`, the canonical box.
    pub(crate) fn read(
        file: &TensorFile,
        path: &Path,
        settings: &FieldSettings,
        skeleton: &Skeleton,
        condition: &Condition,
        bounds: (Vec3, Vec3),
    ) -> Result<Self> {
        check_extents(file, settings, condition, bounds)?;
        let skinning = Skinning::stored(&settings.skinning, skeleton, file, path)?;
        let mut fields = Self::new(settings, condition, skinning, bounds)?;
        fields.load_from(file)?;
        Ok(fields)
    }

    /// Stores all parameters.
    pub(crate) fn insert_into(&self, file: &mut TensorFile) {
        insert_network(file, GEOMETRY, &self.geometry.mlp);
        insert_network(file, TEXTURE, &self.texture.mlp);
        self.skinning.insert_into(file);
    }

    /// Replaces all parameters by the stored ones.
    pub(crate) fn load_from(&mut self, file: &TensorFile) -> Result<()> {
        load_network(file, GEOMETRY, &mut self.geometry.mlp)?;
        load_network(file, TEXTURE, &mut self.texture.mlp)?;
        self.skinning.load_from(file)
    }
}

/// Refuses settings that claim more parameters than a file of any network like theirs holds, before memory is taken for them. That
/// they are the file's own shows when these are loaded.
fn check_extents(
    file: &TensorFile,
    settings: &FieldSettings,
    condition: &Condition,
    bounds: (Vec3, Vec3),
) -> Result<()> {
    let stored: usize = file.tensors.values().map(|(_, values)| values.len()).sum();
    let FieldSettings { geometry, texture, skinning, .. } = settings;
    let bounds = Bounds { lowest: bounds.0.to_array(), highest: bounds.1.to_array() };
    let table = |grid: &Option<HashGridShape>| match grid {
        Some(grid) => Ok::<_, Error>(grid.entries(&bounds)?.saturating_mul(grid.features)),
        None => Ok(0),
    };
    let seen = if texture.features { geometry.width } else { 0 };
    let hidden = |depth: usize, width: usize| width.saturating_mul(width).saturating_mul(depth.saturating_sub(1));
    let skinning = match skinning {
        SkinningSettings::Network(shape) => hidden(shape.depth, shape.width),
        SkinningSettings::Voxels(_) => 0,
    };
    let claims = [
        ("the geometry field's layers", hidden(geometry.depth, geometry.width)),
        ("the geometry field's grid", table(&geometry.grid)?),
        ("the embedding of a pose", geometry.embedded.saturating_mul(condition.width().saturating_add(geometry.width))),
        ("the texture field's layers", hidden(texture.depth, texture.width)),
        ("the texture field's grid", table(&texture.grid)?),
        ("the texture field's input", texture.width.saturating_mul(geometry.embedded.saturating_add(seen))),
        ("the skinning field's layers", skinning),
    ];
    match claims.into_iter().find(|(_, claimed)| *claimed > stored) {
        None => Ok(()),
        Some((what, claimed)) => Err(Error::from(InputError::Value {
            name: format!("the size of {what}"),
            found: format!("{claimed} parameters"),
            expected: format!("at most the {stored} that are stored"),
        })),
    }
}

/// Stores a network's parameters.
pub(super) fn insert_network(file: &mut TensorFile, name: &str, network: &Mlp<f32>) {
    for entry in network.layout().entries() {
        let values = network.parameters()[entry.range.clone()].to_vec();
        file.tensors.insert(format!("{name}.{}", entry.name), (entry.shape.clone(), values));
    }
}

/// Replaces a network's parameters by the stored ones.
pub(super) fn load_network(file: &TensorFile, name: &str, network: &mut Mlp<f32>) -> Result<()> {
    let prefix = format!("{name}.");
    let own = file.tensors.iter().filter_map(|(key, tensor)| Some((key.strip_prefix(&prefix)?.into(), tensor.clone())));
    let flat = network.layout().gather(&own.collect())?;
    network.update(|parameters| parameters.copy_from_slice(&flat));
    Ok(())
}
