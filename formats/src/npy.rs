//! The npy format (numpy's `format.py`, versions 1 to 3): a magic, a header that is a Python dict literal, raw elements.
//!
//! Row- or column-major, either byte order. The header's shape is checked against the bytes that follow before
//! anything is allocated for them, on the file's [`Budget`]. Arrays of Python objects are refused; inside an npz the allow-list pickle
//! interpreter reads them.

use std::path::Path;

use crate::budget::Budget;
use crate::element::{ElementKind, ElementType, element_count};
use crate::fault::{Fault, excerpt};
use crate::input_file::read_bytes;
use crate::{Array, ArrayData, Result};

const MAGIC: &[u8] = b"\x93NUMPY";

/// Longer headers belong to record arrays with very many fields, which are not read.
const MAX_HEADER_BYTES: usize = 1 << 16;

/// Numpy aligns the elements so that they can be mapped into memory.
const DATA_ALIGNMENT: usize = 64;

/// Reads a `.npy` file.
///
/// # Errors
/// [`Error::Malformed`](crate::Error::Malformed) if the file is not one array of numbers or one string, or is cut short;
/// [`Error::Refused`](crate::Error::Refused) if it holds pickled objects.
pub fn read_npy(path: impl AsRef<Path>) -> Result<Array> {
    let path = path.as_ref();
    parse_npy(&read_bytes(path)?).map_err(|fault| fault.in_file(path, "npy array"))
}

/// The array of an npy file's bytes.
///
/// # Errors
/// As [`read_npy`], without the file's name.
pub fn parse_npy(bytes: &[u8]) -> std::result::Result<Array, Fault> {
    NpyFile::parse(bytes)?.array(&Budget::of_file(bytes.len()))
}

/// An npy file whose header has been read.
pub(crate) struct NpyFile<'a> {
    pub(crate) element: ElementType,
    pub(crate) shape: Vec<usize>,
    fortran_order: bool,
    /// What follows the header: elements, or a pickle if they are objects.
    pub(crate) data: &'a [u8],
}

impl<'a> NpyFile<'a> {
    pub(crate) fn parse(bytes: &'a [u8]) -> std::result::Result<Self, Fault> {
        let truncated = || Fault::malformed("header", format_args!("{} bytes", bytes.len()), "a whole npy header");
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| {
            Fault::malformed("byte 0", excerpt(&String::from_utf8_lossy(&bytes[..bytes.len().min(6)])), "\\x93NUMPY")
        })?;
        let (&[major, _minor], rest) = rest.split_first_chunk::<2>().ok_or_else(truncated)?;
        let (length, rest) = match major {
            1 => {
                let (length, rest) = rest.split_first_chunk::<2>().ok_or_else(truncated)?;
                (u16::from_le_bytes(*length) as usize, rest)
            }
            2 | 3 => {
                let (length, rest) = rest.split_first_chunk::<4>().ok_or_else(truncated)?;
                (u32::from_le_bytes(*length) as usize, rest)
            }
            other => return Err(Fault::malformed("format version", other, "1, 2 or 3")),
        };
        if length > MAX_HEADER_BYTES {
            return Err(Fault::malformed("header length", length, format_args!("at most {MAX_HEADER_BYTES}")));
        }
        let (header, data) = rest.split_at_checked(length).ok_or_else(truncated)?;
        let header = std::str::from_utf8(header).map_err(|_| Fault::malformed("header", "not text", "UTF-8"))?;
        let header = Header::parse(header)?;
        let element = ElementType::parse(header.descr)?;
        element_count(&header.shape)?;
        Ok(Self { element, shape: header.shape, fortran_order: header.fortran_order, data })
    }

    pub(crate) fn is_objects(&self) -> bool {
        self.element.kind == ElementKind::Object
    }

    pub(crate) fn array(self, budget: &Budget) -> std::result::Result<Array, Fault> {
        self.element.array(self.shape, self.fortran_order, self.data, budget)
    }
}

/// The three entries of the header's dict.
struct Header<'a> {
    descr: &'a str,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl<'a> Header<'a> {
    /// Reads `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`, keys in any order.
    fn parse(text: &'a str) -> std::result::Result<Self, Fault> {
        let invalid = || Fault::malformed("header", excerpt(text), "a dict of descr, fortran_order and shape");
        let mut rest = text.trim().strip_prefix('{').ok_or_else(invalid)?.trim_start();
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        while !rest.starts_with('}') {
            let (key, after) = quoted(rest).ok_or_else(invalid)?;
            rest = after.trim_start().strip_prefix(':').ok_or_else(invalid)?.trim_start();
            match key {
                "descr" if rest.starts_with('[') => {
                    return Err(Fault::malformed("descr", excerpt(rest), "one element type, not records"));
                }
                "descr" => {
                    let (value, after) = quoted(rest).ok_or_else(invalid)?;
                    (descr, rest) = (Some(value), after);
                }
                "fortran_order" => {
                    let is_true = rest.starts_with("True");
                    rest = rest.strip_prefix(if is_true { "True" } else { "False" }).ok_or_else(invalid)?;
                    fortran_order = Some(is_true);
                }
                "shape" => {
                    let (inside, after) =
                        rest.strip_prefix('(').and_then(|rest| rest.split_once(')')).ok_or_else(invalid)?;
                    shape = Some(extents(inside).ok_or_else(invalid)?);
                    rest = after;
                }
                _ => return Err(invalid()),
            }
            rest = rest.trim_start();
            rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        }
        Ok(Self {
            descr: descr.ok_or_else(invalid)?,
            fortran_order: fortran_order.ok_or_else(invalid)?,
            shape: shape.ok_or_else(invalid)?,
        })
    }
}

/// A quoted string without escapes at the start of `text`, and what follows it.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|&character| character == '\'' || character == '"')?;
    text[1..].split_once(quote)
}

/// The numbers of `2, 3` or `7,`; Python 2 wrote `7L`.
fn extents(inside: &str) -> Option<Vec<usize>> {
    let inside = inside.trim();
    let inside = inside.strip_suffix(',').unwrap_or(inside);
    if inside.is_empty() {
        return Some(Vec::new());
    }
    inside.split(',').map(|extent| extent.trim().trim_end_matches('L').parse().ok()).collect()
}

/// The whole npy file of an array, version 1.0, row-major, little-endian.
pub fn npy_bytes(array: &Array) -> Vec<u8> {
    let text_units: Vec<u32>;
    let (descr, data): (String, Vec<u8>) = match &array.data {
        ArrayData::U8(values) => ("|u1".into(), values.clone()),
        ArrayData::I64(values) => ("<i8".into(), values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        ArrayData::F32(values) => ("<f4".into(), values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        ArrayData::F64(values) => ("<f8".into(), values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        ArrayData::Text(text) => {
            text_units = text.chars().map(u32::from).collect();
            // Numpy has no zero-width strings in files: an empty one is a single padding zero.
            let padded = if text_units.is_empty() { &[0][..] } else { &text_units };
            (format!("<U{}", padded.len()), padded.iter().flat_map(|unit| unit.to_le_bytes()).collect())
        }
    };
    let extents: String = array.shape.iter().map(|extent| format!("{extent},")).collect();
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({extents}), }}");
    let preamble = MAGIC.len() + 4;
    let padding = (preamble + header.len() + 1).next_multiple_of(DATA_ALIGNMENT) - (preamble + header.len() + 1);
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');

    let mut bytes = Vec::with_capacity(preamble + header.len() + data.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend_from_slice(&data);
    bytes
}
