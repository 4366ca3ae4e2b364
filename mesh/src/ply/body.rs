//! Numbers of a PLY body, row by row, whatever its encoding.

use super::header::{Encoding, Layout, Scalar};
use crate::Parsed;
use xavatar_formats::{Fault, excerpt};

pub(super) struct Body<'a> {
    bytes: &'a [u8],
    position: usize,
    encoding: Encoding,
    row_start: usize,
    /// Where the row's line ends in an ascii file; the end of a binary one.
    row_end: usize,
}

impl<'a> Body<'a> {
    pub(super) fn new(bytes: &'a [u8], position: usize, encoding: Encoding) -> Self {
        let row_end = if encoding == Encoding::Ascii { position } else { bytes.len() };
        Self { bytes, position, encoding, row_start: position, row_end }
    }

    pub(super) fn bytes_left(&self) -> usize {
        self.bytes.len() - self.position
    }

    /// Goes to the next row: in an ascii file to the next line that is not empty, whatever else stands on this one.
    pub(super) fn next_row(&mut self) {
        if self.encoding != Encoding::Ascii {
            self.row_start = self.position;
            return;
        }
        let blank = self.bytes[self.row_end..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.position = self.row_end + blank;
        self.row_start = self.position;
        let line = self.bytes[self.position..].iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        self.row_end = line.map_or(self.bytes.len(), |length| self.position + length);
    }

    /// The row's next number; f64 holds every PLY type exactly.
    pub(super) fn number(&mut self, scalar: Scalar) -> Parsed<f64> {
        match self.encoding {
            Encoding::Ascii => self.word(scalar),
            Encoding::LittleEndian => self.binary(scalar, false),
            Encoding::BigEndian => self.binary(scalar, true),
        }
    }

    /// Fills `numbers` with those of a list, whose length is checked against the bytes that are left.
    pub(super) fn list(&mut self, count: Scalar, item: Scalar, numbers: &mut Vec<f64>) -> Parsed<()> {
        numbers.clear();
        let start = self.position;
        let length = self.number(count)?;
        let smallest = if self.encoding == Encoding::Ascii { 2 } else { item.size() };
        // The last word of a line needs no separator after it.
        let most = (self.row_end - self.position + 1) / smallest;
        if length < 0.0 || length > most as f64 {
            let place = self.place(start);
            return Err(Fault::malformed(
                place,
                format!("a list of {length}"),
                format!("at most the {most} that follow"),
            ));
        }
        for _ in 0..length as usize {
            numbers.push(self.number(item)?);
        }
        Ok(())
    }

    pub(super) fn skip(&mut self, layout: Layout) -> Parsed<()> {
        match layout {
            Layout::Scalar(scalar) => self.number(scalar).map(drop),
            Layout::List { count, item } => self.list(count, item, &mut Vec::new()),
        }
    }

    /// Where the row begins, as faults name it.
    pub(super) fn row_place(&self) -> String {
        self.place(self.row_start)
    }

    fn place(&self, position: usize) -> String {
        match self.encoding {
            Encoding::Ascii => format!("line {}", 1 + line_ends(&self.bytes[..position])),
            Encoding::LittleEndian | Encoding::BigEndian => format!("byte {position}"),
        }
    }

    fn binary(&mut self, scalar: Scalar, big_endian: bool) -> Parsed<f64> {
        let size = scalar.size();
        let Some(slice) = self.bytes.get(self.position..self.position + size) else {
            return Err(Fault::malformed(
                self.place(self.position),
                "the end of the file",
                "more numbers (is the file truncated?)",
            ));
        };
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
        let rest = &self.bytes[self.position..self.row_end];
        let blank = rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        let length = rest[blank..].iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
        if length == 0 {
            let (found, expected) = match self.row_end == self.bytes.len() {
                true => ("the end of the file", "more numbers (is the file truncated?)"),
                false => ("the end of the line", "more numbers: a line for each row"),
            };
            return Err(Fault::malformed(self.place(self.position), found, expected));
        }
        self.position += blank;
        let word = &rest[blank..blank + length];
        let expected = if scalar.is_integer() { "a whole number" } else { "a number" };
        let value = std::str::from_utf8(word)
            .ok()
            .and_then(|text| text.parse::<f64>().ok())
            .filter(|value| !scalar.is_integer() || value.fract() == 0.0)
            .ok_or_else(|| {
                Fault::malformed(self.place(self.position), excerpt(&String::from_utf8_lossy(word)), expected)
            })?;
        self.position += length;
        Ok(value)
    }
}

/// How many lines end in some text, each with \n, \r\n or \r.
fn line_ends(text: &[u8]) -> usize {
    let newlines = text.iter().filter(|byte| **byte == b'\n').count();
    if newlines > 0 { newlines } else { text.iter().filter(|byte| **byte == b'\r').count() }
}
