//! The geometry field f: canonical points to occupancy logits or signed distances (thesis ch. 4.2.1, fig. A.5).
//!
//! 3 -> encoded, joined by the embedded condition c = [theta_b / pi, psi]; softplus layers with one skip; one output whose
//! zero level is the surface. The last hidden activations are the feature that the texture field sees.

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::encoding::{Bounds, EncodingShape, HashGridShape};
use crate::mlp::{Mlp, MlpShape};
use crate::{Real, Result};

/// What the geometry field's output means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Representation {
    /// A logit, positive inside.
    Occupancy,
    /// Metres to the surface, negative inside.
    SignedDistance,
}

impl Representation {
    /// The value of a point without any correspondence: surely outside.
    pub fn outside(self) -> f32 {
        match self {
            Self::Occupancy => -100.0,
            Self::SignedDistance => 1.0,
        }
    }

    /// +1 where the field grows outward, -1 where it grows inward: times the gradient, it points outward.
    pub fn outward(self) -> f32 {
        match self {
            Self::Occupancy => -1.0,
            Self::SignedDistance => 1.0,
        }
    }

    /// Whether `candidate` wins over `other` in the union of a point's correspondences: maximum occupancy, minimum distance.
    pub fn prefers(self, candidate: f32, other: f32) -> bool {
        self.outward() * candidate < self.outward() * other
    }
}

/// The extents of a [`GeometryField`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeometryShape {
    /// Hidden layers (thesis: 8).
    pub depth: usize,
    /// Units a layer (thesis: 512).
    pub width: usize,
    /// Frequencies of the point's encoding (thesis: 4).
    #[serde(default)]
    pub frequencies: usize,
    /// The layer the encoded point is joined to (thesis: 4); none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skip: Option<usize>,
    /// Entries of the embedded condition (thesis: 16); 0 for a field without one.
    pub embedded: usize,
    /// A hash grid in the place of the frequencies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<HashGridShape>,
}

/// The geometry field.
#[derive(Clone, Debug)]
pub struct GeometryField<T> {
    /// The network.
    pub mlp: Mlp<T>,
    /// What its output means.
    pub representation: Representation,
}

impl<T: Real> GeometryField<T> {
    /// A field under a condition of `condition` entries, all parameters zero. A grid fills `bounds`.
    ///
    /// # Errors
    /// [`crate::Error::Shape`] names the extent that is out of range.
    pub fn new(
        shape: &GeometryShape,
        condition: usize,
        representation: Representation,
        bounds: Bounds,
    ) -> Result<Self> {
        let mlp = Mlp::new(MlpShape {
            inputs: 3,
            encoding: EncodingShape::of(shape.grid, bounds, shape.frequencies),
            condition: if shape.embedded == 0 { 0 } else { condition },
            embedded: shape.embedded,
            row_condition: 0,
            depth: shape.depth,
            width: shape.width,
            skip: shape.skip,
            outputs: 1,
        })?;
        Ok(Self { mlp, representation })
    }

    /// Starts as a sphere of radius about 1 m.
    pub fn initialise(&mut self, random: &mut impl Rng) {
        self.mlp.initialise_sphere(1.0, random);
        if self.representation == Representation::Occupancy {
            self.mlp.negate_output();
        }
    }
}
