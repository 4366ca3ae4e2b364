//! Fields as named tensors: how checkpoints and avatar files hold them, under `field.parameter`.

use std::path::Path;

use glam::Vec3;
use xavatar_formats::TensorFile;
use xavatar_network::Mlp;

use super::{Condition, Fields, Skinning};
use crate::Result;
use crate::body::Skeleton;
use crate::config::FieldSettings;

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
