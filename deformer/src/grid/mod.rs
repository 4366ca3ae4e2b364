//! A rectilinear grid over the canonical box and trilinear look-ups in it.
//!
//! R = X * Y * Z nodes, x fastest; axes may be unevenly spaced, so that hands are fine where a thigh is coarse.
//! Outside the box the nearest point of its surface counts. Metres.

mod axis;
mod baked;
pub(crate) mod baked_warp;
mod sparse_weights;
mod voxel;
mod voxel_gradient;

pub use axis::Axis;
pub use baked::BakedWeights;
pub use baked_warp::BakedWarp;
pub use sparse_weights::SparseWeights;
pub use voxel::VoxelSkinning;

use xavatar_network::Real;

use crate::{Error, Result};

/// Most nodes of a grid: 16.8 million, a gigabyte of blended transforms a frame.
const MOST_NODES: usize = 1 << 24;

/// Where the nodes of a grid are.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    axes: [Axis<T>; 3],
}

/// The cell that holds a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell<T> {
    /// Its lowest node, and the distances from it to the next along x, y and z in the list of nodes.
    pub node: usize,
    pub strides: [usize; 3],
    /// Where in the cell, in [0, 1].
    pub fractions: [T; 3],
}

impl<T: Real> Grid<T> {
    /// The grid of all combinations of the coordinates along x, y and z.
    ///
    /// # Errors
    /// If there are more than 2^24 nodes.
    pub fn new(axes: [Axis<T>; 3]) -> Result<Self> {
        let nodes = axes.each_ref().map(|axis| axis.nodes().len());
        if nodes.iter().try_fold(1_usize, |product, &count| product.checked_mul(count)).is_none_or(|r| r > MOST_NODES) {
            let expected = format!("at most {MOST_NODES} nodes in all");
            return Err(Error::Value { name: "the grid's resolution", found: format!("{nodes:?}"), expected });
        }
        Ok(Self { axes })
    }

    /// A grid of `nodes` equally spaced nodes along x, y and z of the box from `lowest` to `highest`, corners included.
    ///
    /// # Errors
    /// If the box is empty or not finite, or an axis has fewer than two nodes, or there are more than 2^24 nodes.
    pub fn regular(lowest: [T; 3], highest: [T; 3], nodes: [usize; 3]) -> Result<Self> {
        let axis = |axis: usize| Axis::regular(lowest[axis], highest[axis], nodes[axis]);
        Self::new([axis(0)?, axis(1)?, axis(2)?])
    }

    /// The coordinates along x, y and z.
    pub fn axes(&self) -> &[Axis<T>; 3] {
        &self.axes
    }

    /// R: how many nodes there are.
    pub fn len(&self) -> usize {
        self.counts().iter().product()
    }

    /// Whether there is no node: never.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where a node is. Panics if there is no such node.
    pub fn position(&self, node: usize) -> [T; 3] {
        let place = split(node, self.counts());
        std::array::from_fn(|axis| self.axes[axis].nodes()[place[axis]])
    }

    /// How many cells there are; cells are numbered as nodes are, x fastest.
    pub fn cells(&self) -> usize {
        self.cell_counts().iter().product()
    }

    /// The lowest and the highest corner of a cell. Panics if there is no such cell.
    pub fn cell_corners(&self, cell: usize) -> [[T; 3]; 2] {
        let place = split(cell, self.cell_counts());
        [0, 1].map(|upper| std::array::from_fn(|axis| self.axes[axis].nodes()[place[axis] + upper]))
    }

    /// The eight nodes of a cell; bit 0 of a corner's number is x, bit 1 y, bit 2 z. Panics if there is no such cell.
    pub fn cell_nodes(&self, cell: usize) -> [usize; 8] {
        let [x, y, z] = split(cell, self.cell_counts());
        let strides = self.strides();
        let lowest = Cell { node: x + y * strides[1] + z * strides[2], strides, fractions: [T::zero(); 3] };
        std::array::from_fn(|corner| lowest.corner(corner))
    }

    /// The number of the cell that holds a point; none outside the box.
    pub fn cell_number(&self, point: [T; 3]) -> Option<usize> {
        let inside = |axis: usize| {
            let nodes = self.axes[axis].nodes();
            point[axis] >= nodes[0] && point[axis] <= nodes[nodes.len() - 1]
        };
        if !(0..3).all(inside) {
            return None;
        }
        let place: [usize; 3] = std::array::from_fn(|axis| self.axes[axis].place(point[axis]).cell);
        let [x, y, _] = self.cell_counts();
        Some(place[0] + x * (place[1] + y * place[2]))
    }

