//! Bounded reading of a pickle's bytes: every length is checked against what is left before anything is taken.

use crate::fault::Fault;

/// A position in the pickle's bytes.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    pub(super) fn position(&self) -> usize {
        self.position
    }

    /// The next `length` bytes.
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], Fault> {
        let left = &self.bytes[self.position..];
        let taken = left.get(..length).ok_or_else(|| {
            Fault::malformed(
                format_args!("byte {}", self.position),
                format_args!("{} bytes to the end", left.len()),
                format_args!("{length} more bytes"),
            )
        })?;
        self.position += length;
        Ok(taken)
    }

    /// The next bytes as a fixed-size array, for `from_le_bytes` and friends.
    pub(super) fn array<const LENGTH: usize>(&mut self) -> Result<[u8; LENGTH], Fault> {
        let mut array = [0; LENGTH];
        array.copy_from_slice(self.take(LENGTH)?);
        Ok(array)
    }

    pub(super) fn byte(&mut self) -> Result<u8, Fault> {
        Ok(self.array::<1>()?[0])
    }

    /// Bytes preceded by their number, an unsigned little-endian integer of `WIDTH` bytes.
    pub(super) fn counted<const WIDTH: usize>(&mut self) -> Result<&'a [u8], Fault> {
        let mut wide = [0; 8];
        wide[..WIDTH].copy_from_slice(&self.array::<WIDTH>()?);
        // A length beyond usize is beyond the file as well, which `take` reports.
        self.take(usize::try_from(u64::from_le_bytes(wide)).unwrap_or(usize::MAX))
    }

    /// The bytes up to the next newline, which is consumed.
    pub(super) fn line_bytes(&mut self) -> Result<&'a [u8], Fault> {
        let left = &self.bytes[self.position..];
        let length = left.iter().position(|&byte| byte == b'\n').ok_or_else(|| {
            Fault::malformed(format_args!("byte {}", self.position), "no newline to the end", "a line")
        })?;
        self.position += length + 1;
        Ok(&left[..length])
    }

    /// The text up to the next newline, which is consumed.
    pub(super) fn line(&mut self) -> Result<&'a str, Fault> {
        let start = self.position;
        std::str::from_utf8(self.line_bytes()?)
            .map_err(|_| Fault::malformed(format_args!("byte {start}"), "not text", "a line of text"))
    }
}
