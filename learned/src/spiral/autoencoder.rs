//! The autoencoder of Wang's chapter 4: shapes to a code of a few numbers and back, by convolutions along spirals.
//!
//! Encoder: convolution of two rings to 16 channels, then on each level one more (16 of two rings, 32, 64 and 128 of one) and pooling, then the code, linear
//! in all that is left. Decoder: linear, then un-pooling and a convolution of one ring on each level (64, 32, 16), on the finest of two rings, and a
//! last one to the three coordinates. ELU after each convolution but the last. Loss: mean |D(E(x)) - x| of standardised coordinates.

use candle_core::{DType, Tensor};
use glam::DVec3;
use xavatar_formats::Result;

use super::layers::{Unpooling, apply_all};
use super::{Layer, Level, Standard, convolution};
use crate::descent::{Learner, Parameters, Rate, of_tensors};

/// Channels after each level's convolution.
const CHANNELS: [usize; 4] = [16, 32, 64, 128];

/// The network, and the shapes that it learns.
#[derive(Debug)]
pub struct Autoencoder {
    encoder: Vec<Layer>,
    decoder: Vec<Layer>,
    parameters: Parameters,
    standard: Standard,
    shapes: Tensor,
}

impl Autoencoder {
    /// For shapes (N, V) of a mesh with these levels, the finest first, at most five; begun from a seed.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if the shapes are not of the mesh.
    pub fn new(levels: &[Level], shapes: &[Vec<DVec3>], codes: usize, seed: u64) -> Result<Self> {
        let standard = Standard::of(shapes, levels.first().map_or(0, |level| level.points.len()))?;
        let mut parameters = Parameters::new(seed, DType::F32);
        let layers = || -> candle_core::Result<_> {
            let encoder = encoder(&mut parameters, levels, codes)?;
            let decoder = decoder(&mut parameters, levels, codes)?;
            Ok((encoder, decoder, standard.tensor_of(shapes, DType::F32)?))
        };
        let (encoder, decoder, shapes) = { layers }().map_err(of_tensors)?;
        Ok(Self { encoder, decoder, parameters, standard, shapes })
    }

    /// What becomes of shapes that are squeezed to a code and made again.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn reconstructed(&self, shapes: &[Vec<DVec3>]) -> Result<Vec<Vec<DVec3>>> {
        let again = |values: Tensor| self.standard.shapes_of(&self.through(&values)?);
        self.standard.tensor_of(shapes, DType::F32).and_then(again).map_err(of_tensors)
    }

    /// How far standardised meshes (B, V, 3) are from what it makes of them.
    pub(crate) fn loss_of(&self, meshes: &Tensor) -> candle_core::Result<Tensor> {
        (self.through(meshes)? - meshes)?.abs()?.mean_all()
    }

    fn through(&self, values: &Tensor) -> candle_core::Result<Tensor> {
        apply_all(&self.decoder, &apply_all(&self.encoder, values)?)
    }
}

impl Learner for Autoencoder {
    const BATCH: usize = 16;
    const FALLS: f64 = 0.99;

    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn rate_of(_: &str) -> Rate {
        Rate { rate: 1e-3, decay: 0.0 }
    }

    fn examples(&self) -> usize {
        self.shapes.dims()[0]
    }

    fn loss(&self, batch: &Tensor) -> candle_core::Result<Tensor> {
        self.loss_of(&self.shapes.index_select(batch, 0)?)
    }
}

fn encoder(parameters: &mut Parameters, levels: &[Level], codes: usize) -> candle_core::Result<Vec<Layer>> {
    let mut layers = Vec::new();
    let mut channels = 3;
    for (number, (pair, wanted)) in levels.windows(2).zip(CHANNELS).enumerate() {
        let rings = if number == 0 { 2 } else { 1 };
        if number == 0 {
            layers.push(convolution(parameters, "encoder.first", &pair[0], rings, [channels, wanted])?);
            layers.push(Layer::Elu);
            channels = wanted;
        }
        layers.push(convolution(parameters, &format!("encoder.{number}"), &pair[0], rings, [channels, wanted])?);
        layers.push(Layer::Elu);
        if let Some(pooling) = &pair[1].from_finer {
            layers.push(Layer::pool(pooling)?);
        }
        channels = wanted;
    }
    let left = levels.last().map_or(0, |level| level.points.len()) * channels;
    layers.push(Layer::Dense(parameters.linear("encoder.code", left, codes)?));
    Ok(layers)
}

