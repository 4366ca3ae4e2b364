//! Networks on the vertices of a mesh, by convolutions along spirals (Wang ch. 4 and 5; METHOD-BODY section 10), on candle.
//!
//! A vertex's neighbours in the order of its [`Spirals`] are what pixels around a pixel are to a picture; [`levels()`] are the mesh at fewer and fewer
//! vertices. [`Autoencoder`] squeezes shapes to a few numbers and makes shapes of them; [`Autodecoder`] finds the numbers of its shapes while it learns
//! to make shapes of numbers. [`Descent`] trains either; it can be stopped between epochs, written, and gone on with to the bit. On the CPU.

mod adam;
mod autodecoder;
mod autodecoder_file;
mod autoencoder;
mod descent;
mod layers;
mod levels;
mod parameters;
mod spirals;
mod standard;

pub use adam::{Adam, Rate};
pub use autodecoder::{Autodecoder, AutodecoderTraining, Decoded};
pub use autoencoder::Autoencoder;
pub use descent::{Descent, Learner};
pub use levels::{FACTORS, Level, Pooling, levels};
pub use parameters::Parameters;
pub use spirals::Spirals;
pub use standard::Standard;

use std::path::Path;

use candle_core::Result;
use xavatar_formats::{Array, ArrayMap, Error};

use layers::{Convolution, Layer};

/// What candle refuses: arrays that do not fit each other.
pub(crate) fn of_tensors(error: candle_core::Error) -> Error {
    Error::Value {
        name: "network".into(),
        found: error.to_string(),
        expected: "arrays that fit the mesh and each other".into(),
    }
}

/// The array of a name as a single count.
fn count_of(path: &Path, arrays: &ArrayMap, name: &str) -> std::result::Result<u64, Error> {
    let found = arrays.get(name);
    let numbers = found.and_then(Array::to_f64).filter(|numbers| numbers.len() == 1);
    let count = numbers.map(|numbers| numbers[0]).filter(|count| *count >= 0.0 && count.fract() == 0.0);
    count.map(|count| count as u64).ok_or_else(|| Error::Malformed {
        path: path.into(),
        format: "file of a network",
        place: format!("`{name}`"),
        found: found.map_or("missing".into(), |array| format!("an array {:?}", array.shape)),
        expected: "one whole number".into(),
    })
}

/// A convolution on a level, along spirals of so many rings and of their usual length.
fn convolution(
    parameters: &mut Parameters,
    name: &str,
    level: &Level,
    rings: usize,
    channels: [usize; 2],
) -> Result<Layer> {
    let spirals = Spirals::new(&level.points, &level.faces, rings);
    let length = spirals.usual_length();
    let linear = parameters.linear(name, length * channels[0], channels[1])?;
    Ok(Layer::Convolution(Convolution::new(spirals.of_length(length), linear)?))
}
