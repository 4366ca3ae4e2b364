//! The skinning field as tensors: a network's layers, or a grid's axes, the bones of its nodes and their logits.

use std::path::Path;

use xavatar_deformer::{Axis, Grid, VoxelSkinning};
use xavatar_formats::TensorFile;

use super::{Kind, Skinning};
use crate::body::Skeleton;
use crate::config::SkinningSettings;
use crate::fields::stored::{insert_network, load_network};
use crate::{Error, InputError, Result};

const NAME: &str = "skinning";
const AXES: [&str; 3] = ["skinning.axis_x", "skinning.axis_y", "skinning.axis_z"];
/// Bones of each node, then which, as f32: all that the file holds.
const BONE_COUNTS: &str = "skinning.bone_counts";
const BONES: &str = "skinning.bones";
const LOGITS: &str = "skinning.logits";
/// Numbers of the nodes that something is worn at, if any; avatars of before have none.
const WORN: &str = "skinning.worn";

impl Skinning<f32> {
    /// Stores the field.
    pub(crate) fn insert_into(&self, file: &mut TensorFile) {
        match &self.kind {
            Kind::Network(field) => insert_network(file, NAME, field.mlp()),
            Kind::Grid(field) => insert_grid(file, field, &self.worn),
        }
    }

    /// A field of these settings over a skeleton for [`Skinning::load_from`]: a network of zeros, or the grid that is stored in the file at `path`.
    pub(crate) fn stored(
        settings: &SkinningSettings,
        skeleton: &Skeleton,
        file: &TensorFile,
        path: &Path,
    ) -> Result<Self> {
        match settings {
            SkinningSettings::Network(shape) => Self::network(shape, skeleton),
            SkinningSettings::Voxels(_) => {
                let field = read_grid(skeleton.joints.len(), file, path)?;
                let worn = read_worn(file, field.baked().grid().len(), path)?;
                Ok(Self::grid(field, worn))
            }
        }
    }

    /// Replaces the parameters by the stored ones.
    pub(crate) fn load_from(&mut self, file: &TensorFile) -> Result<()> {
        let field = match &mut self.kind {
            Kind::Network(field) => return load_network(file, NAME, field.mlp_mut()),
            Kind::Grid(field) => field,
        };
        let stored = file.tensors.get(LOGITS).map(|(_, logits)| logits.as_slice()).unwrap_or_default();
        if stored.len() != field.parameters().len() {
            return Err(Error::from(InputError::Value {
                name: format!("the stored tensor `{LOGITS}`"),
                found: format!("{} entries", stored.len()),
                expected: format!("{}", field.parameters().len()),
            }));
        }
        field.update(|logits| logits.copy_from_slice(stored));
        Ok(())
    }
}

fn insert_grid(file: &mut TensorFile, field: &VoxelSkinning<f32>, worn: &[bool]) {
    let mut insert = |name: &str, values: Vec<f32>| {
        file.tensors.insert(name.into(), (vec![values.len()], values));
    };
    let (grid, weights) = (field.baked().grid(), field.baked().weights());
    for (name, axis) in AXES.into_iter().zip(grid.axes()) {
        insert(name, axis.nodes().to_vec());
    }
    let rows = || (0..grid.len()).map(|node| weights.row(node).0);
    insert(BONE_COUNTS, rows().map(|bones| bones.len() as f32).collect());
    insert(BONES, rows().flatten().map(|bone| f32::from(*bone)).collect());
    insert(LOGITS, field.parameters().to_vec());
    let worn: Vec<f32> = (0..worn.len()).filter(|node| worn[*node]).map(|node| node as f32).collect();
    if !worn.is_empty() {
        insert(WORN, worn);
    }
}

/// Which of `nodes` nodes something is worn at; none known if none is stored.
fn read_worn(file: &TensorFile, nodes: usize, path: &Path) -> Result<Vec<bool>> {
    let Some((_, numbers)) = file.tensors.get(WORN) else { return Ok(Vec::new()) };
    let mut worn = vec![false; nodes];
    for number in numbers {
        let node = *number as usize;
        match worn.get_mut(node) {
            Some(flag) if node as f32 == *number => *flag = true,
            _ => {
                return Err(Error::from(InputError::Malformed {
                    path: path.into(),
                    format: "avatar",
                    place: format!("tensor `{WORN}`"),
                    found: number.to_string(),
                    expected: format!("numbers of nodes, below {nodes}"),
                }));
            }
        }
    }
    Ok(worn)
}

fn read_grid(joints: usize, file: &TensorFile, path: &Path) -> Result<VoxelSkinning<f32>> {
    let broken = |name: &str| {
        Error::from(InputError::Malformed {
            path: path.into(),
            format: "avatar",
            place: format!("tensor `{name}`"),
            found: file.tensors.get(name).map_or("none".into(), |(shape, _)| format!("shape {shape:?}")),
            expected: "the grid, bones and logits of one skinning field".into(),
        })
    };
    let values = |name: &str| file.tensors.get(name).map(|(_, values)| values.as_slice()).ok_or_else(|| broken(name));
    let axis = |name: &str| Ok::<_, Error>(Axis::new(values(name)?.to_vec())?);
    let grid = Grid::new([axis(AXES[0])?, axis(AXES[1])?, axis(AXES[2])?])?;
    let mut bones = values(BONES)?.iter().map(|bone| *bone as usize);
    let mut rows = Vec::with_capacity(grid.len());
    for count in values(BONE_COUNTS)? {
        let row: Vec<usize> = bones.by_ref().take(*count as usize).collect();
        if row.len() as f32 != *count {
            return Err(broken(BONE_COUNTS));
        }
        rows.push(row);
    }
    Ok(VoxelSkinning::from_logits(grid, joints, &rows, values(LOGITS)?.to_vec())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::smplx;
    use crate::config::VoxelShape;

    #[test]
    fn what_is_worn_comes_back_and_a_file_without_it_reads() {
        let grid = Grid::<f32>::regular([0.0; 3], [1.0; 3], [3, 3, 3]).unwrap();
        let rows = vec![vec![(0, 1.0)]; grid.len()];
        let field = VoxelSkinning::new(grid, smplx::skeleton().joints.len(), &rows).unwrap();
        let worn: Vec<bool> = (0..rows.len()).map(|node| node % 4 == 1).collect();
        let settings = SkinningSettings::Voxels(VoxelShape { spacing: 0.5, fine_spacing: 0.5 });
        let mut file = TensorFile::default();
        Skinning::grid(field, worn.clone()).insert_into(&mut file);
        let read =
            |file: &TensorFile| Skinning::stored(&settings, smplx::skeleton(), file, Path::new("avatar")).unwrap();
        assert_eq!(read(&file).worn, worn);
        for wrong in [-1.0, 0.5, f32::NAN, rows.len() as f32] {
            file.tensors.insert(WORN.into(), (vec![1], vec![wrong]));
            let stored = Skinning::stored(&settings, smplx::skeleton(), &file, Path::new("avatar"));
            assert!(stored.unwrap_err().to_string().contains(WORN), "{wrong}");
        }
        file.tensors.remove(WORN);
        assert!(read(&file).worn.is_empty());
    }
}
