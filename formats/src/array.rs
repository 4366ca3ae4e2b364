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

impl Array {
    /// An array of f32 of the given shape, whose product must be the number of `values`.
    pub fn from_f32(shape: &[usize], values: Vec<f32>) -> Self {
        debug_assert_eq!(shape.iter().product::<usize>(), values.len());
        Self { shape: shape.to_vec(), data: ArrayData::F32(values) }
    }

    /// A piece of text.
    pub fn from_text(text: impl Into<String>) -> Self {
        Self { shape: Vec::new(), data: ArrayData::Text(text.into()) }
    }

    /// The elements as f32, rounded where they were wider; `None` for text.
    pub fn to_f32(&self) -> Option<Vec<f32>> {
        match &self.data {
            ArrayData::U8(values) => Some(values.iter().map(|&value| f32::from(value)).collect()),
            ArrayData::I64(values) => Some(values.iter().map(|&value| value as f32).collect()),
            ArrayData::F32(values) => Some(values.clone()),
            ArrayData::F64(values) => Some(values.iter().map(|&value| value as f32).collect()),
            ArrayData::Text(_) => None,
        }
    }

    /// The elements as f64; `None` for text.
    pub fn to_f64(&self) -> Option<Vec<f64>> {
        match &self.data {
            ArrayData::U8(values) => Some(values.iter().map(|&value| f64::from(value)).collect()),
            ArrayData::I64(values) => Some(values.iter().map(|&value| value as f64).collect()),
            ArrayData::F32(values) => Some(values.iter().map(|&value| f64::from(value)).collect()),
            ArrayData::F64(values) => Some(values.clone()),
            ArrayData::Text(_) => None,
        }
    }

    /// The elements as indices of a table of `length` rows; `None` if one is negative, too large or not an integer.
    ///
    /// Whole numbers stored as floats are accepted: index arrays pass through float tools before they are saved.
    pub fn to_indices(&self, length: usize) -> Option<Vec<u32>> {
        let index = |value: i64| u32::try_from(value).ok().filter(|&index| (index as usize) < length);
        match &self.data {
            ArrayData::U8(values) => values.iter().map(|&value| index(value.into())).collect(),
            ArrayData::I64(values) => values.iter().map(|&value| index(value)).collect(),
            ArrayData::F32(_) | ArrayData::F64(_) => {
                let whole = |value: f64| (value.fract() == 0.0).then(|| index(value as i64)).flatten();
                self.to_f64()?.into_iter().map(whole).collect()
            }
            ArrayData::Text(_) => None,
        }
    }

    /// The text, if it is one.
    pub fn text(&self) -> Option<&str> {
        match &self.data {
            ArrayData::Text(text) => Some(text),
            _ => None,
        }
    }

    /// How many elements there are; one for text.
    pub(crate) fn elements(&self) -> usize {
        self.shape.iter().product()
    }

    /// What the array is, for messages: `f32 (3, 4)`.
    pub fn description(&self) -> String {
        if let ArrayData::Text(text) = &self.data {
            return super::fault::excerpt(text);
        }
        let extents: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        format!("{} ({})", self.kind(), extents.join(", "))
    }

    /// What the elements are: `u8`, `integer`, `f32`, `f64` or `text`.
    pub fn kind(&self) -> &'static str {
        match &self.data {
            ArrayData::U8(_) => "u8",
            ArrayData::I64(_) => "integer",
            ArrayData::F32(_) => "f32",
            ArrayData::F64(_) => "f64",
            ArrayData::Text(_) => "text",
        }
    }
}

impl ArrayData {
    /// Memory that the elements take.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::U8(values) => values.len(),
            Self::I64(values) => size_of_val(values.as_slice()),
            Self::F32(values) => size_of_val(values.as_slice()),
            Self::F64(values) => size_of_val(values.as_slice()),
            Self::Text(text) => text.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_outside_the_table_are_not_indices() {
        let array = |values: Vec<f64>| Array { shape: vec![values.len()], data: ArrayData::F64(values) };
        assert_eq!(array(vec![0.0, 2.0]).to_indices(3), Some(vec![0, 2]));
        for value in [-1.0, 3.0, 0.5, f64::NAN, f64::INFINITY, 1e30] {
            assert_eq!(array(vec![value]).to_indices(3), None, "{value}");
        }
        let wide = Array { shape: vec![1], data: ArrayData::I64(vec![1 << 32]) };
        assert_eq!(wide.to_indices(usize::MAX), None);
    }
}
