//! Multi-resolution hash-grid encoding (Mueller et al. 2022): e(x) = [x, grid_1(x), ..., grid_L(x)], trilinear in each level's cell.
//!
//! The grid sees the first three of D coordinates, clamped to its box (derivative zero outside); all D pass through unchanged.
//! Table (entries, F), levels one after the other; E = D + L F. Level by level over a block's rows, so that a level's entries
//! stay in cache while they are wanted. The rows' cells are found once and kept for the derivatives.

use super::cell::{curvature, gradient, weight_slopes, weights};
use super::grid_shape::Level;
use super::{Bounds, Directions, HashGridShape};
use crate::activation::vectorised;
use crate::{Real, Result};

/// A hash grid, without its table.
#[derive(Clone, Debug)]
pub(crate) struct HashGrid {
    dimensions: usize,
    features: usize,
    bounds: Bounds,
    levels: Vec<Level>,
}

/// Where a block's R points lie in each level.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells<T> {
    /// Entries of the cell's corners, (L, R).
    corners: Vec<[u32; 8]>,
    /// Place in the cell, (L, R).
    places: Vec<[T; 3]>,
    /// 1 where a coordinate is inside the box, else 0, (R).
    inside: Vec<[T; 3]>,
}

/// Calls a function that is generic in the number of features.
macro_rules! with_features {
    ($features:expr, $function:ident($($argument:expr),* $(,)?) $(,)?) => {
        match $features {
            1 => $function::<T, 1>($($argument),*),
            2 => $function::<T, 2>($($argument),*),
            _ => $function::<T, 4>($($argument),*),
        }
    };
}

impl HashGrid {
    pub fn new(shape: HashGridShape, bounds: Bounds, dimensions: usize) -> Result<Self> {
        shape.validate(&bounds)?;
        if dimensions < 3 {
            return Err(crate::Error::Shape {
                name: "inputs",
                found: dimensions.to_string(),
                expected: "at least the 3 coordinates that a grid encodes".into(),
            });
        }
        Ok(Self { dimensions, features: shape.features, levels: shape.levels(&bounds), bounds })
    }

    pub fn width(&self) -> usize {
        self.dimensions + self.levels.len() * self.features
    }

    pub fn features(&self) -> usize {
        self.features
    }

    pub fn entries(&self) -> usize {
        self.levels.iter().map(|level| level.entries as usize).sum()
    }

    pub fn encode<T: Real>(&self, table: &[T], points: &[T], cells: &mut Cells<T>, encoded: &mut [T], stride: usize) {
        self.locate(points, cells);
        for (point, encoded) in points.chunks_exact(self.dimensions).zip(encoded.chunks_mut(stride)) {
            encoded[..self.dimensions].copy_from_slice(point);
        }
        for level in 0..self.levels.len() {
            let rows = cells.level(level);
            with_features!(
                self.features,
                interpolate(table, rows, value_weights, &mut encoded[self.column(level)..], stride)
            );
        }
    }

    pub fn push_forward<T: Real>(
        &self,
        table: &[T],
        cells: &Cells<T>,
        directions: Directions<T>,
        tangents: &mut [T],
        stride: usize,
    ) {
        for (row, tangent) in tangents.chunks_mut(stride).take(cells.inside.len()).enumerate() {
            tangent[..self.dimensions].copy_from_slice(&directions.row(row, self.dimensions)[..self.dimensions]);
        }
        for level in 0..self.levels.len() {
            let rows = cells.level(level);
            let slopes = self.slopes(level, cells, directions);
            with_features!(
                self.features,
                interpolate(table, rows, slopes, &mut tangents[self.column(level)..], stride)
            );
        }
    }

    pub fn pull_back<T: Real>(
        &self,
        table: &[T],
        cells: &Cells<T>,
        cotangents: &[T],
        stride: usize,
        gradients: &mut [T],
    ) {
        let dimensions = self.dimensions;
        for (gradient, cotangent) in gradients.chunks_exact_mut(dimensions).zip(cotangents.chunks(stride)) {
            gradient.iter_mut().zip(cotangent).for_each(|(gradient, cotangent)| *gradient += *cotangent);
        }
        for level in 0..self.levels.len() {
            let rows = cells.level(level);
            let scale = T::of(self.levels[level].inverse_cell);
            let along = &cotangents[self.column(level)..];
            with_features!(
                self.features,
                contract(
                    table,
                    rows,
                    along,
                    stride,
                    #[inline(always)]
                    |row: usize, place: [T; 3], corners: &[T; 8]| {
                        let slope = gradient(place, corners);
                        for axis in 0..3 {
                            gradients[row * dimensions + axis] += scale * cells.inside[row][axis] * slope[axis];
                        }
                    }
                ),
            );
        }
    }

