//! Named numeric arrays: what npz, pickles and safetensors have in common.

use std::collections::BTreeMap;

/// Arrays by name, as a model file or a frame's pickle holds them.
pub type ArrayMap = BTreeMap<String, Array>;

/// A dense array in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Extents, outermost first; empty for a scalar.
    pub shape: Vec<usize>,
    /// The elements, `shape`'s product of them.
    pub data: ArrayData,
}

/// The elements of an [`Array`], in the widest type of their kind that loses nothing.
#[derive(Clone, Debug, PartialEq)]
pub enum ArrayData {
    /// 8-bit unsigned: images, booleans.
    U8(Vec<u8>),
    /// All other integers.
    I64(Vec<i64>),
    /// 16- and 32-bit floats.
    F32(Vec<f32>),
    /// 64-bit floats.
    F64(Vec<f64>),
    /// Text, such as a gender.
    Text(String),
}
