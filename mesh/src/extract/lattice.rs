//! The lattice of a grid, and values on the few of its points that the surface needs.

use glam::{UVec3, Vec3};

use xavatar_formats::{Error, Result};

use super::{ExtractionGrid, FINEST_RESOLUTION};

/// A box of cubic cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box3 {
    minimum: Vec3,
    cell_size: f32,
    /// Cells along each axis.
    pub(super) cells: UVec3,
}

impl Box3 {
    pub(super) fn new(grid: &ExtractionGrid) -> Result<Self> {
        let sides = grid.maximum - grid.minimum;
        if !(sides.is_finite() && sides.min_element() > 0.0) {
            return Err(Error::Value {
                name: "extraction box".into(),
                found: format!("{} to {}", grid.minimum, grid.maximum),
                expected: "finite corners, the maximum above the minimum".into(),
            });
        }
        if !(2..=FINEST_RESOLUTION).contains(&grid.resolution) {
            return Err(Error::Value {
                name: "extraction resolution".into(),
                found: grid.resolution.to_string(),
                expected: format!("2 to {FINEST_RESOLUTION} cells along the longest side"),
            });
        }
        if !grid.level.is_finite() {
            return Err(Error::Value {
                name: "extraction level".into(),
                found: grid.level.to_string(),
                expected: "a finite number".into(),
            });
        }
        let cell_size = sides.max_element() / grid.resolution as f32;
        // A side that is whole up to rounding gets no extra cell; two cells leave room for an inside point.
        let cells = (sides / cell_size - 1e-3).ceil().as_uvec3().max(UVec3::splat(2));
        Ok(Self { minimum: grid.minimum, cell_size, cells })
    }

    /// Lattice points along each axis.
    pub(super) fn points(&self) -> UVec3 {
        self.cells + 1
    }

    pub(super) fn position(&self, point: UVec3) -> Vec3 {
        self.minimum + point.as_vec3() * self.cell_size
    }

    pub(super) fn is_on_boundary(&self, point: UVec3) -> bool {
        point.cmpeq(UVec3::ZERO).any() || point.cmpeq(self.cells).any()
    }
}

/// Corner 0..8 of the unit cell at `cell`: bit 0 is x, bit 1 y, bit 2 z.
pub(super) fn corner(cell: UVec3, corner: u8) -> UVec3 {
    cell + UVec3::new(u32::from(corner & 1), u32::from(corner >> 1 & 1), u32::from(corner >> 2))
}

/// A lattice of T, of which only blocks of 4 x 4 x 4 points around written ones take memory.
pub(super) struct SparseLattice<T> {
    blocks_along: UVec3,
    /// Position in `blocks` plus one, by block; zero for a block that nothing was written to.
    table: Vec<u32>,
    blocks: Vec<[T; 64]>,
    vacant: T,
}

impl<T: Copy> SparseLattice<T> {
    /// `points` along each axis, all `vacant`.
    pub(super) fn new(points: UVec3, vacant: T) -> Self {
        let blocks_along = points.map(|n| n.div_ceil(4));
        let table = vec![0; blocks_along.element_product() as usize];
        Self { blocks_along, table, blocks: Vec::new(), vacant }
    }

    pub(super) fn get(&self, point: UVec3) -> T {
        match self.table[self.block_index(point)] {
            0 => self.vacant,
            block => self.blocks[block as usize - 1][Self::within_block(point)],
        }
    }

    pub(super) fn entry(&mut self, point: UVec3) -> &mut T {
        let index = self.block_index(point);
        if self.table[index] == 0 {
            self.blocks.push([self.vacant; 64]);
            self.table[index] = self.blocks.len() as u32;
        }
        &mut self.blocks[self.table[index] as usize - 1][Self::within_block(point)]
    }

    fn block_index(&self, point: UVec3) -> usize {
        let block = point / 4;
        ((block.z * self.blocks_along.y + block.y) * self.blocks_along.x + block.x) as usize
    }

    fn within_block(point: UVec3) -> usize {
        let within = point % 4;
        (within.x + 4 * within.y + 16 * within.z) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_lattice_keeps_what_was_written_and_is_vacant_elsewhere() {
        let size = UVec3::new(9, 6, 5);
        let points =
            || (0..size.z).flat_map(|z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec3::new(x, y, z))));
        let mut lattice = SparseLattice::new(size, u32::MAX);
        let written = |p: UVec3| (p.x + 2 * p.y + 3 * p.z).is_multiple_of(5);
        for (index, point) in points().enumerate().filter(|&(_, p)| written(p)) {
            *lattice.entry(point) = index as u32;
        }
        for (index, point) in points().enumerate() {
            assert_eq!(lattice.get(point), if written(point) { index as u32 } else { u32::MAX });
        }
    }
}
