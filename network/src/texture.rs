//! The texture field: canonical point and deformed normal to colour (thesis ch. 4.2.6, fig. A.5).
//!
//! Input [x_c | n_d] encoded, condition [embedded c | geometry's last hidden activations]; sigmoid of the output, sRGB in [0, 1].
//! No gradient flows into the geometry's activations (METHOD section 8).

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::encoding::{Bounds, EncodingShape, HashGridShape};
use crate::mlp::{Mlp, MlpShape};
use crate::{Real, Result};

/// The extents of a [`TextureField`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureShape {
    /// Hidden layers (thesis: 8).
    pub depth: usize,
    /// Units a layer (thesis: 256).
    pub width: usize,
    /// Frequencies of the encoding (thesis: 4).
    #[serde(default)]
    pub frequencies: usize,
    /// The layer the encoded input is joined to (thesis: 4); none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skip: Option<usize>,
    /// A hash grid in the place of the frequencies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<HashGridShape>,
    /// Whether the field sees the deformed normal (thesis), or the canonical point alone.
    #[serde(default = "sees_normal")]
    pub normal: bool,
    /// Whether the field sees the geometry's last hidden activations (thesis).
    #[serde(default = "sees_features")]
    pub features: bool,
}

fn sees_features() -> bool {
    true
}

fn sees_normal() -> bool {
    true
}

/// The texture field.
#[derive(Clone, Debug)]
pub struct TextureField<T> {
    /// The network, below the sigmoid.
    pub mlp: Mlp<T>,
}

impl<T: Real> TextureField<T> {
    /// A field that sees `embedded` condition entries and, if it sees any, `features` geometry activations, all parameters zero. A grid fills `bounds`.
    ///
    /// # Errors
    /// [`crate::Error::Shape`] names the extent that is out of range.
    pub fn new(shape: &TextureShape, embedded: usize, features: usize, bounds: Bounds) -> Result<Self> {
        let mlp = Mlp::new(MlpShape {
            inputs: if shape.normal { 6 } else { 3 },
            encoding: EncodingShape::of(shape.grid, bounds, shape.frequencies),
            condition: 0,
            embedded,
            row_condition: if shape.features { features } else { 0 },
            depth: shape.depth,
            width: shape.width,
            skip: shape.skip,
            outputs: 3,
        })?;
        Ok(Self { mlp })
    }

    /// Whether its input is a point with the deformed normal there, not the point alone.
    pub fn sees_normals(&self) -> bool {
        self.mlp.shape().inputs == 6
    }

    /// What it is given of the geometry's activations (R, features): all or none.
    pub fn seen<'a>(&self, features: &'a [T]) -> &'a [T] {
        if self.mlp.shape().row_condition == 0 { &[] } else { features }
    }

    /// Draws the parameters as PyTorch's `Linear` does.
    pub fn initialise(&mut self, random: &mut impl Rng) {
        self.mlp.initialise_uniform(random);
    }

    /// Turns outputs (N, 3) into colours in [0, 1].
    pub fn colours(output: &[T], colours: &mut [T]) {
        for (colour, value) in colours.iter_mut().zip(output) {
            *colour = T::one() / (T::one() + (-*value).exp());
        }
    }

    /// Turns the cotangent of colours (N, 3) into that of the outputs, in place.
    pub fn colours_backward(colours: &[T], cotangent: &mut [T]) {
        for (cotangent, colour) in cotangent.iter_mut().zip(colours) {
            *cotangent *= *colour * (T::one() - *colour);
        }
    }
}
