//! The three fields of an avatar together, their parameters and gradients.

mod condition;

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar_deformer::{GradientSide, VoxelSkinning};
use xavatar_network::{
    Bounds, GeometryField, KinematicTree, Mlp, Real, Representation, SkinningField, SkinningTrace, SkinningWeights,
    TextureField,
};

pub use self::condition::Condition;

use crate::Result;
use crate::body::Skeleton;
use crate::config::{FieldSettings, SkinningShape};

/// The field of skinning weights.
#[derive(Clone, Debug)]
pub enum Skinning<T> {
    /// A network with a tree-structured softmax (thesis).
    Network(SkinningField<T>),
    /// Logits at the nodes of a grid.
    Voxels(VoxelSkinning<T>),
}

impl<T: Real> Skinning<T> {
    /// A network over a skeleton, all parameters zero.
    ///
    /// # Errors
    /// If an extent is out of range.
    pub fn network(shape: &SkinningShape, skeleton: &Skeleton) -> Result<Self> {
        let tree = KinematicTree::new(&skeleton.parents)?;
        let field = SkinningField::new(tree, shape.depth, shape.width, shape.frequencies, shape.blend.into())?;
        Ok(Self::Network(field))
    }

    /// Weights (N, J) and their gradients (N, 3, J) at canonical points (N).
    pub fn weights_and_gradients(
        &self,
        trace: &mut SkinningTrace<T>,
        points: &[[T; 3]],
        weights: &mut [T],
        gradients: &mut [T],
    ) {
        match self {
            Self::Network(field) => field.weights_and_gradients(trace, points, weights, gradients),
            Self::Voxels(field) => field.weights_and_gradients(&mut (), points, weights, gradients),
        }
    }

    /// Weights (N, J) at canonical points (N).
    pub fn weights(&self, trace: &mut SkinningTrace<T>, points: &[[T; 3]], weights: &mut [T]) {
        match self {
            Self::Network(field) => field.weights(trace, points, weights),
            Self::Voxels(field) => field.weights(&mut (), points, weights),
        }
    }

    /// The voxels, if that is what it is.
    pub fn voxels(&self) -> Option<&VoxelSkinning<T>> {
        match self {
            Self::Network(_) => None,
            Self::Voxels(field) => Some(field),
        }
    }

    /// The voxels, to update them.
    pub fn voxels_mut(&mut self) -> Option<&mut VoxelSkinning<T>> {
        match self {
            Self::Network(_) => None,
            Self::Voxels(field) => Some(field),
        }
    }
}

/// Geometry, texture and skinning of one avatar.
#[derive(Clone, Debug)]
pub struct Fields<T> {
    /// Where the body is.
    pub geometry: GeometryField<T>,
    /// What colour it has.
    pub texture: TextureField<T>,
    /// Which bones move it.
    pub skinning: Skinning<T>,
}

/// The fields' names, as checkpoints and avatar files prefix their parameters.
pub const FIELD_NAMES: [&str; 3] = ["geometry", "texture", "skinning"];

impl<T: Real> Fields<T> {
    /// Fields of the given extents, geometry and texture all zero; grids fill `bounds`, the canonical box.
    ///
    /// # Errors
    /// If an extent is out of range.
    pub fn new(
        settings: &FieldSettings,
        condition: &Condition,
        skinning: Skinning<T>,
        bounds: (Vec3, Vec3),
    ) -> Result<Self> {
        let bounds = Bounds { lowest: bounds.0.to_array(), highest: bounds.1.to_array() };
        let geometry = GeometryField::new(&settings.geometry, condition.width(), settings.representation, bounds)?;
        let texture =
            TextureField::new(&settings.texture, settings.geometry.embedded, settings.geometry.width, bounds)?;
        Ok(Self { geometry, texture, skinning })
    }

    /// Draws the networks' parameters; each field from a stream of its own.
    pub fn initialise(&mut self, seed: u64) {
        let stream = |field: u64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(field);
            random
        };
        self.geometry.initialise(&mut stream(0));
        self.texture.initialise(&mut stream(1));
        if let Skinning::Network(field) = &mut self.skinning {
            field.initialise(&mut stream(2));
        }
    }

    /// The networks: geometry, texture and, where it is one, skinning.
    pub fn networks(&self) -> Vec<&Mlp<T>> {
        let mut networks = vec![&self.geometry.mlp, &self.texture.mlp];
        if let Skinning::Network(field) = &self.skinning {
            networks.push(field.mlp());
        }
        networks
    }

    /// The networks, to update their parameters.
    pub fn networks_mut(&mut self) -> Vec<&mut Mlp<T>> {
        let mut networks = vec![&mut self.geometry.mlp, &mut self.texture.mlp];
        if let Skinning::Network(field) = &mut self.skinning {
            networks.push(field.mlp_mut());
        }
        networks
    }

    /// Which way the geometry's gradient points.
    pub fn gradient_side(&self) -> GradientSide {
        match self.geometry.representation {
            Representation::Occupancy => GradientSide::Inward,
            Representation::SignedDistance => GradientSide::Outward,
        }
    }
}