fn decoder(parameters: &mut Parameters, levels: &[Level], codes: usize) -> candle_core::Result<Vec<Layer>> {
    let kind = parameters.kind();
    let coarsest = levels.last().map_or(0, |level| level.points.len());
    let mut channels = CHANNELS[levels.len().saturating_sub(2).min(CHANNELS.len() - 1)];
    let mut layers = vec![
        Layer::Dense(parameters.linear("decoder.code", codes, coarsest * channels)?),
        Layer::Unflatten(coarsest, channels),
    ];
    for (number, pair) in levels.windows(2).enumerate().rev() {
        let wanted = CHANNELS[number.saturating_sub(1)];
        if let Some(pooling) = &pair[1].from_finer {
            layers.push(Layer::Unpool(Unpooling::new(pooling, kind)?));
        }
        let rings = if number == 0 { 2 } else { 1 };
        layers.push(convolution(parameters, &format!("decoder.{number}"), &pair[0], rings, [channels, wanted])?);
        layers.push(Layer::Elu);
        channels = wanted;
    }
    if let Some(finest) = levels.first() {
        layers.push(convolution(parameters, "decoder.last", finest, 2, [channels, 3])?);
    }
    Ok(layers)
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;

    use candle_core::Var;
    use candle_nn::Linear;
    use xavatar_mesh::TriangleMesh;

    use super::*;
    use crate::descent::Descent;
    use crate::reference::{faces, indices, largest_difference, reference, tensor, vectors};
    use crate::spiral::layers::Convolution;
    use crate::spiral::{Pooling, levels};

    /// A ball of 42 vertices.
    pub(in crate::spiral) fn ball() -> TriangleMesh {
        let golden = reference("spiral_convolution");
        let vertices = vectors(&golden["points"]).iter().map(|point| point.as_vec3()).collect();
        TriangleMesh { vertices, faces: faces(&golden["faces"]), ..TriangleMesh::default() }
    }

    /// Balls with a bulge at a place of their own each, which no linear space of few dimensions holds.
    pub(in crate::spiral) fn bulges(count: usize) -> Vec<Vec<DVec3>> {
        let ball = ball();
        let bulging = |number: usize| {
            let angle = number as f64 * 2.4;
            let middle = DVec3::new(angle.cos(), (number as f64 * 0.7).sin(), angle.sin()).normalize();
            let place = |vertex: &glam::Vec3| {
                let place = vertex.as_dvec3();
                place * (1.0 + 0.3 * (-4.0 * place.distance_squared(middle)).exp())
            };
            ball.vertices.iter().map(place).collect()
        };
        (0..count).map(bulging).collect()
    }

    fn numbers(tensor: &Tensor) -> Vec<f64> {
        tensor.flatten_all().unwrap().to_vec1().unwrap()
    }

    // conv(h2) ELU, pool, conv(h1) ELU, code; and back; loss = mean |x' - x|, with its derivatives by every weight.
    #[test]
    fn network_loss_and_derivatives_are_the_references() {
        let golden = reference("spiral_autoencoder");
        let shapes = [("e0", 8, 51), ("e1", 8, 48), ("z", 6, 96), ("h", 96, 6), ("d0", 8, 56), ("d1", 3, 136)];
        let variable = |name: String, shape: &[usize]| Var::from_tensor(&tensor(&golden[&name], shape)).unwrap();
        let of_layer = |(name, outputs, inputs): &(&str, usize, usize)| {
            [variable(format!("{name}W"), &[*outputs, *inputs]), variable(format!("{name}b"), &[*outputs])]
        };
        let variables: Vec<[Var; 2]> = shapes.iter().map(of_layer).collect();
        let linear = |at: usize| {
            let [weights, offsets] = &variables[at];
            Linear::new(weights.as_tensor().clone(), Some(offsets.as_tensor().clone()))
        };
        let along = |name: &str, at: usize| {
            let spirals = indices(&golden[name]).into_iter().map(|vertex| vertex as u32).collect();
            Layer::Convolution(Convolution::new(spirals, linear(at)).unwrap())
        };
        let row = |row: &[f64]| {
            let mut entries: Vec<(u32, f64)> =
                row.iter().enumerate().filter(|entry| *entry.1 != 0.0).map(|(at, entry)| (at as u32, *entry)).collect();
            entries.resize(3, (0, 0.0));
            [entries[0], entries[1], entries[2]]
        };
        let up: Vec<[(u32, f64); 3]> = golden["up"].chunks_exact(12).map(row).collect();
        let pooling = Pooling {
            kept: golden["down"].chunks_exact(42).map(|of_coarse| row(of_coarse)[0].0).collect(),
            corners: up.iter().map(|entries| entries.map(|entry| entry.0)).collect(),
            weights: up.iter().map(|entries| entries.map(|entry| entry.1)).collect(),
        };
        let encoder = [
            along("spirals_2", 0),
            Layer::Elu,
            Layer::pool(&pooling).unwrap(),
            along("coarse_spirals_1", 1),
            Layer::Elu,
            Layer::Dense(linear(2)),
        ];
        let decoder = [
            Layer::Dense(linear(3)),
            Layer::Unflatten(12, 8),
            Layer::Unpool(Unpooling::new(&pooling, DType::F64).unwrap()),
            along("spirals_1", 4),
            Layer::Elu,
            along("spirals_2", 5),
        ];
        let x = tensor(&golden["x"], &[3, 42, 3]);
        let latent = apply_all(&encoder, &x).unwrap();
        assert!(largest_difference(&numbers(&latent), &golden["latent"]) < 1e-12);
        let again = apply_all(&decoder, &latent).unwrap();
        assert!(largest_difference(&numbers(&again), &golden["reconstruction"]) < 1e-12);
        let loss = (again - x).unwrap().abs().unwrap().mean_all().unwrap();
        assert!((loss.to_scalar::<f64>().unwrap() - golden["loss"][0]).abs() < 1e-12);
        let gradients = loss.backward().unwrap();
        for ((name, ..), variables) in shapes.iter().zip(&variables) {
            for (variable, kind) in variables.iter().zip(["W", "b"]) {
                let found = numbers(gradients.get(variable).unwrap());
                let difference = largest_difference(&found, &golden[&format!("d_{name}{kind}")]);
                assert!(difference < 1e-12, "{name}{kind}: {difference}");
            }
        }
    }

    #[test]
    fn training_learns_and_goes_on_to_the_bit_where_it_was_stopped() {
        let shapes = bulges(24);
        let levels = levels(&ball(), &[2, 2]).unwrap();
        let begun = || Autoencoder::new(&levels, &shapes, 6, 3).unwrap();
        let network = begun();
        let mut descent = Descent::new(&network, 9).unwrap();
        let mut losses: Vec<f64> = (0..4).map(|_| descent.epoch(&network).unwrap()).collect();
        let stopped = descent.to_arrays(&network).unwrap();
        losses.extend((0..8).map(|_| descent.epoch(&network).unwrap()));
        assert!(losses[11] < 0.8 * losses[0], "{losses:?}");
        let path = Path::new("training.npz");
        let other = Autoencoder::new(&levels, &shapes, 6, 4).unwrap();
        let mut resumed = Descent::resumed(&other, path, &stopped).unwrap();
        assert_eq!(resumed.epochs(), 4);
        let again: Vec<f64> = (0..8).map(|_| resumed.epoch(&other).unwrap()).collect();
        assert_eq!(again, losses[4..]);
        let (one, two) = (network.reconstructed(&shapes).unwrap(), other.reconstructed(&shapes).unwrap());
        assert_eq!(one, two);
        let mut missing = stopped;
        missing.remove("adam.second.encoder.code.W");
        let message = Descent::resumed(&begun(), path, &missing).unwrap_err().to_string();
        assert!(message.contains("training.npz") && message.contains("`adam.second.encoder.code.W`"), "{message}");
    }

    #[test]
    fn shapes_that_are_no_numbers_are_an_error_and_not_a_network() {
        let mut shapes = bulges(4);
        shapes[2][7].y = f64::NAN;
        let message = Autoencoder::new(&levels(&ball(), &[2]).unwrap(), &shapes, 2, 0).unwrap_err().to_string();
        assert!(message.contains("shape 2"), "{message}");
    }
}
