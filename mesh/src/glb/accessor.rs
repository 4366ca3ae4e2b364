//! Numbers of a GLB's buffer, as its accessors describe them.

use super::container::Container;
use crate::Parsed;
use xavatar_formats::{Fault, excerpt};

/// Rows of equally many numbers.
struct Rows<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
    columns: usize,
    kind: Kind,
    normalized: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Kind {
    fn of(component_type: u32) -> Option<Self> {
        Some(match component_type {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// What normalised numbers are divided by.
    fn end(self) -> f32 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 | Self::F32 => 1.0,
        }
    }
}

impl Container<'_> {
    /// The rows of an accessor of `N` columns, or of more, of which the first are taken; finite numbers.
    pub(super) fn vectors<const N: usize>(&self, accessor: usize) -> Parsed<Vec<[f32; N]>> {
        let rows = self.rows(accessor)?;
        if rows.columns < N {
            return Err(Fault::malformed(name(accessor), format!("{} numbers a row", rows.columns), format!("{N}")));
        }
        let vectors: Vec<[f32; N]> = (0..rows.count).map(|row| std::array::from_fn(|c| rows.float(row, c))).collect();
        match vectors.iter().flatten().all(|value| value.is_finite()) {
            true => Ok(vectors),
            false => Err(Fault::malformed(name(accessor), "not all finite", "finite numbers")),
        }
    }

    /// The whole numbers of an accessor of one column.
    pub(super) fn indices(&self, accessor: usize) -> Parsed<Vec<u32>> {
        let rows = self.rows(accessor)?;
        if rows.columns != 1 || matches!(rows.kind, Kind::F32) {
            return Err(Fault::malformed(
                name(accessor),
                format!("{:?} in {} columns", rows.kind, rows.columns),
                "indices",
            ));
        }
        Ok((0..rows.count).map(|row| rows.integer(row, 0)).collect())
    }

    /// Rows of four whole numbers.
    pub(super) fn joints(&self, accessor: usize) -> Parsed<Vec<[u32; 4]>> {
        let rows = self.rows(accessor)?;
        if rows.columns != 4 || matches!(rows.kind, Kind::F32) {
            return Err(Fault::malformed(
                name(accessor),
                format!("{:?} in {} columns", rows.kind, rows.columns),
                "joints",
            ));
        }
        Ok((0..rows.count).map(|row| std::array::from_fn(|column| rows.integer(row, column))).collect())
    }

    fn rows(&self, index: usize) -> Parsed<Rows<'_>> {
        let accessors = &self.document.accessors;
        let wrong = |found: String, expected: &str| Fault::malformed(name(index), found, expected);
        let accessor = accessors.get(index).ok_or_else(|| wrong("missing".into(), "one that there is"))?;
        let kind = Kind::of(accessor.component_type)
            .ok_or_else(|| wrong(format!("of type {}", accessor.component_type), "5120 to 5126, but 5124"))?;
        let columns = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            other => return Err(wrong(excerpt(other), "SCALAR, VEC2, VEC3, VEC4 or MAT4")),
        };
        let (Some(view), None) = (accessor.buffer_view, &accessor.sparse) else {
            return Err(wrong("sparse, or without data".into(), "all its numbers in a buffer view"));
        };
        let (bytes, stride) = self.view(view)?;
        let size = columns * kind.size();
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(wrong(format!("{stride} bytes a row"), &format!("at least {size}")));
        }
        let bytes = bytes.get(accessor.byte_offset..).unwrap_or_default();
        // The last row need not be followed by the bytes between two.
        let possible = (bytes.len() + stride - size) / stride;
        if accessor.count > possible {
            return Err(wrong(
                format!("{} rows", accessor.count),
                &format!("at most the {possible} in its buffer view"),
            ));
        }
        Ok(Rows { bytes, stride, count: accessor.count, columns, kind, normalized: accessor.normalized })
    }
}

fn name(accessor: usize) -> String {
    format!("accessor {accessor}")
}

impl Rows<'_> {
    fn raw(&self, row: usize, column: usize) -> [u8; 4] {
        let size = self.kind.size();
        let place = row * self.stride + column * size;
        let mut raw = [0; 4];
        raw[..size].copy_from_slice(&self.bytes[place..place + size]);
        raw
    }

    fn float(&self, row: usize, column: usize) -> f32 {
        let raw = self.raw(row, column);
        let [b0, b1, ..] = raw;
        let value = match self.kind {
            Kind::F32 => f32::from_le_bytes(raw),
            Kind::U32 => u32::from_le_bytes(raw) as f32,
            Kind::I8 => f32::from(b0 as i8),
            Kind::U8 => f32::from(b0),
            Kind::I16 => f32::from(i16::from_le_bytes([b0, b1])),
            Kind::U16 => f32::from(u16::from_le_bytes([b0, b1])),
        };
        if self.normalized { (value / self.kind.end()).max(-1.0) } else { value }
    }

    /// Of the types that have no sign.
    fn integer(&self, row: usize, column: usize) -> u32 {
        u32::from_le_bytes(self.raw(row, column))
    }
}
