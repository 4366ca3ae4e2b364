//! Numpy element types (`<f4`, `|u1`, `>i8`, ...) and how their bytes become [`ArrayData`].
//!
//! Shared by the npy and the pickle reader. Either byte order, row-major (C) or column-major (Fortran) storage.
//! Booleans and u8 become `U8`, other integers `I64`, f16 and f32 `F32`, f64 `F64`; one string becomes `Text`.
//! Complex numbers, dates, records and long doubles are not read.

use half::f16;

use crate::budget::Budget;
use crate::fault::{Fault, excerpt};
use crate::{Array, ArrayData};

/// More dimensions than numpy itself allows (64) is a corrupt header.
const MAX_DIMENSIONS: usize = 64;

/// The kind of an element, numpy's type character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ElementKind {
    Boolean,
    Unsigned,
    Signed,
    Float,
    /// UTF-32 code units, padded with zeros.
    Unicode,
    /// Bytes, padded with zeros.
    ByteString,
    /// Pickled Python objects.
    Object,
}

/// A numpy element type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ElementType {
    pub(crate) kind: ElementKind,
    /// Bytes an element occupies.
    pub(crate) size: usize,
    pub(crate) big_endian: bool,
}

impl ElementType {
    /// Reads numpy's notation: an optional byte order, a kind and a count (`f4`, `<U7`, `|O`).
    pub(crate) fn parse(text: &str) -> Result<Self, Fault> {
        let unknown = || {
            Fault::malformed("element type", excerpt(text), "a boolean, integer, float (2 to 8 bytes) or string type")
        };
        let (big_endian, rest) = match text.as_bytes().first() {
            Some(b'>') => (true, &text[1..]),
            Some(b'<' | b'|' | b'=') => (false, &text[1..]),
            _ => (false, text),
        };
        let kind = rest.chars().next().ok_or_else(unknown)?;
        let count = match &rest[kind.len_utf8()..] {
            "" if kind == 'O' => 8,
            digits => digits.parse::<usize>().map_err(|_| unknown())?,
        };
        let (kind, size) = match (kind, count) {
            ('b', 1) => (ElementKind::Boolean, 1),
            ('u', 1 | 2 | 4 | 8) => (ElementKind::Unsigned, count),
            ('i', 1 | 2 | 4 | 8) => (ElementKind::Signed, count),
            ('f', 2 | 4 | 8) => (ElementKind::Float, count),
            ('U', _) => (ElementKind::Unicode, count.checked_mul(4).ok_or_else(unknown)?),
            ('S' | 'a', _) => (ElementKind::ByteString, count),
            ('O', _) => (ElementKind::Object, 8),
            _ => return Err(unknown()),
        };
        Ok(Self { kind, size, big_endian })
    }

    pub(crate) fn is_text(self) -> bool {
        matches!(self.kind, ElementKind::Unicode | ElementKind::ByteString)
    }

    /// An array of these elements from its stored bytes, whose number must be exactly what `shape` says.
    pub(crate) fn array(
        self,
        shape: Vec<usize>,
        fortran_order: bool,
        bytes: &[u8],
        budget: &Budget,
    ) -> Result<Array, Fault> {
        let count = element_count(&shape)?;
        let needed = count.checked_mul(self.size);
        if needed != Some(bytes.len()) {
            return Err(Fault::malformed(
                format_args!("data of the array of shape {shape:?}"),
                format_args!("{} bytes", bytes.len()),
                format_args!("{count} elements of {} bytes", self.size),
            ));
        }
        if count > 0 && fortran_order && shape.iter().filter(|&&extent| extent > 1).count() > 1 {
            let reordered = row_major(&shape, self.size, bytes, budget)?;
            let data = self.decode(&reordered, count, budget)?;
            budget.give_back(reordered.len());
            return Ok(Array { shape, data });
        }
        let data = self.decode(bytes, count, budget)?;
        Ok(Array { shape, data })
    }

    /// One string per element, of a Unicode or byte-string type.
    pub(crate) fn strings(self, bytes: &[u8], budget: &Budget) -> Result<Vec<String>, Fault> {
        if self.size == 0 {
            return Ok(Vec::new());
        }
        let elements = bytes.chunks_exact(self.size);
        budget.collect(elements.len(), "strings", elements.map(|element| self.string(element, budget)))
    }

