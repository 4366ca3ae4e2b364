//! The double-precision references that the tests compare with.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use safetensors::{Dtype, SafeTensors};

/// The tensors of a reference, whatever their integers or floats were.
pub(crate) fn reference(name: &str) -> HashMap<String, Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/golden/body/{name}.safetensors"));
    let bytes = std::fs::read(path).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let numbers = |name: &str| {
        let tensor = tensors.tensor(name).unwrap();
        let words = tensor.data().as_chunks::<8>().0;
        match tensor.dtype() {
            Dtype::F64 => words.iter().map(|word| f64::from_le_bytes(*word)).collect(),
            Dtype::I64 => words.iter().map(|word| i64::from_le_bytes(*word) as f64).collect(),
            other => panic!("{name} is {other:?}"),
        }
    };
    tensors.names().iter().map(|name| (name.to_string(), numbers(name))).collect()
}

pub(crate) fn vectors(values: &[f64]) -> Vec<DVec3> {
    values.as_chunks::<3>().0.iter().map(|value| DVec3::from_array(*value)).collect()
}

pub(crate) fn indices(values: &[f64]) -> Vec<usize> {
    values.iter().map(|value| *value as usize).collect()
}

/// How far two lists of numbers are apart at most.
pub(crate) fn largest_difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max)
}

pub(crate) fn faces(values: &[f64]) -> Vec<[u32; 3]> {
    values.as_chunks::<3>().0.iter().map(|corners| corners.map(|corner| corner as u32)).collect()
}

/// Numbers as a tensor of this shape.
pub(crate) fn tensor(values: &[f64], shape: &[usize]) -> candle_core::Tensor {
    candle_core::Tensor::from_slice(values, shape, &candle_core::Device::Cpu).unwrap()
}
