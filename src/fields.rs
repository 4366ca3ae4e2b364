//! The three fields of an avatar together, their parameters and gradients.

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar_deformer::GradientSide;
use xavatar_network::{
    Bounds, GeometryField, KinematicTree, Mlp, MlpGradient, Real, Representation, SkinningField, TextureField,
};

use crate::Result;
use crate::body::{BodyParameters, PARENTS};
use crate::config::FieldSettings;

/// Entries of the condition c = [theta_b / pi, psi]: 63 of the body pose, 10 of the expression.
pub const CONDITION: usize = 73;

/// The condition of a pose and expression.
pub fn condition(parameters: &BodyParameters) -> Vec<f32> {
    let pose = parameters.body_pose.iter().flat_map(|joint| (joint.0 / std::f32::consts::PI).to_array());
    pose.chain(parameters.expression).collect()
}

/// The SMPL-X kinematic tree, for [`Fields::new`].
pub fn skeleton_parents() -> Vec<Option<usize>> {
    PARENTS.iter().enumerate().map(|(joint, parent)| (joint > 0).then_some(*parent)).collect()
}

/// Geometry, texture and skinning of one avatar.
#[derive(Clone, Debug)]
pub struct Fields<T> {
    /// Where the body is.
    pub geometry: GeometryField<T>,
    /// What colour it has.
    pub texture: TextureField<T>,
    /// Which bones move it.
    pub skinning: SkinningField<T>,
}

/// One value for each of the three fields, in the order geometry, texture, skinning.
pub type PerField<V> = [V; 3];

/// The fields' names, as checkpoints and avatar files prefix their parameters.
pub const FIELD_NAMES: PerField<&str> = ["geometry", "texture", "skinning"];

impl<T: Real> Fields<T> {
    /// Fields of the given extents over a kinematic tree, all parameters zero; grids fill `bounds`, the canonical box.
    ///
    /// # Errors
    /// If an extent is out of range.
    pub fn new(settings: &FieldSettings, parents: &[Option<usize>], bounds: (Vec3, Vec3)) -> Result<Self> {
        let bounds = Bounds { lowest: bounds.0.to_array(), highest: bounds.1.to_array() };
        let geometry = GeometryField::new(&settings.geometry, CONDITION, settings.representation, bounds)?;
        let texture =
            TextureField::new(&settings.texture, settings.geometry.embedded, settings.geometry.width, bounds)?;
        let shape = &settings.skinning;
        let tree = KinematicTree::new(parents)?;
        let skinning = SkinningField::new(tree, shape.depth, shape.width, shape.frequencies, shape.blend.into())?;
        Ok(Self { geometry, texture, skinning })
    }

    /// Draws the parameters; each field from a stream of its own.
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

    /// The three networks.
    pub fn networks(&self) -> PerField<&Mlp<T>> {
        [&self.geometry.mlp, &self.texture.mlp, self.skinning.mlp()]
    }

    /// The three networks, to update their parameters.
    pub fn networks_mut(&mut self) -> PerField<&mut Mlp<T>> {
        [&mut self.geometry.mlp, &mut self.texture.mlp, self.skinning.mlp_mut()]
    }

    /// Gradients of zeros.
    pub fn zero_gradients(&self) -> PerField<MlpGradient<T>> {
        self.networks().map(Mlp::zero_gradient)
    }

    /// Which way the geometry's gradient points.
    pub fn gradient_side(&self) -> GradientSide {
        match self.geometry.representation {
            Representation::Occupancy => GradientSide::Inward,
            Representation::SignedDistance => GradientSide::Outward,
        }
    }
}