    /// The nodes around a point, or around the nearest point of the box, with their shares.
    pub fn corner_shares(&self, point: [T; 3]) -> [(usize, T); 8] {
        let cell = self.cell(point);
        std::array::from_fn(|corner| (cell.corner(corner), cell.share(corner)))
    }

    /// The cell that holds a point or, outside the box, the nearest point of its surface.
    #[inline(always)]
    pub(crate) fn cell(&self, point: [T; 3]) -> Cell<T> {
        let strides = self.strides();
        let [x, y, z] = [self.axes[0].place(point[0]), self.axes[1].place(point[1]), self.axes[2].place(point[2])];
        Cell {
            node: x.cell + y.cell * strides[1] + z.cell * strides[2],
            strides,
            fractions: [x.fraction, y.fraction, z.fraction],
        }
    }

    /// Derivatives of a cell's fractions at a point, each along its own axis, 1/m; zero where the point is clamped.
    pub(crate) fn slopes(&self, cell: &Cell<T>, point: [T; 3]) -> [T; 3] {
        let place = split(cell.node, self.counts());
        std::array::from_fn(|axis| self.axes[axis].slope(place[axis], point[axis]))
    }

    /// How many nodes there are along x, y and z.
    pub fn counts(&self) -> [usize; 3] {
        self.axes.each_ref().map(|axis| axis.nodes().len())
    }

    fn cell_counts(&self) -> [usize; 3] {
        self.counts().map(|nodes| nodes - 1)
    }

    #[inline(always)]
    fn strides(&self) -> [usize; 3] {
        let along_x = self.axes[0].nodes().len();
        [1, along_x, along_x * self.axes[1].nodes().len()]
    }
}

/// The three numbers that x fastest numbering joins into one.
fn split(number: usize, [x, y, _]: [usize; 3]) -> [usize; 3] {
    [number % x, number / x % y, number / (x * y)]
}

impl<T: Real> Cell<T> {
    /// The node at one of the eight corners.
    #[inline(always)]
    pub(crate) fn corner(&self, corner: usize) -> usize {
        let along = |axis: usize| (corner >> axis & 1) * self.strides[axis];
        self.node + along(0) + along(1) + along(2)
    }

    /// The corner's share along each axis.
    #[inline(always)]
    fn shares(&self, corner: usize) -> [T; 3] {
        let along =
            |axis: usize| if corner >> axis & 1 == 1 { self.fractions[axis] } else { T::one() - self.fractions[axis] };
        [along(0), along(1), along(2)]
    }

    /// The corner's share.
    #[inline(always)]
    pub(crate) fn share(&self, corner: usize) -> T {
        let [x, y, z] = self.shares(corner);
        x * y * z
    }

    /// The derivatives of the corner's share along x, y and z, given those of the fractions.
    #[inline(always)]
    pub(crate) fn share_gradient(&self, corner: usize, slopes: [T; 3]) -> [T; 3] {
        let [x, y, z] = self.shares(corner);
        let along = |axis: usize| if corner >> axis & 1 == 1 { slopes[axis] } else { -slopes[axis] };
        [along(0) * y * z, x * along(1) * z, x * y * along(2)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_nodes_and_points_agree_on_their_numbers() {
        let axes =
            [vec![0.0, 0.1, 0.5, 1.0], vec![-1.0, 0.0, 0.25], vec![2.0, 2.5, 2.6]].map(|n| Axis::new(n).unwrap());
        let grid = Grid::<f64>::new(axes).unwrap();
        assert_eq!((grid.len(), grid.cells()), (36, 12));
        for number in 0..grid.cells() {
            let [low, high] = grid.cell_corners(number);
            let middle = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
            assert_eq!(grid.cell_number(middle), Some(number));
            let (cell, nodes) = (grid.cell(middle), grid.cell_nodes(number));
            for (corner, &node) in nodes.iter().enumerate() {
                assert_eq!(cell.corner(corner), node);
                let expected = std::array::from_fn(|axis| [low, high][corner >> axis & 1][axis]);
                assert_eq!(grid.position(node), expected);
                assert!((cell.share(corner) - 0.125).abs() < 1e-12);
            }
        }
        assert_eq!(grid.cell_number([-0.01, 0.0, 2.1]), None);
        assert_eq!(grid.cell_number([f64::NAN, 0.0, 2.1]), None);
    }
}
