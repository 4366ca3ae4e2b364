//! Multi-resolution hash-grid encoding (Mueller et al. 2022): e(x) = [x, grid_1(x), ..., grid_L(x)], trilinear in each level's cell.
//!
//! The grid sees the first three of D coordinates, clamped to its box (derivative zero outside); all D pass through unchanged.
//! Table (entries, F), levels one after the other; E = D + L F. Level by level over a block's rows, so that a level's entries
//! stay in cache while they are wanted.

use std::ops::Range;

use super::cell::{curvature, gradient, weight_slopes, weights};
use super::cells::{Cells, LANES, Lanes};
use super::gather::{contract, interpolate, scatter};
use super::grid_shape::Level;
use super::{Bounds, Directions, HashGridShape};
use crate::{Real, Result};

/// A hash grid, without its table.
#[derive(Clone, Debug)]
pub(crate) struct HashGrid {
    dimensions: usize,
    features: usize,
    bounds: Bounds,
    levels: Vec<Level>,
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
        cells.locate(&self.levels, &self.bounds, points, self.dimensions);
        for (point, encoded) in points.chunks_exact(self.dimensions).zip(encoded.chunks_mut(stride)) {
            encoded[..self.dimensions].copy_from_slice(point);
        }
        for level in 0..self.levels.len() {
            let result = &mut encoded[self.column(level)..cells.rows() * stride];
            let table = &table[self.range(level)];
            with_features!(self.features, interpolate(table, cells.level(level), value_weights, result, stride));
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
        for (row, tangent) in tangents.chunks_mut(stride).take(cells.rows()).enumerate() {
            tangent[..self.dimensions].copy_from_slice(&directions.row(row, self.dimensions)[..self.dimensions]);
        }
        let directions = self.group_directions(cells, directions);
        for level in 0..self.levels.len() {
            let slopes = self.slopes(level, &directions);
            let result = &mut tangents[self.column(level)..cells.rows() * stride];
            let table = &table[self.range(level)];
            with_features!(self.features, interpolate(table, cells.level(level), slopes, result, stride));
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
        let mut sums = vec![[[T::zero(); LANES]; 3]; cells.inside().len()];
        for level in 0..self.levels.len() {
            let scale = T::of(self.levels[level].inverse_cell);
            let along = &cotangents[self.column(level)..cells.rows() * stride];
            let table = &table[self.range(level)];
            let slope = first_slope(scale);
            with_features!(self.features, contract(table, cells.level(level), along, stride, slope, &mut sums));
        }
        self.add_inside(cells, &sums, gradients);
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
        let directions = self.group_directions(cells, directions);
        let mut sums = vec![[[T::zero(); LANES]; 3]; directions.len()];
        for level in 0..self.levels.len() {
            let scale = T::of(self.levels[level].inverse_cell * self.levels[level].inverse_cell);
            let along = &cotangents[self.column(level)..cells.rows() * stride];
            let table = &table[self.range(level)];
            let slope = second_slope(scale, &directions);
            with_features!(self.features, contract(table, cells.level(level), along, stride, slope, &mut sums));
        }
        self.add_inside(cells, &sums, gradients);
    }

    pub fn pull_back_table<T: Real>(&self, cells: &Cells<T>, cotangents: &[T], stride: usize, gradient: &mut [T]) {
        for level in 0..self.levels.len() {
            let along = &cotangents[self.column(level)..cells.rows() * stride];
            let table = &mut gradient[self.range(level)];
            with_features!(self.features, scatter(table, cells.level(level), value_weights, along, stride));
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
        let directions = self.group_directions(cells, directions);
        for level in 0..self.levels.len() {
            let slopes = self.slopes(level, &directions);
            let along = &cotangents[self.column(level)..cells.rows() * stride];
            let table = &mut gradient[self.range(level)];
            with_features!(self.features, scatter(table, cells.level(level), slopes, along, stride));
        }
    }

    /// The first column of a level's features in an encoded row.
    fn column(&self, level: usize) -> usize {
        self.dimensions + level * self.features
    }

    /// The numbers of a level's entries in the table.
    fn range(&self, level: usize) -> Range<usize> {
        let Level { first, entries, .. } = self.levels[level];
        first as usize * self.features..(first + entries) as usize * self.features
    }

    /// dw_k/dx v of each row's cell.
    #[expect(clippy::needless_range_loop, reason = "a lane is the second index")]
    fn slopes<T: Real>(
        &self,
        level: usize,
        directions: &[[Lanes<T>; 3]],
    ) -> impl Fn(usize, &[Lanes<T>; 3]) -> [Lanes<T>; 8] {
        let scale = T::of(self.levels[level].inverse_cell);
        #[inline(always)]
        move |group, places| {
            let mut slopes = [[T::zero(); LANES]; 8];
            for lane in 0..LANES {
                let [x, y, z] = of_lane(&directions[group], lane);
                let of_row = weight_slopes(of_lane(places, lane), [scale * x, scale * y, scale * z]);
                for corner in 0..8 {
                    slopes[corner][lane] = of_row[corner];
                }
            }
            slopes
        }
    }

    /// The directions of a block by groups; zero along the axes on which a point is outside the box.
    #[expect(clippy::needless_range_loop, reason = "a lane is the second index")]
    fn group_directions<T: Real>(&self, cells: &Cells<T>, directions: Directions<T>) -> Vec<[Lanes<T>; 3]> {
        let mut groups = cells.inside().to_vec();
        for (group, of_group) in groups.iter_mut().enumerate() {
            for lane in 0..LANES {
                // The last group's copies of the last row have no direction of their own.
                let direction = directions.row((group * LANES + lane).min(cells.rows() - 1), self.dimensions);
                for axis in 0..3 {
                    of_group[axis][lane] *= direction[axis];
                }
            }
        }
        groups
    }

    /// Adds sums by groups to gradients (R, D), where the points are inside the box.
    fn add_inside<T: Real>(&self, cells: &Cells<T>, sums: &[[Lanes<T>; 3]], gradients: &mut [T]) {
        let groups = gradients.chunks_mut(LANES * self.dimensions).zip(sums).zip(cells.inside());
        for ((gradients, sums), inside) in groups {
            for (lane, gradient) in gradients.chunks_exact_mut(self.dimensions).enumerate() {
                for axis in 0..3 {
                    gradient[axis] += inside[axis][lane] * sums[axis][lane];
                }
            }
        }
    }
}

/// w_k of each row's cell.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "a lane is the second index")]
fn value_weights<T: Real>(_: usize, places: &[Lanes<T>; 3]) -> [Lanes<T>; 8] {
    let mut result = [[T::zero(); LANES]; 8];
    for lane in 0..LANES {
        let of_row = weights(of_lane(places, lane));
        for corner in 0..8 {
            result[corner][lane] = of_row[corner];
        }
    }
    result
}

#[inline(always)]
fn of_lane<T: Copy>([x, y, z]: &[Lanes<T>; 3], lane: usize) -> [T; 3] {
    [x[lane], y[lane], z[lane]]
}

/// scale d/dt of sum_k w_k q_k.
fn first_slope<T: Real>(scale: T) -> impl Fn(usize, usize, [T; 3], &[T; 8]) -> [T; 3] {
    #[inline(always)]
    move |_, _, place, corners| {
        let [x, y, z] = gradient(place, corners);
        [scale * x, scale * y, scale * z]
    }
}

/// scale d/dt (v . d/dt) of sum_k w_k q_k.
fn second_slope<T: Real>(scale: T, directions: &[[Lanes<T>; 3]]) -> impl Fn(usize, usize, [T; 3], &[T; 8]) -> [T; 3] {
    #[inline(always)]
    move |group, lane, place, corners| {
        let [x, y, z] = curvature(place, corners, of_lane(&directions[group], lane));
        [scale * x, scale * y, scale * z]
    }
}
