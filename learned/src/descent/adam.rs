//! Adam, with moments that can be written and read again: a training that was stopped goes on to the bit.
//!
//! g = gradient + decay theta;  m = 0.9 m + 0.1 g;  v = 0.999 v + 0.001 g^2;  theta -= rate m / (1 - 0.9^t) / (sqrt(v / (1 - 0.999^t)) + 1e-8). candle-nn's own has
//! the decay beside the moments, and keeps them to itself.

use std::collections::BTreeMap;
use std::path::Path;

use candle_core::backprop::GradStore;
use candle_core::{Result, Tensor};
use xavatar_formats::{Array, ArrayData, ArrayMap, Error};

use super::parameters::{array_of, tensor_of};
use super::{Parameters, count_of};

/// How much of the moments stays.
const STAYS: [f64; 2] = [0.9, 0.999];
/// What keeps a step finite.
const EPSILON: f64 = 1e-8;
const STEPS: &str = "adam.steps";
const MOMENTS: [&str; 2] = ["adam.first.", "adam.second."];

/// How a parameter is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// Of a step.
    pub rate: f64,
    /// Of the parameter towards zero.
    pub decay: f64,
}

/// The optimiser's state.
#[derive(Debug)]
pub struct Adam {
    rate_of: fn(&str) -> Rate,
    steps: u64,
    moments: BTreeMap<String, [Tensor; 2]>,
}

impl Adam {
    /// Of these parameters, each moved by the rate of its name.
    ///
    /// # Errors
    /// candle's.
    pub fn new(parameters: &Parameters, rate_of: fn(&str) -> Rate) -> Result<Self> {
        let zeros = |(name, variable): (&str, &candle_core::Var)| {
            Ok((name.to_owned(), [variable.zeros_like()?.detach(), variable.zeros_like()?.detach()]))
        };
        Ok(Self { rate_of, steps: 0, moments: parameters.trained().map(zeros).collect::<Result<_>>()? })
    }

    /// One step, every rate times `share`; a parameter without a gradient stays.
    ///
    /// # Errors
    /// candle's.
    pub fn step(&mut self, parameters: &Parameters, gradients: &GradStore, share: f64) -> Result<()> {
        self.steps += 1;
        let unbiased = STAYS.map(|stays| 1.0 / (1.0 - stays.powf(self.steps as f64)));
        for (name, variable) in parameters.trained() {
            let (Some(gradient), Some([first, second])) = (gradients.get(variable), self.moments.get_mut(name)) else {
                continue;
            };
            let Rate { rate, decay } = (self.rate_of)(name);
            let theta = variable.as_detached_tensor();
            // candle leaves the tape on the gradients of parameters: moments would keep that of every step.
            let gradient = (gradient.detach() + (&theta * decay)?)?;
            *first = ((&*first * STAYS[0])? + (&gradient * (1.0 - STAYS[0]))?)?;
            *second = ((&*second * STAYS[1])? + (gradient.sqr()? * (1.0 - STAYS[1]))?)?;
            let size = ((&*second * unbiased[1])?.sqrt()? + EPSILON)?;
            variable.set(&(theta - ((&*first * (rate * share * unbiased[0]))? / size)?)?)?;
        }
        Ok(())
    }

    /// The state as arrays.
    ///
    /// # Errors
    /// candle's.
    pub fn to_arrays(&self) -> Result<ArrayMap> {
        let steps = Array { shape: Vec::new(), data: ArrayData::I64(vec![self.steps as i64]) };
        let mut arrays = ArrayMap::from([(STEPS.to_owned(), steps)]);
        for (name, moments) in &self.moments {
            for (moment, prefix) in moments.iter().zip(MOMENTS) {
                arrays.insert(format!("{prefix}{name}"), array_of(moment)?);
            }
        }
        Ok(arrays)
    }

    /// Becomes what [`to_arrays`](Self::to_arrays) made of the state of the same parameters; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the array that is missing or has another shape.
    pub fn set(&mut self, path: &Path, arrays: &ArrayMap) -> std::result::Result<(), Error> {
        self.steps = count_of(path, arrays, STEPS)?;
        for (name, moments) in &mut self.moments {
            for (moment, prefix) in moments.iter_mut().zip(MOMENTS) {
                *moment = tensor_of(path, arrays, &format!("{prefix}{name}"), moment.dims(), moment.dtype())?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use candle_core::{DType, Device};

    use super::*;

    // One parameter, loss 2 theta: g = 2 + decay theta, and of the first step m / v^(1/2) = 1 up to epsilon.
    #[test]
    fn steps_are_the_formulas() {
        let mut parameters = Parameters::new(0, DType::F64);
        let theta = parameters.given("theta", &Tensor::zeros(1, DType::F64, &Device::Cpu).unwrap()).unwrap();
        let mut adam = Adam::new(&parameters, |_| Rate { rate: 0.1, decay: 0.5 }).unwrap();
        let mut step = || {
            let gradients = (&theta * 2.0).unwrap().sum_all().unwrap().backward().unwrap();
            adam.step(&parameters, &gradients, 0.5).unwrap();
            theta.to_vec1::<f64>().unwrap()[0]
        };
        let first = -0.05 * 2.0 / (2.0 + 1e-8);
        assert!((step() - first).abs() < 1e-15);
        let gradient: f64 = 2.0 + 0.5 * first;
        let moment = (0.9 * 0.2 + 0.1 * gradient) / (1.0 - 0.81);
        let square = (0.999 * 0.004 + 0.001 * gradient * gradient) / (1.0 - 0.999_f64.powi(2));
        let second = first - 0.05 * moment / (square.sqrt() + 1e-8);
        assert!((step() - second).abs() < 1e-13);
    }

    #[test]
    fn moments_keep_no_tape() {
        let mut parameters = Parameters::new(0, DType::F64);
        let theta = parameters.given("theta", &Tensor::ones(1, DType::F64, &Device::Cpu).unwrap()).unwrap();
        let mut adam = Adam::new(&parameters, |_| Rate { rate: 0.1, decay: 0.5 }).unwrap();
        let gradients = theta.sqr().unwrap().sum_all().unwrap().backward().unwrap();
        adam.step(&parameters, &gradients, 1.0).unwrap();
        for moment in &adam.moments["theta"] {
            assert!(moment.sum_all().unwrap().backward().unwrap().get(&theta).is_none());
        }
    }
}