    fn decode(self, bytes: &[u8], count: usize, budget: &Budget) -> Result<ArrayData, Fault> {
        let integers = |values: Result<Vec<i64>, Fault>| values.map(ArrayData::I64);
        match (self.kind, self.size) {
            (ElementKind::Boolean, _) => {
                self.each(bytes, budget, u8::from_le_bytes, |byte| Ok(u8::from(byte != 0))).map(ArrayData::U8)
            }
            (ElementKind::Unsigned, 1) => self.each(bytes, budget, u8::from_le_bytes, Ok).map(ArrayData::U8),
            (ElementKind::Unsigned, 2) => integers(self.each(bytes, budget, u16::from_le_bytes, |v| Ok(v.into()))),
            (ElementKind::Unsigned, 4) => integers(self.each(bytes, budget, u32::from_le_bytes, |v| Ok(v.into()))),
            (ElementKind::Unsigned, _) => {
                let beyond = |_| Fault::malformed("array", "an integer above 2^63 - 1", "64-bit signed integers");
                integers(self.each(bytes, budget, u64::from_le_bytes, |value| i64::try_from(value).map_err(beyond)))
            }
            (ElementKind::Signed, 1) => integers(self.each(bytes, budget, i8::from_le_bytes, |v| Ok(v.into()))),
            (ElementKind::Signed, 2) => integers(self.each(bytes, budget, i16::from_le_bytes, |v| Ok(v.into()))),
            (ElementKind::Signed, 4) => integers(self.each(bytes, budget, i32::from_le_bytes, |v| Ok(v.into()))),
            (ElementKind::Signed, _) => integers(self.each(bytes, budget, i64::from_le_bytes, Ok)),
            (ElementKind::Float, 2) => {
                self.each(bytes, budget, f16::from_le_bytes, |value| Ok(value.into())).map(ArrayData::F32)
            }
            (ElementKind::Float, 4) => self.each(bytes, budget, f32::from_le_bytes, Ok).map(ArrayData::F32),
            (ElementKind::Float, _) => self.each(bytes, budget, f64::from_le_bytes, Ok).map(ArrayData::F64),
            (ElementKind::Unicode | ElementKind::ByteString, _) if count == 1 => {
                self.string(bytes, budget).map(ArrayData::Text)
            }
            (ElementKind::Unicode | ElementKind::ByteString, _) => {
                Err(Fault::malformed("array", format_args!("{count} strings"), "numbers, or a single string"))
            }
            (ElementKind::Object, _) => Err(Fault::refused("an array of Python objects")),
        }
    }

    /// Elements of `SIZE` bytes, each widened.
    fn each<const SIZE: usize, Stored, Wide>(
        self,
        bytes: &[u8],
        budget: &Budget,
        little_endian: fn([u8; SIZE]) -> Stored,
        widen: impl Fn(Stored) -> Result<Wide, Fault>,
    ) -> Result<Vec<Wide>, Fault> {
        let (elements, _) = bytes.as_chunks::<SIZE>();
        let element = |&(mut stored): &[u8; SIZE]| {
            if self.big_endian {
                stored.reverse();
            }
            widen(little_endian(stored))
        };
        budget.collect(elements.len(), "an array", elements.iter().map(element))
    }

    /// The text of one element, without its padding.
    fn string(self, element: &[u8], budget: &Budget) -> Result<String, Fault> {
        let invalid = || Fault::malformed("string", "an invalid character", "Unicode text");
        let utf8 = if self.kind == ElementKind::Unicode {
            let units = self.each(element, budget, u32::from_le_bytes, Ok)?;
            let text = &units[..units.iter().rposition(|&unit| unit != 0).map_or(0, |last| last + 1)];
            let mut utf8 = budget.vector(element.len(), "text")?;
            for &unit in text {
                let character = char::from_u32(unit).ok_or_else(invalid)?;
                utf8.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
            }
            budget.give_back(element.len());
            utf8
        } else {
            let text = &element[..element.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1)];
            let mut utf8 = budget.vector(text.len(), "text")?;
            utf8.extend_from_slice(text);
            utf8
        };
        String::from_utf8(utf8).map_err(|_| invalid())
    }
}

/// The number of elements of an array of this shape.
pub fn element_count(shape: &[usize]) -> Result<usize, Fault> {
    let absurd = || {
        let shown = &shape[..shape.len().min(8)];
        Fault::malformed("shape", format_args!("{shown:?}"), "at most 64 extents whose product fits in memory")
    };
    if shape.len() > MAX_DIMENSIONS {
        return Err(absurd());
    }
    // Zero extents must not hide an overflow in the others: later arithmetic on parts of the shape relies on it.
    let bound = shape.iter().try_fold(1usize, |product, &extent| product.checked_mul(extent.max(1)));
    let bound = bound.filter(|&bound| bound <= isize::MAX as usize).ok_or_else(absurd)?;
    Ok(if shape.contains(&0) { 0 } else { bound })
}

