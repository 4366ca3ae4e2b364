//! The three fields of an avatar together: their parameters, where a pose takes them, what they are at a point.
//!
//! [`Fields`] are geometry f, texture c and skinning w over canonical space. [`Poser`] takes them to a pose: a [`PosedField`] finds the
//! canonical points of deformed ones. [`FieldEvaluator`] says what the fields are at canonical points. Whether skinning is a network or
//! a grid is known to [`Skinning`] alone.

mod canonical_grid;
mod condition;
mod correspondence;
mod evaluate;
mod gradients;
mod per_field;
mod pose_fit;
mod posed;
mod skinning;
mod starts;
mod stored;

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar_deformer::GradientSide;
use xavatar_network::{Bounds, GeometryField, Real, Representation, TextureField};

pub use canonical_grid::{BodyPlaces, CanonicalGrid, NodeRows};
pub use condition::Condition;
pub use correspondence::{Correspondence, PosedField};
pub use evaluate::{BLOCK_ROWS, FieldEvaluator, Shade};
pub use gradients::{FieldGradients, FieldRates, SummedGradients};
pub use per_field::PerField;
pub(crate) use pose_fit::median;
pub use pose_fit::{CapturedPoints, FittedPose, PoseFit};
pub use posed::{FieldPose, Poser, bone_rows};
pub use skinning::{Blend, PosedWarp, Skinning, SkinningBinding, SkinningGradient, SummedSkinning};
pub use starts::{start_groups, union_start_groups};

pub(crate) use canonical_grid::{CERTAINLY_OUTSIDE, canonical_box};

use crate::Result;
use crate::config::FieldSettings;

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
        self.skinning.initialise(&mut stream(2));
    }

    /// The parameters of each field, flat.
    pub fn parameters(&self) -> PerField<&[T]> {
        PerField {
            geometry: self.geometry.mlp.parameters(),
            texture: self.texture.mlp.parameters(),
            skinning: self.skinning.parameters(),
        }
    }

    /// Which way the geometry's gradient points.
    pub fn gradient_side(&self) -> GradientSide {
        match self.geometry.representation {
            Representation::Occupancy => GradientSide::Inward,
            Representation::SignedDistance => GradientSide::Outward,
        }
    }
}
