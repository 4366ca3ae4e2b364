//! The double-precision references: files of named numbers.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensors};

/// A file among the references.
pub fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/body").join(name)
}

/// The numbers of a reference, integers among them.
pub fn numbers(name: &str) -> HashMap<String, Vec<f64>> {
    let bytes = std::fs::read(golden(&format!("{name}.safetensors"))).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let read = |(tensor, view): (String, safetensors::tensor::TensorView)| {
        let words = view.data().as_chunks::<8>().0.iter();
        let values = match view.dtype() {
            Dtype::F64 => words.map(|bytes| f64::from_le_bytes(*bytes)).collect(),
            Dtype::I64 => words.map(|bytes| i64::from_le_bytes(*bytes) as f64).collect(),
            other => panic!("{name}: {tensor} is {other:?}"),
        };
        (tensor, values)
    };
    file.tensors().into_iter().map(read).collect()
}
