//! The numbers of a network that training moves, by name: made from a seed, written as arrays, read again to the bit.
//!
//! Weights and offsets of a layer of n inputs begin uniform in +-1/sqrt(n), if nothing else is asked for. candle's own generator of random numbers on the CPU has no seed, so they are drawn
//! here.

use std::collections::BTreeMap;
use std::path::Path;

use candle_core::{DType, Device, Result, Tensor, Var};
use candle_nn::{Conv2d, Conv2dConfig, Linear};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error};

use super::of_tensors;

/// Weights of a layer of so many inputs that are uniform within this let the variance of what comes in through, where activations halve it.
pub(crate) fn keeping_variance(inputs: usize) -> f64 {
    (6.0 / inputs.max(1) as f64).sqrt()
}

/// A network's parameters, by name.
#[derive(Debug)]
pub struct Parameters {
    kind: DType,
    random: ChaCha8Rng,
    trained: BTreeMap<String, Var>,
}

impl Parameters {
    /// None yet; those to come are drawn from this seed, as numbers of this kind.
    pub fn new(seed: u64, kind: DType) -> Self {
        Self { kind, random: ChaCha8Rng::seed_from_u64(seed), trained: BTreeMap::new() }
    }

    /// The kind of numbers.
    pub fn kind(&self) -> DType {
        self.kind
    }

    /// What descent moves, by name.
    pub fn trained(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.trained.iter().map(|(name, variable)| (name.as_str(), variable))
    }

    /// y = x W^T + b, W named `NAME.W` (outputs, inputs), b `NAME.b` (outputs).
    pub(crate) fn linear(&mut self, name: &str, inputs: usize, outputs: usize) -> Result<Linear> {
        self.linear_within(name, inputs, outputs, 1.0 / (inputs.max(1) as f64).sqrt())
    }

    /// The same, weights and offsets uniform in +-`most`.
    pub(crate) fn linear_within(&mut self, name: &str, inputs: usize, outputs: usize, most: f64) -> Result<Linear> {
        let weights = self.uniform(&format!("{name}.W"), &[outputs, inputs], most)?;
        let offsets = self.uniform(&format!("{name}.b"), &[outputs], most)?;
        Ok(Linear::new(weights, Some(offsets)))
    }

    /// A convolution of 3 x 3 pixels to half as many, named as a [`linear`](Self::linear) layer; W is (outputs, inputs, 3, 3).
    pub(crate) fn halving(&mut self, name: &str, inputs: usize, outputs: usize) -> Result<Conv2d> {
        let most = keeping_variance(9 * inputs);
        let weights = self.uniform(&format!("{name}.W"), &[outputs, inputs, 3, 3], most)?;
        let offsets = self.uniform(&format!("{name}.b"), &[outputs], most)?;
        Ok(Conv2d::new(weights, Some(offsets), Conv2dConfig { stride: 2, padding: 1, ..Conv2dConfig::default() }))
    }

    /// With these values.
    pub(crate) fn given(&mut self, name: &str, values: &Tensor) -> Result<Tensor> {
        self.add(name.to_owned(), values)
    }

    /// Leaves out what was trained by the way.
    pub(crate) fn forget(&mut self, name: &str) {
        self.trained.remove(name);
    }

    fn uniform(&mut self, name: &str, shape: &[usize], most: f64) -> Result<Tensor> {
        let count = shape.iter().product();
        let values: Vec<f64> = (0..count).map(|_| self.random.random_range(-most..=most)).collect();
        let values = Tensor::from_vec(values, shape, &Device::Cpu)?.to_dtype(self.kind)?;
        self.add(name.to_owned(), &values)
    }

    fn add(&mut self, name: String, values: &Tensor) -> Result<Tensor> {
        let variable = Var::from_tensor(values)?;
        let tensor = variable.as_tensor().clone();
        self.trained.insert(name, variable);
        Ok(tensor)
    }

