//! Numbers of a PLY body, one after the other, whatever its encoding.

use super::header::{Encoding, Layout, Scalar};
use crate::fault::{Fault, Parsed};

pub(super) struct Body<'a> {
    bytes: &'a [u8],
    position: usize,
    encoding: Encoding,
}

impl<'a> Body<'a> {
    pub(super) fn new(bytes: &'a [u8], position: usize, encoding: Encoding) -> Self {
        Self { bytes, position, encoding }
    }

    pub(super) fn bytes_left(&self) -> usize {
        self.bytes.len() - self.position
    }

    /// The next number; f64 holds every PLY type exactly.
    pub(super) fn number(&mut self, scalar: Scalar) -> Parsed<f64> {
        match self.encoding {
            Encoding::Ascii => self.word(scalar),
            Encoding::LittleEndian => self.binary(scalar, false),
            Encoding::BigEndian => self.binary(scalar, true),
        }
    }

    /// The length of a list, checked against the bytes that are left.
    pub(super) fn list_length(&mut self, count: Scalar, item: Scalar) -> Parsed<usize> {
        let position = self.position;
        let length = self.number(count)?;
        let smallest = if self.encoding == Encoding::Ascii { 2 } else { item.size() };
        // The last word of a file needs no separator after it.
        let most = (self.bytes_left() + 1) / smallest;
        if length < 0.0 || length > most as f64 {
            return Err(Fault::new(
                Self::place(position),
                format!("a list of {length}"),
                format!("at most the {most} that follow"),
            ));
        }
        Ok(length as usize)
    }

    pub(super) fn skip(&mut self, layout: Layout) -> Parsed<()> {
        match layout {
            Layout::Scalar(scalar) => self.number(scalar).map(drop),
            Layout::List { count, item } => {
                let length = self.list_length(count, item)?;
                (0..length).try_for_each(|_| self.number(item).map(drop))
            }
        }
    }

    /// Bytes from the start of the file.
    pub(super) fn position(&self) -> usize {
        self.position
    }

    /// A position as faults name it.
    pub(super) fn place(position: usize) -> String {
        format!("byte {position}")
    }

    fn end(&self) -> Fault {
        Fault::new(Self::place(self.position), "the end of the file", "more numbers (is the file truncated?)")
    }

    fn binary(&mut self, scalar: Scalar, big_endian: bool) -> Parsed<f64> {
        let size = scalar.size();
        let Some(slice) = self.bytes.get(self.position..self.position + size) else { return Err(self.end()) };
        self.position += size;
        let mut raw = [0u8; 8];
        raw[..size].copy_from_slice(slice);
        if big_endian {
            raw[..size].reverse();
        }
        let [b0, b1, b2, b3, ..] = raw;
        Ok(match scalar {
            Scalar::I8 => f64::from(b0 as i8),
            Scalar::U8 => f64::from(b0),
            Scalar::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            Scalar::U16 => f64::from(u16::from_le_bytes([b0, b1])),
            Scalar::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            Scalar::U32 => f64::from(u32::from_le_bytes([b0, b1, b2, b3])),
            Scalar::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            Scalar::F64 => f64::from_le_bytes(raw),
        })
    }

    fn word(&mut self, scalar: Scalar) -> Parsed<f64> {
        let rest = &self.bytes[self.position..];
        let blank = rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
        let length = rest[blank..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
        if length == 0 {
            return Err(self.end());
        }
        self.position += blank;
        let word = &rest[blank..blank + length];
        let text = std::str::from_utf8(word).ok();
        let expected = if scalar.is_integer() { "a whole number" } else { "a number" };
        let value = text
            .and_then(|text| text.parse::<f64>().ok())
            .filter(|value| !scalar.is_integer() || value.fract() == 0.0)
            .ok_or_else(|| {
                Fault::new(Self::place(self.position), format!("{:.40?}", String::from_utf8_lossy(word)), expected)
            })?;
        self.position += length;
        Ok(value)
    }
}
