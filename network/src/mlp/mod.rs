//! A weight-normalised softplus network and its derivatives, by hand, over blocks of rows (thesis ch. 4.2.1, fig. A.5).
//!
//! a_0 = [e(x) | condition], z_l = W_l a_l + b_l, a_(l+1) = softplus(z_l), output z_L; one layer's input may be [a | e(x)] / sqrt 2.
//! With s = softplus'(z), the sweeps over the layers are:
//!   forward   a_(l+1) = softplus(W_l a_l + b_l)                          value, features
//!   down      u_(l-1) = s W_l^T u_l                                      input gradient g = e'(x)^T W_0^T u_0
//!   up        p_l = W_l v_l, v_(l+1) = s p_l, v_0 = e'(x) g_bar          carries g's cotangent, leaves beta (1 - s) u p on z
//!   backward  z_bar_(l-1) = s W_l^T z_bar_l + what up left               dW_l = z_bar a^T + u v^T
//!
//! Six matrix products a layer for a loss on g, three without. R rows a block, K tangent directions (0 or D), D coordinates,
//! E encoded entries, C condition entries. A block's activations stay in cache from the first sweep to the last.

mod gradient;
mod initialise;
mod shape;
mod sweeps;

use std::ops::Range;

use crate::encoding::Encoding;
use crate::parameters::ParameterLayout;
use crate::{Real, Result};

pub(crate) use gradient::for_each_touched;
pub use gradient::{MlpGradient, SummedGradient};
pub use shape::MlpShape;
pub use sweeps::{Backward, Trace};

/// One linear layer's extents and places: in the parameters (v, g, b) and in the folded weights (W, b).
#[derive(Clone, Debug)]
struct Layer {
    inputs: usize,
    outputs: usize,
    /// W = scale * g v / |v|: 1 / sqrt 2 where the encoded point is joined.
    scale: f64,
    direction: Range<usize>,
    magnitude: Range<usize>,
    bias: Range<usize>,
    folded_weight: Range<usize>,
    folded_bias: Range<usize>,
}

/// The linear layer that embeds the condition.
#[derive(Clone, Debug)]
struct Embedding {
    weight: Range<usize>,
    bias: Range<usize>,
}

/// A network: its parameters, and the plain weights they fold to.
#[derive(Clone, Debug)]
pub struct Mlp<T> {
    shape: MlpShape,
    encoding: Encoding,
    layout: ParameterLayout,
    /// The encoding's table, the first of the parameters: there its entries are aligned to their own size.
    table: Range<usize>,
    layers: Vec<Layer>,
    embedding: Option<Embedding>,
    parameters: Vec<T>,
    folded: Vec<T>,
    /// W^T of each layer, at the place of its W in `folded`: products with it need no gathering of columns.
    transposed: Vec<T>,
}

impl<T: Real> Mlp<T> {
    /// A network with every parameter zero.
    ///
    /// # Errors
    /// [`crate::Error::Shape`] names the extent that is out of range.
    pub fn new(shape: MlpShape) -> Result<Self> {
        let encoding = Encoding::new(&shape.encoding, shape.inputs)?;
        let encoded = encoding.width();
        shape.validate(encoded)?;
        let mut layout = ParameterLayout::default();
        let table = match encoding.table_shape() {
            [0, _] => 0..0,
            extents => layout.push("grid.table".into(), extents.to_vec()),
        };
        let mut layers = Vec::with_capacity(shape.depth + 1);
        let mut folded = 0;
        for index in 0..=shape.depth {
            let inputs = match index {
                0 => encoded + shape.embedded + shape.row_condition,
                _ => shape.width,
            };
            let outputs = match index {
                _ if index == shape.depth => shape.outputs,
                _ if shape.skip == Some(index + 1) => shape.width - encoded,
                _ => shape.width,
            };
            let direction = layout.push(format!("lin{index}.weight_v"), vec![outputs, inputs]);
            let magnitude = layout.push(format!("lin{index}.weight_g"), vec![outputs, 1]);
            let bias = layout.push(format!("lin{index}.bias"), vec![outputs]);
            let folded_weight = folded..folded + outputs * inputs;
            let folded_bias = folded_weight.end..folded_weight.end + outputs;
            folded = folded_bias.end;
            let scale = if shape.skip == Some(index) { std::f64::consts::FRAC_1_SQRT_2 } else { 1.0 };
            layers.push(Layer { inputs, outputs, scale, direction, magnitude, bias, folded_weight, folded_bias });
        }
        let embedding = (shape.condition > 0 && shape.embedded > 0).then(|| Embedding {
            weight: layout.push("lin_p0.weight".into(), vec![shape.embedded, shape.condition]),
            bias: layout.push("lin_p0.bias".into(), vec![shape.embedded]),
        });
        let parameters = vec![T::zero(); layout.len()];
        let (folded, transposed) = (vec![T::zero(); folded], vec![T::zero(); folded]);
        Ok(Self { shape, encoding, layout, table, layers, embedding, parameters, folded, transposed })
    }