    /// All as arrays, their names after this prefix.
    ///
    /// # Errors
    /// candle's.
    pub fn to_arrays(&self, prefix: &str) -> Result<ArrayMap> {
        self.trained.iter().map(|(name, variable)| Ok((format!("{prefix}{name}"), array_of(variable)?))).collect()
    }

    /// Becomes what [`to_arrays`](Self::to_arrays) made of parameters of the same names and shapes; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the array that is missing, has another shape, or holds numbers that are not finite.
    pub fn set(&self, path: &Path, arrays: &ArrayMap, prefix: &str) -> std::result::Result<(), Error> {
        for (name, variable) in &self.trained {
            let values = tensor_of(path, arrays, &format!("{prefix}{name}"), variable.dims(), self.kind)?;
            variable.set(&values).map_err(of_tensors)?;
        }
        Ok(())
    }
}

/// A tensor as an array of the same numbers.
pub(super) fn array_of(tensor: &Tensor) -> Result<Array> {
    let flat = tensor.flatten_all()?;
    let data = match tensor.dtype() {
        DType::F64 => ArrayData::F64(flat.to_vec1()?),
        _ => ArrayData::F32(flat.to_dtype(DType::F32)?.to_vec1()?),
    };
    Ok(Array { shape: tensor.dims().to_vec(), data })
}

/// The array of a name as a tensor of this shape.
pub(super) fn tensor_of(
    path: &Path,
    arrays: &ArrayMap,
    name: &str,
    shape: &[usize],
    kind: DType,
) -> std::result::Result<Tensor, Error> {
    let found = arrays.get(name);
    let numbers = found.filter(|array| array.shape == shape).and_then(Array::to_f64);
    let Some(numbers) = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())) else {
        return Err(Error::Malformed {
            path: path.into(),
            format: "file of a network",
            place: format!("`{name}`"),
            found: found.map_or("missing".into(), |array| format!("an array {:?}", array.shape)),
            expected: format!("finite numbers of shape {shape:?}"),
        });
    };
    let tensor = Tensor::from_vec(numbers, shape, &Device::Cpu).and_then(|tensor| tensor.to_dtype(kind));
    tensor.map_err(of_tensors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(seed: u64) -> Parameters {
        let mut parameters = Parameters::new(seed, DType::F32);
        parameters.linear("first", 9, 4).unwrap();
        parameters.given("codes", &Tensor::zeros((3, 2), DType::F32, &Device::Cpu).unwrap()).unwrap();
        parameters
    }

    #[test]
    fn a_seed_gives_the_same_numbers_within_their_bounds() {
        let (one, same, other) = (made(7), made(7), made(8));
        let weights = |parameters: &Parameters| parameters.to_arrays("").unwrap()["first.W"].to_f64().unwrap();
        assert_eq!(weights(&one), weights(&same));
        assert_ne!(weights(&one), weights(&other));
        assert!(weights(&one).iter().all(|weight| weight.abs() <= 1.0 / 3.0));
    }

    #[test]
    fn arrays_give_them_back_or_say_what_is_wrong() {
        let (one, other) = (made(7), made(8));
        let path = Path::new("network.npz");
        let arrays = one.to_arrays("net.").unwrap();
        other.set(path, &arrays, "net.").unwrap();
        let again = other.to_arrays("net.").unwrap();
        assert_eq!(again.len(), 3);
        for (name, array) in &arrays {
            assert_eq!(array.to_f64(), again[name].to_f64(), "{name}");
        }
        let mut wrong = arrays.clone();
        wrong.insert("net.first.b".into(), Array::from_f32(&[4], vec![0.0, f32::NAN, 0.0, 0.0]));
        let message = other.set(path, &wrong, "net.").unwrap_err().to_string();
        assert!(message.contains("network.npz") && message.contains("`net.first.b`"), "{message}");
        let mut missing = arrays;
        missing.remove("net.first.b");
        let message = other.set(path, &missing, "net.").unwrap_err().to_string();
        assert!(message.contains("missing") && message.contains("`net.first.b`"), "{message}");
    }
}
