//! The layers of networks on meshes, each with its value and its derivative along tangents (METHOD-BODY section 10).
//!
//! Convolution: y_v = concat_l x[S_vl] W^T + b, the concatenation by places of the spiral, channels within; the number of no vertex is a row of zeros. Activation:
//! ELU, x or e^x - 1. Values are (B, V, C) of B meshes, V vertices, C channels; tangents (T, V, C) at the value of one mesh.

use candle_core::{Device, Result, Tensor};
use candle_nn::{Linear, Module};

use super::Pooling;

/// One step of a network.
#[derive(Clone, Debug)]
pub(crate) enum Layer {
    /// Along spirals.
    Convolution(Convolution),
    /// ELU.
    Elu,
    /// Keeps these vertices.
    Pool(Tensor),
    /// Means of vertices.
    Unpool(Unpooling),
    /// Of all that a mesh has at once.
    Dense(Linear),
    /// To so many vertices and channels.
    Unflatten(usize, usize),
}

/// A convolution along spirals.
#[derive(Clone, Debug)]
pub(crate) struct Convolution {
    /// Spirals (V L).
    spirals: Tensor,
    linear: Linear,
}

/// Vertices as means of coarse ones.
#[derive(Clone, Debug)]
pub(crate) struct Unpooling {
    /// (3 V).
    corners: Tensor,
    /// (1, V, 3, 1).
    weights: Tensor,
}

impl Convolution {
    /// Along spirals (V, L) of the same length.
    pub(crate) fn new(spirals: Vec<u32>, linear: Linear) -> Result<Self> {
        let count = spirals.len();
        Ok(Self { spirals: Tensor::from_vec(spirals, count, &Device::Cpu)?, linear })
    }

    fn gathered(&self, values: &Tensor) -> Result<Tensor> {
        let (meshes, vertices, channels) = values.dims3()?;
        let nothing = Tensor::zeros((meshes, 1, channels), values.dtype(), values.device())?;
        let padded = Tensor::cat(&[values, &nothing], 1)?;
        let length = self.spirals.elem_count() / vertices.max(1);
        padded.index_select(&self.spirals, 1)?.reshape((meshes, vertices, length * channels))
    }
}

impl Unpooling {
    pub(crate) fn new(pooling: &Pooling, like: candle_core::DType) -> Result<Self> {
        let vertices = pooling.corners.len();
        let corners = Tensor::from_vec(pooling.corners.concat(), 3 * vertices, &Device::Cpu)?;
        let weights = Tensor::from_vec(pooling.weights.concat(), (1, vertices, 3, 1), &Device::Cpu)?;
        Ok(Self { corners, weights: weights.to_dtype(like)? })
    }

    fn apply(&self, values: &Tensor) -> Result<Tensor> {
        let (meshes, _, channels) = values.dims3()?;
        let corners = values.index_select(&self.corners, 1)?;
        let corners = corners.reshape((meshes, self.weights.dim(1)?, 3, channels))?;
        corners.broadcast_mul(&self.weights)?.sum(2)
    }
}

impl Layer {
    /// Keeps the vertices that pooling keeps.
    pub(crate) fn pool(pooling: &Pooling) -> Result<Self> {
        Ok(Self::Pool(Tensor::from_vec(pooling.kept.clone(), pooling.kept.len(), &Device::Cpu)?))
    }

    /// The layer's value.
    pub(crate) fn apply(&self, values: &Tensor) -> Result<Tensor> {
        match self {
            Self::Convolution(convolution) => linear_of(&convolution.linear, &convolution.gathered(values)?),
            Self::Elu => values.elu(1.0),
            Self::Pool(kept) => values.index_select(kept, 1),
            Self::Unpool(unpooling) => unpooling.apply(values),
            Self::Dense(linear) => linear.forward(&values.flatten_from(1)?),
            Self::Unflatten(vertices, channels) => values.reshape(((), *vertices, *channels)),
        }
    }

    /// The layer's value for one mesh, and what it makes of tangents there.
    pub(crate) fn apply_with_tangents(&self, value: &Tensor, tangents: &Tensor) -> Result<(Tensor, Tensor)> {
        let moved = match self {
            Self::Convolution(convolution) => {
                linear_of(&without_offset(&convolution.linear), &convolution.gathered(tangents)?)?
            }
            // e^min(x, 0) is 1 where x is not negative.
            Self::Elu => tangents.broadcast_mul(&value.minimum(0.0)?.exp()?)?,
            Self::Dense(linear) => without_offset(linear).forward(&tangents.flatten_from(1)?)?,
            Self::Pool(_) | Self::Unpool(_) | Self::Unflatten(..) => self.apply(tangents)?,
        };
        Ok((self.apply(value)?, moved))
    }
}