    /// Its extents.
    pub fn shape(&self) -> &MlpShape {
        &self.shape
    }

    /// Names and places of its parameters.
    pub fn layout(&self) -> &ParameterLayout {
        &self.layout
    }

    /// Its parameters, in the order of [`Mlp::layout`].
    pub fn parameters(&self) -> &[T] {
        &self.parameters
    }

    /// The entries of the encoding's table, (entries, F); empty without one.
    fn table(&self) -> &[T] {
        &self.parameters[self.table.clone()]
    }

    /// Lets `change` alter the parameters, then folds the weight normalisation: W = g v / |v|.
    pub fn update(&mut self, change: impl FnOnce(&mut [T])) {
        change(&mut self.parameters);
        self.fold();
    }

    fn fold(&mut self) {
        for layer in &self.layers {
            let scale = T::of(layer.scale);
            let directions = self.parameters[layer.direction.clone()].chunks_exact(layer.inputs);
            let magnitudes = &self.parameters[layer.magnitude.clone()];
            let folded = self.folded[layer.folded_weight.clone()].chunks_exact_mut(layer.inputs);
            let transposed = &mut self.transposed[layer.folded_weight.clone()];
            for (output, ((direction, magnitude), folded)) in directions.zip(magnitudes).zip(folded).enumerate() {
                let factor = scale * *magnitude / norm(direction);
                let column = transposed[output..].iter_mut().step_by(layer.outputs);
                for ((folded, transposed), direction) in folded.iter_mut().zip(column).zip(direction) {
                    *folded = factor * *direction;
                    *transposed = *folded;
                }
            }
            self.folded[layer.folded_bias.clone()].copy_from_slice(&self.parameters[layer.bias.clone()]);
        }
    }

    /// Embeds a condition, (embedded). Empty for a network without one.
    pub fn embed(&self, condition: &[T]) -> Vec<T> {
        let Some(embedding) = &self.embedding else { return Vec::new() };
        assert_eq!(condition.len(), self.shape.condition, "condition length");
        let rows = self.parameters[embedding.weight.clone()].chunks_exact(self.shape.condition);
        let biases = &self.parameters[embedding.bias.clone()];
        rows.zip(biases).map(|(row, bias)| *bias + row.iter().zip(condition).map(|(w, c)| *w * *c).sum::<T>()).collect()
    }

    /// Adds the embedding's share of a gradient, for the cotangent of an embedded condition (embedded).
    pub fn embed_backward(&self, condition: &[T], cotangent: &[T], gradient: &mut MlpGradient<T>) {
        let (weights, biases) = gradient.embedding.split_at_mut(self.shape.embedded * self.shape.condition);
        let rows = weights.chunks_exact_mut(self.shape.condition.max(1));
        for ((row, bias), cotangent) in rows.zip(biases).zip(cotangent) {
            for (weight, condition) in row.iter_mut().zip(condition) {
                *weight += *cotangent * *condition;
            }
            *bias += *cotangent;
        }
    }
}

fn norm<T: Real>(values: &[T]) -> T {
    values.iter().map(|value| *value * *value).sum::<T>().sqrt()
}
