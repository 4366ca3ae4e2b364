//! The extents of a hash grid, and how its levels index their entries (Mueller et al. 2022, section 3).
//!
//! Level l of L divides the box into cubes of edge h_l = longest edge / N_l, N_l = coarsest (finest / coarsest)^(l / (L - 1)),
//! rounded. Nodes come in blocks of 2 x 2 x 2, whose eight entries stand together (in one cache line with F = 2): surfaces visit
//! fewer lines than if neighbours shared them along x alone. Block (x, y, z) of a level whose blocks fit 2^log2_entries is number
//! x + X (y + Y z); of others, (x ^ 2654435761 y ^ 805459861 z) mod 2^(log2_entries - 3).

use serde::{Deserialize, Serialize};

use super::cells::{LANES, Lanes};
use crate::{Error, Result};

/// The levels of a hash grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HashGridShape {
    /// L: resolutions of the grid.
    pub levels: usize,
    /// Cells of the first level along the longest edge of the box.
    pub coarsest: usize,
    /// Cells of the last level along the longest edge of the box.
    pub finest: usize,
    /// Base-2 logarithm of the most entries that a level may have.
    pub log2_entries: u32,
    /// F: numbers an entry, 1, 2 or 4.
    pub features: usize,
}

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Lowest corner.
    pub lowest: [f32; 3],
    /// Highest corner.
    pub highest: [f32; 3],
}

impl HashGridShape {
    pub(super) fn validate(&self, bounds: &Bounds) -> Result<()> {
        let refuse = |name, found: String, expected: &str| Err(Error::Shape { name, found, expected: expected.into() });
        if !(1..=32).contains(&self.levels) {
            return refuse("grid levels", self.levels.to_string(), "1 to 32");
        }
        if !(1..=1 << 14).contains(&self.coarsest) {
            return refuse("coarsest grid resolution", self.coarsest.to_string(), "1 to 16384 cells");
        }
        if !(self.coarsest..=1 << 14).contains(&self.finest) {
            return refuse("finest grid resolution", self.finest.to_string(), "the coarsest to 16384 cells");
        }
        if !(4..=24).contains(&self.log2_entries) {
            return refuse("grid log2_entries", self.log2_entries.to_string(), "4 to 24");
        }
        if !matches!(self.features, 1 | 2 | 4) {
            return refuse("grid features", self.features.to_string(), "1, 2 or 4");
        }
        let corners = bounds.lowest.iter().zip(&bounds.highest);
        if !corners.clone().all(|(low, high)| low.is_finite() && high.is_finite() && low < high) {
            let found = format!("{:?} to {:?}", bounds.lowest, bounds.highest);
            return refuse("box of the grid", found, "a finite box with a volume");
        }
        Ok(())
    }

    /// Entries of the table of all levels over `bounds`.
    ///
    /// # Errors
    /// [`Error::Shape`] names the extent that is out of range.
    pub fn entries(&self, bounds: &Bounds) -> Result<usize> {
        self.validate(bounds)?;
        Ok(self.levels(bounds).iter().map(|level| level.entries as usize).sum())
    }

    /// The levels over `bounds`, coarsest first, their entries one after the other.
    pub(super) fn levels(&self, bounds: &Bounds) -> Vec<Level> {
        let edges: [f64; 3] =
            std::array::from_fn(|axis| f64::from(bounds.highest[axis]) - f64::from(bounds.lowest[axis]));
        let longest = edges.into_iter().fold(0.0, f64::max);
        let growth = self.finest as f64 / self.coarsest as f64;
        let mut first = 0;
        let mut levels = Vec::with_capacity(self.levels);
        for level in 0..self.levels {
            let share = level as f64 / (self.levels - 1).max(1) as f64;
            let inverse_cell = (self.coarsest as f64 * growth.powf(share)).round() / longest;
            // An edge that is a whole number of cells long must not gain one by rounding.
            let cells = edges.map(|edge| ((edge * inverse_cell - 1e-6).ceil() as u32).max(1));
            let [x, y, z] = cells.map(|cells| (u64::from(cells) + 1).div_ceil(2));
            let most = 1u64 << self.log2_entries;
            let (entries, indexing) = if 8 * x * y * z <= most {
                (8 * x * y * z, Indexing::Dense { strides: [1, x as u32, (x * y) as u32] })
            } else {
                (most, Indexing::Hashed { mask: most as u32 - 1 })
            };
            levels.push(Level { first, entries: entries as u32, cells, inverse_cell, indexing });
            first += entries as u32;
        }
        levels
    }
}

