//! How a skinning field hangs on the body model: a grid's nodes are bound to places on the canonical body, a network is free.

use glam::Vec3;
use xavatar_deformer::StartGroups;

use super::{Kind, Skinning};
use crate::Result;
use crate::body::{BodyModel, PartLabels, Skeleton};
use crate::config::{SkinningSettings, SkinningShape, Starts};
use crate::fields::{CanonicalGrid, NodeRows, start_groups, union_start_groups};

/// What the skinning fields of one configuration and one body have in common.
#[derive(Debug)]
pub struct SkinningBinding(Bound);

#[derive(Debug)]
enum Bound {
    Network(SkinningShape),
    Grid(Box<CanonicalGrid>),
}

impl SkinningBinding {
    /// The binding to the canonical body of `betas`.
    ///
    /// # Errors
    /// If the grid's spacing is out of range.
    pub fn new(settings: &SkinningSettings, body: &BodyModel, labels: &PartLabels, betas: &[f32]) -> Result<Self> {
        Ok(Self(match settings {
            SkinningSettings::Network(shape) => Bound::Network(shape.clone()),
            SkinningSettings::Voxels(shape) => Bound::Grid(Box::new(CanonicalGrid::new(body, labels, betas, *shape)?)),
        }))
    }

    /// The field that training begins with: a network of zeros, or what `rows` finds for the nodes of the grid.
    ///
    /// # Errors
    /// If an extent is out of range, or a node has no weights; those of `rows`.
    pub fn initial(
        &self,
        body: &BodyModel,
        rows: impl FnOnce(&CanonicalGrid) -> Result<NodeRows>,
    ) -> Result<Skinning<f32>> {
        match &self.0 {
            Bound::Network(shape) => Skinning::network(shape, body.skeleton()),
            Bound::Grid(grid) => {
                let rows = rows(grid)?;
                Ok(Skinning::grid(grid.skinning(body, &rows)?, rows.worn))
            }
        }
    }

    /// From which bones training points are searched.
    ///
    /// # Errors
    /// As [`start_groups`].
    pub fn training_groups(&self, starts: Starts, skeleton: &Skeleton) -> Result<StartGroups> {
        match &self.0 {
            Bound::Network(_) => start_groups(starts, skeleton),
            // Pruned starts cost little: a point beside a hand finds the hand's root, and the body's.
            Bound::Grid(_) => union_start_groups(starts, skeleton),
        }
    }

    /// Lets searches that start from `groups` skip starts that can reach no cell near or inside the body; a network knows no cells.
    ///
    /// # Errors
    /// If the field is on another grid.
    pub fn prune_starts(&self, skinning: &mut Skinning<f32>, groups: &StartGroups) -> Result<()> {
        match (&self.0, &mut skinning.kind) {
            (Bound::Grid(grid), Kind::Grid(field)) => grid.prune_starts(field, groups, &skinning.worn),
            _ => Ok(()),
        }
    }

    /// The offsets at a grid's nodes (R) of a body whose vertices move by `offsets` (V).
    pub fn node_offsets(&self, offsets: &[Vec3]) -> Option<Vec<[f32; 3]>> {
        match &self.0 {
            Bound::Network(_) => None,
            Bound::Grid(grid) => Some(grid.node_offsets(offsets)),
        }
    }
}