    pub fn pull_back_second<T: Real>(
        &self,
        table: &[T],
        cells: &Cells<T>,
        directions: Directions<T>,
        cotangents: &[T],
        stride: usize,
        gradients: &mut [T],
    ) {
        let dimensions = self.dimensions;
        for level in 0..self.levels.len() {
            let rows = cells.level(level);
            let scale = T::of(self.levels[level].inverse_cell);
            let along = &cotangents[self.column(level)..];
            with_features!(
                self.features,
                contract(
                    table,
                    rows,
                    along,
                    stride,
                    #[inline(always)]
                    |row: usize, place: [T; 3], corners: &[T; 8]| {
                        let inside = cells.inside[row];
                        let slope = curvature(place, corners, scaled(directions.row(row, dimensions), inside, scale));
                        for axis in 0..3 {
                            gradients[row * dimensions + axis] += scale * inside[axis] * slope[axis];
                        }
                    }
                ),
            );
        }
    }

    pub fn pull_back_table<T: Real>(&self, cells: &Cells<T>, cotangents: &[T], stride: usize, gradient: &mut [T]) {
        for level in 0..self.levels.len() {
            let rows = cells.level(level);
            with_features!(
                self.features,
                scatter(gradient, rows, value_weights, &cotangents[self.column(level)..], stride)
            );
        }
    }

    pub fn pull_back_table_along<T: Real>(
        &self,
        cells: &Cells<T>,
        directions: Directions<T>,
        cotangents: &[T],
        stride: usize,
        gradient: &mut [T],
    ) {
        for level in 0..self.levels.len() {
            let rows = cells.level(level);
            let slopes = self.slopes(level, cells, directions);
            with_features!(self.features, scatter(gradient, rows, slopes, &cotangents[self.column(level)..], stride));
        }
    }

    /// The first column of a level's features in an encoded row.
    fn column(&self, level: usize) -> usize {
        self.dimensions + level * self.features
    }

    /// dw_k/dx v of each row's cell.
    fn slopes<'a, T: Real>(
        &self,
        level: usize,
        cells: &'a Cells<T>,
        directions: Directions<'a, T>,
    ) -> impl Fn(usize, [T; 3]) -> [T; 8] + use<'a, T> {
        let (scale, dimensions) = (T::of(self.levels[level].inverse_cell), self.dimensions);
        #[inline(always)]
        move |row, place| weight_slopes(place, scaled(directions.row(row, dimensions), cells.inside[row], scale))
    }

    fn locate<T: Real>(&self, points: &[T], cells: &mut Cells<T>) {
        let rows = points.len() / self.dimensions;
        cells.corners.resize(self.levels.len() * rows, [0; 8]);
        cells.places.resize(self.levels.len() * rows, [T::zero(); 3]);
        cells.inside.resize(rows, [T::zero(); 3]);
        let corner = |corner: [f32; 3]| corner.map(|x| T::of(f64::from(x)));
        let (low, high) = (corner(self.bounds.lowest), corner(self.bounds.highest));
        let points = points.chunks_exact(self.dimensions);
        for (point, inside) in points.clone().zip(&mut cells.inside) {
            for axis in 0..3 {
                let within = low[axis] <= point[axis] && point[axis] <= high[axis];
                inside[axis] = if within { T::one() } else { T::zero() };
            }
        }
        let found = cells.corners.chunks_exact_mut(rows).zip(cells.places.chunks_exact_mut(rows));
        for (level, (corners, places)) in self.levels.iter().zip(found) {
            let scale = T::of(level.inverse_cell);
            vectorised(
                #[inline(always)]
                || {
                    for ((point, corners), place) in points.clone().zip(corners).zip(places) {
                        let mut node = [0; 3];
                        for axis in 0..3 {
                            // In this order NaN becomes the lowest corner: a wrong point, but an entry that exists.
                            let offset = (point[axis].max(low[axis]).min(high[axis]) - low[axis]) * scale;
                            node[axis] = offset.truncated().min(level.cells[axis] - 1);
                            place[axis] = offset - T::of(f64::from(node[axis]));
                        }
                        *corners = level.indexing.corners(level.first, node);
                    }
                },
            );
        }
    }
}

