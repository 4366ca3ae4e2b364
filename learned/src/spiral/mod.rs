//! Networks on the vertices of a mesh, by convolutions along spirals (Wang ch. 4 and 5; METHOD-BODY section 10), on candle.
//!
//! A vertex's neighbours in the order of its [`Spirals`] are what pixels around a pixel are to a picture; [`levels()`] are the mesh at fewer and fewer
//! vertices. [`Autoencoder`] squeezes shapes to a few numbers and makes shapes of them; [`Autodecoder`] finds the numbers of its shapes while it learns
//! to make shapes of numbers. [`Descent`](crate::descent::Descent) trains either.

mod autodecoder;
mod autodecoder_file;
mod autoencoder;
mod layers;
mod levels;
mod spirals;
mod standard;

pub use autodecoder::{Autodecoder, AutodecoderTraining, Decoded};
pub use autoencoder::Autoencoder;
pub use levels::{FACTORS, Level, Pooling, levels};
pub use spirals::Spirals;
pub use standard::Standard;

use candle_core::Result;

use crate::descent::{Parameters, keeping_variance};
use layers::{Convolution, Layer};

/// A convolution on a level, along spirals of so many rings and of their usual length, that lets the variance of what comes in through.
fn convolution(
    parameters: &mut Parameters,
    name: &str,
    level: &Level,
    rings: usize,
    channels: [usize; 2],
) -> Result<Layer> {
    let (spirals, length) = along(level, rings);
    let inputs = length * channels[0];
    let linear = parameters.linear_within(name, inputs, channels[1], keeping_variance(inputs))?;
    Ok(Layer::Convolution(Convolution::new(spirals, linear)?))
}

/// Spirals of so many rings, and their usual length.
fn along(level: &Level, rings: usize) -> (Vec<u32>, usize) {
    let spirals = Spirals::new(&level.points, &level.faces, rings);
    let length = spirals.usual_length();
    (spirals.of_length(length), length)
}
