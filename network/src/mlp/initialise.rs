//! How a network's parameters are drawn before training.

use std::ops::Range;

use rand::Rng;

use super::{Layer, Mlp, norm};
use crate::Real;

impl<T: Real> Mlp<T> {
    /// Draws every layer as PyTorch's `Linear` does: uniform within 1 / sqrt(inputs). Magnitudes are set to |v|.
    ///
    /// A grid's table is drawn within 1e-4 (Mueller et al. 2022).
    pub fn initialise_uniform(&mut self, random: &mut impl Rng) {
        let (layers, embedding, condition) = (self.layers.clone(), self.embedding.clone(), self.shape.condition);
        let table = self.table.clone();
        self.update(|parameters| {
            for value in &mut parameters[table] {
                *value = T::of(random.random_range(-1e-4..1e-4));
            }
            let mut draw = |range: Range<usize>, inputs: usize| {
                let bound = 1.0 / (inputs as f64).sqrt();
                for value in &mut parameters[range] {
                    *value = T::of(random.random_range(-bound..bound));
                }
            };
            for layer in &layers {
                draw(layer.direction.clone(), layer.inputs);
                draw(layer.bias.clone(), layer.inputs);
            }
            if let Some(embedding) = &embedding {
                draw(embedding.weight.clone(), condition);
                draw(embedding.bias.clone(), condition);
            }
            set_magnitudes(parameters, &layers);
        });
    }

    /// Geometric initialisation (Atzmon & Lipman 2020): the output is close to |x| - `radius`.
    pub fn initialise_sphere(&mut self, radius: f64, random: &mut impl Rng) {
        self.initialise_uniform(random);
        let (layers, shape) = (self.layers.clone(), self.shape.clone());
        let encoded = self.encoding.width();
        // Waves and conditions start without influence: only the coordinates themselves shape the sphere. A grid's
        // features, all close to zero, do not disturb it, and learn at once if they are heard.
        let heard = if self.table.is_empty() { shape.inputs } else { encoded };
        self.update(|parameters| {
            for (index, layer) in layers.iter().enumerate() {
                let last = index == shape.depth;
                let spread = std::f64::consts::SQRT_2 / (layer.outputs as f64).sqrt();
                let mean = std::f64::consts::PI.sqrt() / (layer.inputs as f64).sqrt();
                for row in parameters[layer.direction.clone()].chunks_exact_mut(layer.inputs) {
                    for (column, value) in row.iter_mut().enumerate() {
                        let normal: f64 = random.sample(rand_distr::StandardNormal);
                        let silent = (index == 0 && column >= heard)
                            || (shape.skip == Some(index) && column >= layer.inputs - (encoded - heard));
                        *value = T::of(match (last, silent) {
                            (true, _) => mean + 1e-4 * normal,
                            (false, true) => 0.0,
                            (false, false) => spread * normal,
                        });
                    }
                }
                parameters[layer.bias.clone()].fill(T::of(if last { -radius } else { 0.0 }));
            }
            set_magnitudes(parameters, &layers);
        });
    }

    /// Changes the sign of the output: a signed distance becomes an occupancy logit.
    pub fn negate_output(&mut self) {
        let last = self.layers[self.shape.depth].clone();
        self.update(|parameters| {
            for range in [last.direction, last.bias] {
                parameters[range].iter_mut().for_each(|value| *value = -*value);
            }
        });
    }
}

fn set_magnitudes<T: Real>(parameters: &mut [T], layers: &[Layer]) {
    for layer in layers {
        for row in 0..layer.outputs {
            let start = layer.direction.start + row * layer.inputs;
            parameters[layer.magnitude.start + row] = norm(&parameters[start..start + layer.inputs]);
        }
    }
}
