//! Encodings e(x) of points: what a network sees instead of bare coordinates.
//!
//! Blocks of R rows at a time: points (R, D), directions v (R, D), encoded rows and cotangents (E of every `stride` entries).
//! An encoding gives e(x), e'(x) v, e'(x)^T c and the second-order term v e''(x)^T c; one with a table of its own parameters
//! (the hash grid) also the table's gradients of c . e(x) and c . e'(x) v.

mod cell;
mod frequency;
mod grid;
mod grid_shape;

use serde::{Deserialize, Serialize};

use crate::{Error, Real, Result};

pub(crate) use frequency::FrequencyEncoding;
pub(crate) use grid::{Cells, HashGrid};
pub use grid_shape::{Bounds, HashGridShape};

/// Most coordinates that a point may have.
pub(crate) const MOST_COORDINATES: usize = 8;

/// Which encoding a network has, and its extents.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EncodingShape {
    /// Sines and cosines of that many frequencies of every coordinate; 0 for the identity.
    Frequencies(usize),
    /// A multi-resolution hash grid over the first three coordinates.
    HashGrid {
        /// Its levels.
        grid: HashGridShape,
        /// The box it fills.
        bounds: Bounds,
    },
}

impl EncodingShape {
    /// A grid over `bounds` if there is one, else `frequencies`.
    pub(crate) fn of(grid: Option<HashGridShape>, bounds: Bounds, frequencies: usize) -> Self {
        grid.map_or(Self::Frequencies(frequencies), |grid| Self::HashGrid { grid, bounds })
    }
}

/// The encoding of a network.
#[derive(Clone, Debug)]
pub(crate) enum Encoding {
    Frequencies(FrequencyEncoding),
    HashGrid(HashGrid),
}

/// The direction v of each row.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Directions<'a, T> {
    /// (R, D).
    Rows(&'a [T]),
    /// The same coordinate axis for all rows.
    Axis(usize),
}

impl<T: Real> Directions<'_, T> {
    #[inline(always)]
    fn row(self, row: usize, dimensions: usize) -> [T; MOST_COORDINATES] {
        let mut direction = [T::zero(); MOST_COORDINATES];
        match self {
            Self::Rows(rows) => {
                direction[..dimensions].copy_from_slice(&rows[row * dimensions..(row + 1) * dimensions])
            }
            Self::Axis(axis) => direction[axis] = T::one(),
        }
        direction
    }
}

impl Encoding {
    /// The encoding of points of `dimensions` coordinates.
    pub fn new(shape: &EncodingShape, dimensions: usize) -> Result<Self> {
        match *shape {
            EncodingShape::Frequencies(frequencies) if frequencies > 16 => {
                Err(Error::Shape { name: "frequencies", found: frequencies.to_string(), expected: "at most 16".into() })
            }
            EncodingShape::Frequencies(frequencies) => {
                Ok(Self::Frequencies(FrequencyEncoding { dimensions, frequencies }))
            }
            EncodingShape::HashGrid { grid, bounds } => Ok(Self::HashGrid(HashGrid::new(grid, bounds, dimensions)?)),
        }
    }

    /// E.
    pub fn width(&self) -> usize {
        match self {
            Self::Frequencies(encoding) => encoding.width(),
            Self::HashGrid(grid) => grid.width(),
        }
    }

    /// (entries, features) of the table; no entries without one.
    pub fn table_shape(&self) -> [usize; 2] {
        match self {
            Self::Frequencies(_) => [0, 0],
            Self::HashGrid(grid) => [grid.entries(), grid.features()],
        }
    }

    /// Writes e(x) and remembers the rows' cells for the other calls on the same points.
    pub fn encode<T: Real>(&self, table: &[T], points: &[T], cells: &mut Cells<T>, encoded: &mut [T], stride: usize) {
        match self {
            Self::Frequencies(encoding) => {
                let rows = points.chunks_exact(encoding.dimensions).zip(encoded.chunks_mut(stride));
                rows.for_each(|(point, encoded)| encoding.encode(point, &mut encoded[..encoding.width()]));
            }
            Self::HashGrid(grid) => grid.encode(table, points, cells, encoded, stride),
        }
    }

    /// Writes e'(x) v.
    pub fn push_forward<T: Real>(
        &self,
        table: &[T],
        points: &[T],
        cells: &Cells<T>,
        directions: Directions<T>,
        tangents: &mut [T],
        stride: usize,
    ) {
        match self {
            Self::Frequencies(encoding) => {
                let (dimensions, width) = (encoding.dimensions, encoding.width());
                let rows = points.chunks_exact(dimensions).zip(tangents.chunks_mut(stride));
                for (row, (point, tangent)) in rows.enumerate() {
                    let direction = directions.row(row, dimensions);
                    encoding.push_forward(point, &direction[..dimensions], &mut tangent[..width]);
                }
            }
            Self::HashGrid(grid) => grid.push_forward(table, cells, directions, tangents, stride),
        }
    }

    /// Adds e'(x)^T c to `gradients` (R, D).
    pub fn pull_back<T: Real>(
        &self,
        table: &[T],
        points: &[T],
        cells: &Cells<T>,
        cotangents: &[T],
        stride: usize,
        gradients: &mut [T],
    ) {
        match self {
            Self::Frequencies(encoding) => {
                let (dimensions, width) = (encoding.dimensions, encoding.width());
                let rows = points.chunks_exact(dimensions).zip(cotangents.chunks(stride));
                for ((point, cotangent), gradient) in rows.zip(gradients.chunks_exact_mut(dimensions)) {
                    encoding.pull_back(point, &cotangent[..width], gradient);
                }
            }
            Self::HashGrid(grid) => grid.pull_back(table, cells, cotangents, stride, gradients),
        }
    }

    /// Adds v e''(x)^T c to `gradients` (R, D).
    #[expect(clippy::too_many_arguments, reason = "one more row array than the other sweeps")]
    pub fn pull_back_second<T: Real>(
        &self,
        table: &[T],
        points: &[T],
        cells: &Cells<T>,
        directions: Directions<T>,
        cotangents: &[T],
        stride: usize,
        gradients: &mut [T],
    ) {
        match self {
            Self::Frequencies(encoding) => {
                let (dimensions, width) = (encoding.dimensions, encoding.width());
                let rows = points.chunks_exact(dimensions).zip(cotangents.chunks(stride));
                for (row, ((point, cotangent), gradient)) in
                    rows.zip(gradients.chunks_exact_mut(dimensions)).enumerate()
                {
                    let direction = directions.row(row, dimensions);
                    encoding.pull_back_second(point, &direction[..dimensions], &cotangent[..width], gradient);
                }
            }
            Self::HashGrid(grid) => {
                grid.pull_back_second(table, cells, directions, cotangents, stride, gradients);
            }
        }
    }

    /// Adds the table's gradient of c . e(x).
    pub fn pull_back_table<T: Real>(&self, cells: &Cells<T>, cotangents: &[T], stride: usize, gradient: &mut [T]) {
        if let Self::HashGrid(grid) = self {
            grid.pull_back_table(cells, cotangents, stride, gradient);
        }
    }

    /// Adds the table's gradient of c . e'(x) v.
    pub fn pull_back_table_along<T: Real>(
        &self,
        cells: &Cells<T>,
        directions: Directions<T>,
        cotangents: &[T],
        stride: usize,
        gradient: &mut [T],
    ) {
        if let Self::HashGrid(grid) = self {
            grid.pull_back_table_along(cells, directions, cotangents, stride, gradient);
        }
    }
}