/// Layers one after the other.
pub(crate) fn apply_all(layers: &[Layer], values: &Tensor) -> Result<Tensor> {
    layers.iter().try_fold(values.clone(), |values, layer| layer.apply(&values))
}

fn without_offset(linear: &Linear) -> Linear {
    Linear::new(linear.weight().clone(), None)
}

/// A linear layer of every vertex, as one product of matrices.
fn linear_of(linear: &Linear, values: &Tensor) -> Result<Tensor> {
    let (meshes, vertices, _) = values.dims3()?;
    linear.forward(&values.flatten_to(1)?)?.reshape((meshes, vertices, ()))
}

#[cfg(test)]
mod tests {
    use candle_core::{DType, Var};

    use super::*;
    use crate::descent::Parameters;
    use crate::reference::{indices, largest_difference, reference, tensor};

    fn numbers(tensor: &Tensor) -> Vec<f64> {
        tensor.flatten_all().unwrap().to_vec1().unwrap()
    }

    // y = ELU(concat_l x[S_l] W^T + b), and sum(c y)'s derivatives by x, W and b.
    #[test]
    fn convolution_and_its_derivatives_are_the_references() {
        let golden = reference("spiral_convolution");
        let variable = |name: &str, shape: &[usize]| Var::from_tensor(&tensor(&golden[name], shape)).unwrap();
        let (x, weights, offsets) = (variable("x", &[2, 42, 3]), variable("W", &[5, 51]), variable("b", &[5]));
        let spirals = indices(&golden["spirals_2"]).into_iter().map(|vertex| vertex as u32).collect();
        let linear = Linear::new(weights.as_tensor().clone(), Some(offsets.as_tensor().clone()));
        let layers = [Layer::Convolution(Convolution::new(spirals, linear).unwrap()), Layer::Elu];
        let y = apply_all(&layers, &x).unwrap();
        assert!(largest_difference(&numbers(&y), &golden["y"]) < 1e-12);
        let sum = (y * tensor(&golden["c"], &[2, 42, 5])).unwrap().sum_all().unwrap();
        let gradients = sum.backward().unwrap();
        for (variable, name) in [(&x, "d_x"), (&weights, "d_W"), (&offsets, "d_b")] {
            let difference = largest_difference(&numbers(gradients.get(variable).unwrap()), &golden[name]);
            assert!(difference < 1e-12, "{name}: {difference}");
        }
    }

    // (f(x + h t) - f(x - h t)) / 2 h for all layers in a row.
    #[test]
    fn tangents_match_finite_differences() {
        let golden = reference("spiral_autoencoder");
        let mut parameters = Parameters::new(3, DType::F64);
        let spirals: Vec<u32> = indices(&golden["coarse_spirals_1"]).into_iter().map(|index| index as u32).collect();
        let corners = (0..42).map(|vertex: u32| [vertex % 12, (vertex + 1) % 12, (vertex + 5) % 12]).collect();
        let pooling = Pooling { kept: (0..12).collect(), corners, weights: vec![[0.5, 0.3, 0.2]; 42] };
        let layers = [
            Layer::Dense(parameters.linear("dense", 5, 36).unwrap()),
            Layer::Unflatten(12, 3),
            Layer::Convolution(Convolution::new(spirals, parameters.linear("conv", 18, 4).unwrap()).unwrap()),
            Layer::Elu,
            Layer::Unpool(Unpooling::new(&pooling, DType::F64).unwrap()),
            Layer::pool(&pooling).unwrap(),
        ];
        let at = tensor(&[0.3, -1.2, 0.8, 2.0, -0.4], &[1, 5]);
        let directions = tensor(&[1.0, 0.5, -0.2, 0.3, 0.9, -0.6, 0.1, 0.4, -1.0, 0.2], &[2, 5]);
        let start = (at.clone(), directions.clone());
        let through = layers.iter().fold(start, |(x, t), layer| layer.apply_with_tangents(&x, &t).unwrap());
        let step = 1e-6;
        let moved = |by: f64| {
            let x = at.broadcast_add(&(&directions * by).unwrap()).unwrap();
            numbers(&apply_all(&layers, &x).unwrap())
        };
        let (ahead, behind) = (moved(step), moved(-step));
        let expected: Vec<f64> =
            ahead.iter().zip(&behind).map(|(ahead, behind)| (ahead - behind) / (2.0 * step)).collect();
        let difference = largest_difference(&numbers(&through.1), &expected);
        assert!(difference < 1e-8, "{difference}");
        assert!(expected.iter().any(|entry| entry.abs() > 1e-2));
    }
}