/// Column-major storage reordered to row-major. `size` bytes an element.
fn row_major(shape: &[usize], size: usize, column_major: &[u8], budget: &Budget) -> Result<Vec<u8>, Fault> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = size;
    for &extent in shape {
        strides.push(stride);
        stride *= extent;
    }
    let mut reordered = budget.vector(column_major.len(), "reordering an array")?;
    let mut index = vec![0; shape.len()];
    let mut offset = 0;
    while reordered.len() < column_major.len() {
        reordered.extend_from_slice(&column_major[offset..offset + size]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            offset += strides[axis];
            if index[axis] < shape[axis] {
                break;
            }
            offset -= strides[axis] * shape[axis];
            index[axis] = 0;
        }
    }
    Ok(reordered)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(element: &str, shape: &[usize], fortran_order: bool, bytes: &[u8]) -> Result<Array, Fault> {
        ElementType::parse(element)?.array(shape.to_vec(), fortran_order, bytes, &Budget::of_file(bytes.len()))
    }

    #[test]
    fn byte_order_does_not_change_values() {
        let little: Vec<u8> = [1.5f32, -2.0].iter().flat_map(|value| value.to_le_bytes()).collect();
        let big: Vec<u8> = [1.5f32, -2.0].iter().flat_map(|value| value.to_be_bytes()).collect();
        let expected = Array { shape: vec![2], data: ArrayData::F32(vec![1.5, -2.0]) };
        assert_eq!(array("<f4", &[2], false, &little).unwrap(), expected);
        assert_eq!(array(">f4", &[2], false, &big).unwrap(), expected);
    }

    // element (i, j, k) is at i + 2 j + 6 k in column-major and at 12 i + 4 j + k in row-major order
    #[test]
    fn fortran_order_becomes_row_major() {
        let stored: Vec<u8> = (0..24).collect();
        let read = array("|u1", &[2, 3, 4], true, &stored).unwrap();
        let ArrayData::U8(values) = read.data else { panic!("u1 is read as U8") };
        for i in 0..2 {
            for j in 0..3 {
                for k in 0..4 {
                    assert_eq!(values[12 * i + 4 * j + k] as usize, i + 2 * j + 6 * k);
                }
            }
        }
    }

    #[test]
    fn every_integer_width_keeps_its_extremes() {
        let read = |element: &str, bytes: &[u8]| array(element, &[1], false, bytes).unwrap().data;
        assert_eq!(read("|i1", &[0x80]), ArrayData::I64(vec![-128]));
        assert_eq!(read("<i2", &i16::MIN.to_le_bytes()), ArrayData::I64(vec![i16::MIN.into()]));
        assert_eq!(read("<u4", &u32::MAX.to_le_bytes()), ArrayData::I64(vec![u32::MAX.into()]));
        assert_eq!(read("<i8", &i64::MIN.to_le_bytes()), ArrayData::I64(vec![i64::MIN]));
        assert_eq!(read("<f2", &f16::from_f32(0.25).to_le_bytes()), ArrayData::F32(vec![0.25]));
        assert!(array("<u8", &[1], false, &u64::MAX.to_le_bytes()).is_err());
    }

    #[test]
    fn a_shape_that_lies_about_its_data_is_an_error() {
        for shape in [&[3][..], &[1, 1], &[usize::MAX, 2], &[0], &[usize::MAX, usize::MAX, 0]] {
            assert!(array("<f4", shape, false, &[0; 8]).is_err(), "{shape:?}");
        }
    }

    #[test]
    fn strings_lose_their_padding() {
        let utf32: Vec<u8> = "né\0\0".chars().flat_map(|unit| (unit as u32).to_le_bytes()).collect();
        assert_eq!(array("<U4", &[], false, &utf32).unwrap().data, ArrayData::Text("né".into()));
        assert_eq!(array("|S6", &[1], false, b"male\0\0").unwrap().data, ArrayData::Text("male".into()));
    }

    #[test]
    fn types_that_are_not_read_are_named() {
        for text in ["<c8", "<M8[s]", "|V16", "<f16", "", "<", "é4", "U99999999999999999999"] {
            assert!(ElementType::parse(text).is_err(), "{text}");
        }
    }
}
