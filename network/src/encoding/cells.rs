//! Where a block's points lie in each level of a grid: found once, kept for the interpolation and all its derivatives.
//!
//! Eight rows beside each other (a group, G = R / 8 rounded up), so that indices and weights are vector arithmetic. The last
//! group is filled with copies of the last row, which the sweeps leave out.

use super::Bounds;
use super::grid_shape::Level;
use crate::Real;
use xavatar_vector::vectorised;

/// Rows of a group.
pub(super) const LANES: usize = 8;

/// One number of each row of a group.
pub(super) type Lanes<T> = [T; LANES];

/// The cells of a block's R points.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells<T> {
    rows: usize,
    /// From the box's lowest corner to the point clamped to the box, metres, (G).
    offsets: Vec<[Lanes<T>; 3]>,
    /// 1 where a coordinate is inside the box, else 0, (G).
    inside: Vec<[Lanes<T>; 3]>,
    /// Entries of the cell's corners, counted from the level's first, (L, G).
    corners: Vec<[Lanes<u32>; 8]>,
    /// Place in the cell, (L, G).
    places: Vec<[Lanes<T>; 3]>,
}

/// The groups of one level.
#[derive(Clone, Copy)]
pub(super) struct LevelCells<'a, T> {
    pub corners: &'a [[Lanes<u32>; 8]],
    pub places: &'a [[Lanes<T>; 3]],
}

impl<T: Real> Cells<T> {
    pub fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn inside(&self) -> &[[Lanes<T>; 3]] {
        &self.inside
    }

    pub(super) fn level(&self, level: usize) -> LevelCells<'_, T> {
        let groups = self.inside.len();
        let range = level * groups..(level + 1) * groups;
        LevelCells { corners: &self.corners[range.clone()], places: &self.places[range] }
    }

    /// Finds the cells of points (R, D) in all levels.
    pub(super) fn locate(&mut self, levels: &[Level], bounds: &Bounds, points: &[T], dimensions: usize) {
        self.rows = points.len() / dimensions;
        let groups = self.rows.div_ceil(LANES);
        self.offsets.resize(groups, Default::default());
        self.inside.resize(groups, Default::default());
        self.corners.resize(levels.len() * groups, Default::default());
        self.places.resize(levels.len() * groups, Default::default());
        self.measure(bounds, points, dimensions);
        let found = self.corners.chunks_exact_mut(groups).zip(self.places.chunks_exact_mut(groups));
        for (level, (corners, places)) in levels.iter().zip(found) {
            let scale = T::of(level.inverse_cell);
            vectorised(
                #[inline(always)]
                || {
                    for ((offsets, corners), places) in self.offsets.iter().zip(corners).zip(places) {
                        let mut nodes = [[0; LANES]; 3];
                        for axis in 0..3 {
                            for lane in 0..LANES {
                                let offset = offsets[axis][lane] * scale;
                                let node = offset.truncated().min(level.cells[axis] - 1);
                                nodes[axis][lane] = node;
                                places[axis][lane] = offset - T::of_index(node);
                            }
                        }
                        level.indexing.corners(&nodes, corners);
                    }
                },
            );
        }
    }

    fn measure(&mut self, bounds: &Bounds, points: &[T], dimensions: usize) {
        let corner = |corner: [f32; 3]| corner.map(|x| T::of(f64::from(x)));
        let (low, high) = (corner(bounds.lowest), corner(bounds.highest));
        let groups = points.chunks(LANES * dimensions).zip(self.offsets.iter_mut().zip(&mut self.inside));
        for (points, (offsets, inside)) in groups {
            let last = points.len() / dimensions - 1;
            for axis in 0..3 {
                for lane in 0..LANES {
                    let x = points[lane.min(last) * dimensions + axis];
                    let within = low[axis] <= x && x <= high[axis];
                    inside[axis][lane] = if within { T::one() } else { T::zero() };
                    // In this order NaN becomes the lowest corner: a wrong point, but an entry that exists.
                    offsets[axis][lane] = x.max(low[axis]).min(high[axis]) - low[axis];
                }
            }
        }
    }
}
