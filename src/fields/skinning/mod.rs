//! The field of skinning weights, a network or a grid: all that differs between the two is in this folder.
//!
//! A network (thesis) is trained towards the body model's weights at known points, through the Jacobians of normals and through the roots of
//! the search. A grid begins with the body model's weights and is trained through the roots alone; its logits are pulled to where
//! they began, and its warp carries the body model's blend shapes. N points, J joints, P parameters.

mod binding;
mod blend;
mod gradient;
mod stored;
mod warp;

use glam::Vec3;
use rand::Rng;
use xavatar_deformer::{BakedWeights, Grid, VoxelSkinning};
use xavatar_network::{KinematicTree, Real, SkinningField, SkinningTrace, SkinningWeights};

pub use binding::SkinningBinding;
pub use blend::Blend;
pub use gradient::{SkinningGradient, SummedSkinning};
pub use warp::PosedWarp;
pub(super) use warp::image;

use crate::Result;
use crate::body::Skeleton;
use crate::config::{SearchedField, SkinningShape};

/// The field of skinning weights.
#[derive(Clone, Debug)]
pub struct Skinning<T> {
    kind: Kind<T>,
    /// At which nodes of a grid (R) something is worn; empty if that is not known.
    worn: Vec<bool>,
}

#[derive(Clone, Debug)]
enum Kind<T> {
    /// A network with a tree-structured softmax (thesis).
    Network(SkinningField<T>),
    /// Logits at the nodes of a grid.
    Grid(VoxelSkinning<T>),
}

impl<T: Real> Skinning<T> {
    /// A network over a skeleton, all parameters zero.
    ///
    /// # Errors
    /// If an extent is out of range.
    pub fn network(shape: &SkinningShape, skeleton: &Skeleton) -> Result<Self> {
        let tree = KinematicTree::new(&skeleton.parents)?;
        let field = SkinningField::new(tree, shape.depth, shape.width, shape.frequencies, shape.blend.into())?;
        Ok(Self { kind: Kind::Network(field), worn: Vec::new() })
    }

    /// A field that is a grid, with the nodes (R) that something is worn at, or none if that is not known.
    pub fn grid(field: VoxelSkinning<T>, worn: Vec<bool>) -> Self {
        Self { kind: Kind::Grid(field), worn }
    }

    /// Draws a network's parameters; a grid has its own from the body model.
    pub fn initialise(&mut self, random: &mut impl Rng) {
        if let Kind::Network(field) = &mut self.kind {
            field.initialise(random);
        }
    }

    /// Weights (N, J) and their gradients (N, 3, J) at canonical points (N).
    pub fn weights_and_gradients(
        &self,
        trace: &mut SkinningTrace<T>,
        points: &[[T; 3]],
        weights: &mut [T],
        gradients: &mut [T],
    ) {
        match &self.kind {
            Kind::Network(field) => field.weights_and_gradients(trace, points, weights, gradients),
            Kind::Grid(field) => field.weights_and_gradients(&mut (), points, weights, gradients),
        }
    }

    /// Weights (N, J) at canonical points (N).
    pub fn weights(&self, trace: &mut SkinningTrace<T>, points: &[[T; 3]], weights: &mut [T]) {
        match &self.kind {
            Kind::Network(field) => field.weights(trace, points, weights),
            Kind::Grid(field) => field.weights(&mut (), points, weights),
        }
    }

    /// J.
    pub fn joints(&self) -> usize {
        match &self.kind {
            Kind::Network(field) => field.joints(),
            Kind::Grid(field) => field.joints(),
        }
    }

    /// The parameters (P): a network's, or a grid's logits.
    pub fn parameters(&self) -> &[T] {
        match &self.kind {
            Kind::Network(field) => field.mlp().parameters(),
            Kind::Grid(field) => field.parameters(),
        }
    }

    /// Changes the parameters (P).
    pub fn update(&mut self, change: impl FnOnce(&mut [T])) {
        match &mut self.kind {
            Kind::Network(field) => field.mlp_mut().update(change),
            Kind::Grid(field) => field.update(change),
        }
    }

    /// Nodes of the grid, where that is what it is.
    pub fn nodes(&self) -> Option<usize> {
        match &self.kind {
            Kind::Network(_) => None,
            Kind::Grid(field) => Some(field.baked().grid().len()),
        }
    }

    /// Whether it is trained towards the weights that known points should have.
    pub fn follows_weights(&self) -> bool {
        matches!(self.kind, Kind::Network(_))
    }

    /// Whether its warp carries the body model's blend shapes: then what expression and pose add is no matter of the geometry field.
    pub fn carries_blend_shapes(&self) -> bool {
        matches!(self.kind, Kind::Grid(_))
    }
}

impl Skinning<f32> {
    /// A network sampled on the grid over `bounds` that the search runs on; none if it runs on the field itself.
    ///
    /// # Errors
    /// If the box is empty or the grid too large.
    pub fn bake(&self, searched: SearchedField, bounds: (Vec3, Vec3)) -> Result<Option<BakedWeights<f32>>> {
        match (&self.kind, searched) {
            (Kind::Network(field), SearchedField::Baked { nodes, .. }) => {
                let grid = Grid::regular(bounds.0.to_array(), bounds.1.to_array(), nodes)?;
                Ok(Some(BakedWeights::sample(field, grid)?))
            }
            _ => Ok(None),
        }
    }
}
