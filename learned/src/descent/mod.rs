//! The training of small networks on candle, on the CPU: epochs of batches in an order drawn from a seed, Adam, rates that fall.
//!
//! The order of epoch e is drawn from stream e of the seed, so that the state between epochs is the parameters, Adam's moments and two counts: a training
//! that was written there and read again goes on to the bit.

mod adam;
mod parameters;

use std::path::Path;

use candle_core::{Device, Tensor};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};

use crate::named_arrays::NamedArrays;

pub use adam::{Adam, Rate};
pub use parameters::Parameters;
pub(crate) use parameters::keeping_variance;

const EPOCHS: &str = "epochs";
const SEED: &str = "seed";
const PREFIX: &str = "parameters.";

/// What is trained.
pub trait Learner {
    /// Examples of a batch.
    const BATCH: usize;
    /// What rates are multiplied by after an epoch.
    const FALLS: f64;

    /// What moves.
    fn parameters(&self) -> &Parameters;
    /// How fast, by a parameter's name.
    fn rate_of(name: &str) -> Rate;
    /// How many examples there are.
    fn examples(&self) -> usize;
    /// The loss of a batch of them, by their numbers.
    ///
    /// # Errors
    /// candle's.
    fn loss(&self, batch: &Tensor) -> candle_core::Result<Tensor>;
}

/// A training between two epochs.
#[derive(Debug)]
pub struct Descent {
    adam: Adam,
    seed: u64,
    epochs: u64,
}

impl Descent {
    /// At its beginning.
    ///
    /// # Errors
    /// If memory for the moments is not to be had.
    pub fn new<L: Learner>(learner: &L, seed: u64) -> Result<Self> {
        let adam = Adam::new(learner.parameters(), L::rate_of).map_err(of_tensors)?;
        Ok(Self { adam, seed, epochs: 0 })
    }

    /// Epochs that were done.
    pub fn epochs(&self) -> u64 {
        self.epochs
    }

    /// One epoch; the mean loss of its batches.
    ///
    /// # Errors
    /// [`Error::Value`] if a loss is no number, with the epoch.
    pub fn epoch<L: Learner>(&mut self, learner: &L) -> Result<f64> {
        let share = L::FALLS.powf(self.epochs as f64);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(self.epochs);
        let mut order: Vec<u32> = (0..learner.examples() as u32).collect();
        order.shuffle(&mut random);
        let mut sum = 0.0;
        for batch in order.chunks(L::BATCH) {
            let loss = self.step(learner, batch, share).map_err(of_tensors)?;
            if !loss.is_finite() {
                return Err(Error::Value {
                    name: format!("loss of epoch {}", self.epochs + 1),
                    found: loss.to_string(),
                    expected: "a number: shapes without infinities, and no huge ones".into(),
                });
            }
            sum += loss * batch.len() as f64;
        }
        self.epochs += 1;
        Ok(sum / learner.examples().max(1) as f64)
    }

    fn step<L: Learner>(&mut self, learner: &L, batch: &[u32], share: f64) -> candle_core::Result<f64> {
        let loss = learner.loss(&Tensor::from_slice(batch, batch.len(), &Device::Cpu)?)?;
        self.adam.step(learner.parameters(), &loss.backward()?, share)?;
        loss.to_dtype(candle_core::DType::F64)?.to_scalar()
    }

    /// The training as arrays: parameters, moments, counts.
    ///
    /// # Errors
    /// candle's.
    pub fn to_arrays<L: Learner>(&self, learner: &L) -> Result<ArrayMap> {
        let mut arrays = learner.parameters().to_arrays(PREFIX).map_err(of_tensors)?;
        arrays.extend(self.adam.to_arrays().map_err(of_tensors)?);
        arrays.extend([(EPOCHS.into(), of_count(self.epochs)), (SEED.into(), of_count(self.seed))]);
        Ok(arrays)
    }

    /// The training that [`to_arrays`](Self::to_arrays) wrote, of a learner made of the same examples; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the array that is missing or has another shape.
    pub fn resumed<L: Learner>(learner: &L, path: &Path, arrays: &ArrayMap) -> Result<Self> {
        let mut descent = Self::new(learner, count_of(path, arrays, SEED)?)?;
        learner.parameters().set(path, arrays, PREFIX)?;
        descent.adam.set(path, arrays)?;
        descent.epochs = count_of(path, arrays, EPOCHS)?;
        Ok(descent)
    }
}

/// A count as an array, all of its bits.
pub(crate) fn of_count(count: u64) -> Array {
    Array { shape: Vec::new(), data: ArrayData::I64(vec![count.cast_signed()]) }
}

/// The count that [`of_count`] made the array of.
pub(crate) fn count_of(path: &Path, arrays: &ArrayMap, name: &str) -> Result<u64> {
    match arrays.get(name).map(|array| &array.data) {
        Some(ArrayData::I64(numbers)) if numbers.len() == 1 => Ok(numbers[0].cast_unsigned()),
        _ => Err(NamedArrays::of_state(path, arrays).wrong(name, "one integer")),
    }
}

/// What candle refuses: arrays that do not fit each other.
pub(crate) fn of_tensors(error: candle_core::Error) -> Error {
    Error::Value { name: "network".into(), found: error.to_string(), expected: "arrays that fit each other".into() }
}

#[cfg(test)]
mod tests {
    use candle_core::DType;

    use super::*;

    /// Learns to be nothing that is a number.
    struct Lost(Parameters, Tensor);

    impl Learner for Lost {
        const BATCH: usize = 4;
        const FALLS: f64 = 1.0;

        fn parameters(&self) -> &Parameters {
            &self.0
        }

        fn rate_of(_: &str) -> Rate {
            Rate { rate: 1.0, decay: 0.0 }
        }

        fn examples(&self) -> usize {
            4
        }

        fn loss(&self, _: &Tensor) -> candle_core::Result<Tensor> {
            (&self.1 * f64::NAN)?.sum_all()
        }
    }

    #[test]
    fn a_loss_that_is_no_number_is_an_error_with_its_epoch() {
        let mut parameters = Parameters::new(0, DType::F32);
        let theta = parameters.given("theta", &Tensor::zeros(1, DType::F32, &Device::Cpu).unwrap()).unwrap();
        let lost = Lost(parameters, theta);
        let message = Descent::new(&lost, 0).unwrap().epoch(&lost).unwrap_err().to_string();
        assert!(message.contains("epoch 1") && message.contains("NaN"), "{message}");
    }

    #[test]
    fn counts_beyond_what_doubles_tell_apart_keep_their_bits() {
        let path = Path::new("state.npz");
        for count in [0, (1 << 53) + 1, u64::MAX - 2] {
            let arrays = ArrayMap::from([("seed".to_owned(), of_count(count))]);
            assert_eq!(count_of(path, &arrays, "seed").unwrap(), count);
        }
        let arrays = ArrayMap::from([("seed".to_owned(), Array::from_f32(&[1], vec![3.0]))]);
        let message = count_of(path, &arrays, "seed").unwrap_err().to_string();
        assert!(message.contains("state.npz") && message.contains("`seed`"), "{message}");
    }
}