/// One resolution of a grid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    /// Its first entry in the table.
    pub first: u32,
    pub entries: u32,
    /// Cells along each axis.
    pub cells: [u32; 3],
    /// 1 / h, cells a metre.
    pub inverse_cell: f64,
    pub indexing: Indexing,
}

/// Which entry a node has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Indexing {
    /// What the block of a node is multiplied with along each axis.
    Dense {
        strides: [u32; 3],
    },
    Hashed {
        mask: u32,
    },
}

/// What the hash multiplies blocks with along each axis (Mueller et al. 2022).
const FACTORS: [u32; 3] = [1, 2_654_435_761, 805_459_861];

impl Indexing {
    /// The entries of the cells' corners, x changing fastest, from their lowest corners' nodes; counted from the level's first.
    #[inline(always)]
    pub fn corners(self, nodes: &[Lanes<u32>; 3], corners: &mut [Lanes<u32>; 8]) {
        match self {
            Self::Dense { strides } => combine(nodes, strides, |x, y, z| x + y + z, corners),
            Self::Hashed { mask } => combine(nodes, FACTORS, |x, y, z| (x ^ y ^ z) & mask, corners),
        }
    }
}

/// Combines what a node's coordinates say by themselves: a multiple of the block along each axis, and which of the eight it is.
#[inline(always)]
fn combine(
    nodes: &[Lanes<u32>; 3],
    factors: [u32; 3],
    combined: impl Fn(u32, u32, u32) -> u32,
    corners: &mut [Lanes<u32>; 8],
) {
    for lane in 0..LANES {
        let of_axis = |axis: usize| {
            let part = |node: u32| (node >> 1).wrapping_mul(factors[axis]) << 3 | (node & 1) << axis;
            [part(nodes[axis][lane]), part(nodes[axis][lane] + 1)]
        };
        let [x, y, z] = [of_axis(0), of_axis(1), of_axis(2)];
        for (corner, entries) in corners.iter_mut().enumerate() {
            entries[lane] = combined(x[corner & 1], y[corner >> 1 & 1], z[corner >> 2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    const SHAPE: HashGridShape = HashGridShape { levels: 12, coarsest: 16, finest: 256, log2_entries: 18, features: 2 };
    const BODY: Bounds = Bounds { lowest: [-1.1, -1.4, -0.3], highest: [1.1, 0.7, 0.4] };

    // Every node of a dense level has an entry of its own, and no entry leaves its level.
    #[test]
    fn nodes_of_dense_levels_share_nothing_and_no_level_leaves_its_entries() {
        let levels = SHAPE.levels(&BODY);
        assert_eq!((levels[0].cells[0], levels[11].cells[0]), (16, 256));
        let mut first = 0;
        for level in &levels {
            assert_eq!(level.first, first);
            first += level.entries;
            let mut used = HashSet::new();
            let step = if matches!(level.indexing, Indexing::Dense { .. }) { 1 } else { 7 };
            let [x, y, z] = level.cells;
            for z in (0..z).step_by(step) {
                for y in (0..y).step_by(step) {
                    for x in (0..x).step_by(step) {
                        let mut corners = [[0; LANES]; 8];
                        level.indexing.corners(&[[x; LANES], [y; LANES], [z; LANES]], &mut corners);
                        used.extend(corners.as_flattened().iter().copied());
                    }
                }
            }
            assert!(used.iter().all(|entry| *entry < level.entries));
            if step == 1 {
                assert_eq!(used.len() as u32, level.cells.map(|cells| cells + 1).iter().product::<u32>());
            }
        }
        assert!(matches!(levels[6].indexing, Indexing::Dense { .. }));
        assert!(matches!(levels[7].indexing, Indexing::Hashed { .. }));
    }

    #[test]
    fn extents_out_of_range_are_named() {
        type Change = fn(&mut HashGridShape, &mut Bounds);
        let change: [(&str, Change); 6] = [
            ("grid levels", |shape, _| shape.levels = 0),
            ("coarsest grid resolution", |shape, _| shape.coarsest = 0),
            ("finest grid resolution", |shape, _| shape.finest = 8),
            ("grid log2_entries", |shape, _| shape.log2_entries = 30),
            ("grid features", |shape, _| shape.features = 3),
            ("box of the grid", |_, bounds| bounds.highest[1] = f32::NAN),
        ];
        assert!(SHAPE.validate(&BODY).is_ok());
        for (expected, change) in change {
            let (mut shape, mut bounds) = (SHAPE, BODY);
            change(&mut shape, &mut bounds);
            assert!(
                matches!(shape.validate(&bounds), Err(Error::Shape { name, .. }) if name == expected),
                "{expected}"
            );
        }
    }
}