/// One level's rows.
#[derive(Clone, Copy)]
struct LevelCells<'a, T> {
    corners: &'a [[u32; 8]],
    places: &'a [[T; 3]],
}

impl<T> Cells<T> {
    fn level(&self, level: usize) -> LevelCells<'_, T> {
        let rows = self.inside.len();
        let range = level * rows..(level + 1) * rows;
        LevelCells { corners: &self.corners[range.clone()], places: &self.places[range] }
    }
}

impl<'a, T: Copy> LevelCells<'a, T> {
    #[inline(always)]
    fn rows(self) -> impl Iterator<Item = (&'a [u32; 8], &'a [T; 3])> {
        self.corners.iter().zip(self.places)
    }
}

#[inline(always)]
fn value_weights<T: Real>(_: usize, place: [T; 3]) -> [T; 8] {
    weights(place)
}

/// A direction in metres as one in cells; none along the axes on which the point is outside.
#[inline(always)]
fn scaled<T: Real>(direction: [T; super::MOST_COORDINATES], inside: [T; 3], scale: T) -> [T; 3] {
    [direction[0] * inside[0] * scale, direction[1] * inside[1] * scale, direction[2] * inside[2] * scale]
}

/// result = sum_k weight_k table_k, F of every `stride` entries.
fn interpolate<T: Real, const F: usize>(
    table: &[T],
    cells: LevelCells<T>,
    weights: impl Fn(usize, [T; 3]) -> [T; 8],
    result: &mut [T],
    stride: usize,
) {
    let entries = table.as_chunks::<F>().0;
    vectorised(
        #[inline(always)]
        || {
            for (row, ((corners, place), result)) in cells.rows().zip(result.chunks_mut(stride)).enumerate() {
                let weights = weights(row, *place);
                let mut sum = [T::zero(); F];
                for (entry, weight) in corners.iter().zip(weights) {
                    let entry = &entries[*entry as usize];
                    for (sum, value) in sum.iter_mut().zip(entry) {
                        *sum = weight.mul_add(*value, *sum);
                    }
                }
                result[..F].copy_from_slice(&sum);
            }
        },
    );
}

/// table_k += weight_k cotangent.
fn scatter<T: Real, const F: usize>(
    table: &mut [T],
    cells: LevelCells<T>,
    weights: impl Fn(usize, [T; 3]) -> [T; 8],
    cotangents: &[T],
    stride: usize,
) {
    let entries = table.as_chunks_mut::<F>().0;
    vectorised(
        #[inline(always)]
        || {
            for (row, ((corners, place), cotangent)) in cells.rows().zip(cotangents.chunks(stride)).enumerate() {
                let weights = weights(row, *place);
                for (entry, weight) in corners.iter().zip(weights) {
                    let entry = &mut entries[*entry as usize];
                    for (sum, cotangent) in entry.iter_mut().zip(&cotangent[..F]) {
                        *sum = weight.mul_add(*cotangent, *sum);
                    }
                }
            }
        },
    );
}

/// Calls `add` with each row's products q_k = cotangent . table_k.
fn contract<T: Real, const F: usize>(
    table: &[T],
    cells: LevelCells<T>,
    cotangents: &[T],
    stride: usize,
    mut add: impl FnMut(usize, [T; 3], &[T; 8]),
) {
    let entries = table.as_chunks::<F>().0;
    vectorised(
        #[inline(always)]
        || {
            for (row, ((corners, place), cotangent)) in cells.rows().zip(cotangents.chunks(stride)).enumerate() {
                let mut products = [T::zero(); 8];
                for (product, entry) in products.iter_mut().zip(corners) {
                    for (value, cotangent) in entries[*entry as usize].iter().zip(&cotangent[..F]) {
                        *product = value.mul_add(*cotangent, *product);
                    }
                }
                add(row, *place, &products);
            }
        },
    );
}
