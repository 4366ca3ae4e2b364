//! Flatbuffers: tables of fields, each at an offset that the file says. Nothing is copied, and no offset is followed out of the bytes.
//!
//! A table begins with the distance back to its directory (u16 its size, u16 the table's size, then an offset for each field; 0: the
//! field has its default value). Vectors begin with their length. All little-endian.

use xavatar_formats::Fault;

/// A table of a flatbuffer.
#[derive(Clone, Copy)]
pub(super) struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// A vector of a flatbuffer, its items as bytes.
#[derive(Clone, Copy)]
pub(super) struct Vector<'a> {
    bytes: &'a [u8],
    first: usize,
    length: usize,
}

impl<'a> Table<'a> {
    /// The table that the whole file is.
    pub fn root(bytes: &'a [u8]) -> Result<Self, Fault> {
        Ok(Self { bytes, at: followed(bytes, 0)? })
    }

    /// Where a field's value stands, if it is not the default.
    fn field(&self, index: usize) -> Result<Option<usize>, Fault> {
        let back = i64::from(i32_at(self.bytes, self.at)?);
        let directory = usize::try_from(self.at as i64 - back).map_err(|_| beyond(self.at))?;
        let size = usize::from(u16_at(self.bytes, directory)?);
        let entry = 4 + 2 * index;
        if entry + 2 > size {
            return Ok(None);
        }
        let offset = usize::from(u16_at(self.bytes, directory.saturating_add(entry))?);
        Ok((offset != 0).then_some(self.at.saturating_add(offset)))
    }

    /// A field of one byte, 0 by default.
    pub fn byte(&self, index: usize) -> Result<u8, Fault> {
        self.field(index)?.map_or(Ok(0), |at| Ok(array_at::<1>(self.bytes, at)?[0]))
    }

    /// A field of four bytes.
    pub fn number(&self, index: usize, default: i32) -> Result<i32, Fault> {
        self.field(index)?.map_or(Ok(default), |at| i32_at(self.bytes, at))
    }

    /// A table within the table.
    pub fn table(&self, index: usize) -> Result<Option<Self>, Fault> {
        let at = self.field(index)?.map(|at| followed(self.bytes, at)).transpose()?;
        Ok(at.map(|at| Self { at, ..*self }))
    }

    /// Items of `size` bytes each; none by default.
    fn vector(&self, index: usize, size: usize) -> Result<Vector<'a>, Fault> {
        let Some(at) = self.field(index)? else { return Ok(Vector { bytes: self.bytes, first: 0, length: 0 }) };
        let start = followed(self.bytes, at)?;
        let length = i32_at(self.bytes, start)? as u32 as usize;
        let first = start + 4;
        let end = length.checked_mul(size).and_then(|bytes| bytes.checked_add(first));
        if end.is_none_or(|end| end > self.bytes.len()) {
            return Err(beyond(start));
        }
        Ok(Vector { bytes: self.bytes, first, length })
    }

    /// A vector of bytes.
    pub fn bytes(&self, index: usize) -> Result<&'a [u8], Fault> {
        let Vector { bytes, first, length } = self.vector(index, 1)?;
        Ok(&bytes[first..first + length])
    }

    /// A vector of numbers, at most as many: vectors may be shared between tables, memory for each reading is not.
    pub fn numbers(&self, index: usize, most: usize) -> Result<Vec<i32>, Fault> {
        let vector = self.vector(index, 4)?;
        if vector.length > most {
            let found = format_args!("a list of {}", vector.length);
            return Err(Fault::malformed(format_args!("byte {}", vector.first), found, format_args!("at most {most}")));
        }
        (0..vector.length).map(|item| i32_at(vector.bytes, vector.first + 4 * item)).collect()
    }

    /// A vector of tables.
    pub fn tables(&self, index: usize) -> Result<Vec<Self>, Fault> {
        let vector = self.vector(index, 4)?;
        let table =
            |item: usize| Ok(Self { bytes: vector.bytes, at: followed(vector.bytes, vector.first + 4 * item)? });
        (0..vector.length).map(table).collect()
    }
}

/// Where the offset at a place leads.
fn followed(bytes: &[u8], at: usize) -> Result<usize, Fault> {
    let offset = i32_at(bytes, at)? as u32 as usize;
    at.checked_add(offset).filter(|place| *place < bytes.len()).ok_or_else(|| beyond(at))
}

fn array_at<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], Fault> {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).copied().ok_or_else(|| beyond(at))
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, Fault> {
    array_at(bytes, at).map(u16::from_le_bytes)
}

fn i32_at(bytes: &[u8], at: usize) -> Result<i32, Fault> {
    array_at(bytes, at).map(i32::from_le_bytes)
}

fn beyond(at: usize) -> Fault {
    Fault::malformed(format_args!("byte {at}"), "an offset or a length beyond the file", "one within it")
}
