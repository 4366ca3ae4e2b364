//! Skinning baked into a grid, after Fast-SNARF (Chen et al. 2023): weights once per field, transforms once per frame.
//!
//! Weights are sampled at the nodes of a regular grid over the canonical box; per frame they are multiplied by the bone
//! transforms, so that an evaluation is one trilinear look-up of the 12 numbers of A. Blending is linear, so blending
//! then interpolating equals interpolating then blending. Outside the box the nearest point of its surface counts.
//! R = X * Y * Z nodes, x fastest; J bones; metres. The error is that of linear interpolation of the weights.

use pulp::Arch;
use rayon::prelude::*;
use xavatar_network::{Real, SkinningWeights};

use crate::affine::expect_finite_bones;
use crate::error::expect_length;
use crate::skinning::{blend, jacobian_from_slopes};
use crate::{BoneTransform, Error, Jacobian, Result, Warp};

/// Nodes that one task samples or blends.
const BLOCK: usize = 1024;

/// Most nodes of a grid: 16.8 million, 3.7 GB of weights for 55 bones.
const MOST_NODES: usize = 1 << 24;

/// Where the nodes of a grid are.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid<T> {
    lowest: [T; 3],
    spacing: [T; 3],
    nodes: [usize; 3],
}

/// A field's skinning weights at the nodes of a grid. Sample anew when the field has changed.
#[derive(Clone, Debug)]
pub struct BakedWeights<T> {
    grid: Grid<T>,
    joints: usize,
    /// (R, J).
    weights: Vec<T>,
}

impl<T: Real> BakedWeights<T> {
    /// Samples `field` at `nodes` nodes along x, y and z of the box from `lowest` to `highest`, corners included.
    ///
    /// # Errors
    /// If the box is empty or not finite, or an axis has fewer than two nodes, or there are more than 2^24 nodes.
    pub fn sample<S: SkinningWeights<T>>(
        field: &S,
        lowest: [T; 3],
        highest: [T; 3],
        nodes: [usize; 3],
    ) -> Result<Self> {
        let grid = Grid::new(lowest, highest, nodes)?;
        let joints = field.joints();
        if joints == 0 {
            let (found, expected) = ("0".to_owned(), "at least one".to_owned());
            return Err(Error::Skeleton { name: "the skinning field's number of joints", found, expected });
        }
        let mut weights = vec![T::zero(); grid.len() * joints];
        weights.par_chunks_mut(BLOCK * joints).enumerate().for_each_init(
            || (S::Workspace::default(), Vec::with_capacity(BLOCK)),
            |(workspace, points), (block, weights)| {
                let first = block * BLOCK;
                points.clear();
                points.extend((first..first + weights.len() / joints).map(|node| grid.position(node)));
                field.weights(workspace, points, weights);
            },
        );
        Ok(Self { grid, joints, weights })
    }

    /// The warp of one frame.
    ///
    /// # Errors
    /// If there is not one finite bone transform per joint.
    pub fn warp<'a>(&self, bones: &'a [BoneTransform<T>]) -> Result<BakedWarp<'a, T>> {
        expect_finite_bones(bones)?;
        expect_length("the list of bone transforms", bones.len(), self.joints)?;
        let mut transforms = vec![Node([T::zero(); 16]); self.grid.len()];
        transforms.par_chunks_mut(BLOCK).zip(self.weights.par_chunks(BLOCK * self.joints)).for_each_init(
            || vec![[T::zero(); 12]; BLOCK],
            |blended, (nodes, weights)| {
                let blended = &mut blended[..nodes.len()];
                blend(weights, bones, blended);
                for (node, transform) in nodes.iter_mut().zip(blended) {
                    node.0[..12].copy_from_slice(transform);
                }
            },
        );
        Ok(BakedWarp { grid: self.grid, transforms, bones })
    }
}

/// A node's blended transform, padded to a cache line of 16 f32 so that a look-up touches eight lines and no more.
#[repr(align(64))]
#[derive(Clone, Copy, Debug)]
struct Node<T>([T; 16]);

/// One frame's warp on a grid: fast, and as exact as the grid is fine.
#[derive(Clone, Debug)]
pub struct BakedWarp<'a, T> {
    grid: Grid<T>,
    /// A at each node (R).
    transforms: Vec<Node<T>>,
    bones: &'a [BoneTransform<T>],
}

impl<T: Real> Warp<T> for BakedWarp<'_, T> {
    type Workspace = ();

    fn bones(&self) -> &[BoneTransform<T>] {
        self.bones
    }

    fn transforms(&self, _: &mut (), points: &[[T; 3]], transforms: &mut [BoneTransform<T>]) {
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (&point, transform) in points.iter().zip(transforms) {
                    let cell = self.grid.cell(point);
                    let corners = cell.corners(&self.transforms);
                    let [x, y, z] = cell.fractions;
                    let mut sum = [T::zero(); 16];
                    for (corner, node) in corners.iter().enumerate() {
                        let along = |bit: usize, fraction: T| {
                            if corner >> bit & 1 == 1 { fraction } else { T::one() - fraction }
                        };
                        let weight = along(2, z) * along(1, y) * along(0, x);
                        for (sum, &value) in sum.iter_mut().zip(&node.0) {
                            *sum += weight * value;
                        }
                    }
                    transform.copy_from_slice(&sum[..12]);
                }
            },
        );
    }

    fn transforms_and_jacobians(
        &self,
        _: &mut (),
        points: &[[T; 3]],
        transforms: &mut [BoneTransform<T>],
        jacobians: &mut [Jacobian<T>],
    ) {
        for ((&point, transform), jacobian) in points.iter().zip(transforms).zip(jacobians) {
            let cell = self.grid.cell(point);
            let corners = cell.corners(&self.transforms);
            *transform = [T::zero(); 12];
            let mut slopes = [[T::zero(); 12]; 3];
            for (corner, node) in corners.iter().enumerate() {
                // Per axis: the corner's share of the value, and of the derivative along that axis.
                let (share, slope): ([T; 3], [T; 3]) = {
                    let upper = [corner & 1 == 1, corner & 2 == 2, corner & 4 == 4];
                    let f = cell.fractions;
                    (
                        std::array::from_fn(|a| if upper[a] { f[a] } else { T::one() - f[a] }),
                        std::array::from_fn(|a| if upper[a] { cell.slopes[a] } else { -cell.slopes[a] }),
                    )
                };
                let weight = share[0] * share[1] * share[2];
                let weights =
                    [slope[0] * share[1] * share[2], share[0] * slope[1] * share[2], share[0] * share[1] * slope[2]];
                for (index, &value) in node.0[..12].iter().enumerate() {
                    transform[index] += weight * value;
                    for (slope, weight) in slopes.iter_mut().zip(weights) {
                        slope[index] += weight * value;
                    }
                }
            }
            *jacobian = jacobian_from_slopes(transform, &slopes, point);
        }
    }
}

/// The cell that holds a point.
struct Cell<T> {
    /// Its lowest node, and the distances from it to the next along x, y and z in the list of nodes.
    node: usize,
    strides: [usize; 3],
    /// Where in the cell, in [0, 1].
    fractions: [T; 3],
    /// Derivatives of the fractions, 1/m; zero where the point was clamped.
    slopes: [T; 3],
}

impl<T: Real> Cell<T> {
    /// The eight nodes; bit 0 of the place is x, bit 1 y, bit 2 z.
    #[inline(always)]
    fn corners<'n>(&self, nodes: &'n [Node<T>]) -> [&'n Node<T>; 8] {
        let [x, y, z] = self.strides;
        let n = self.node;
        [n, n + x, n + y, n + x + y, n + z, n + x + z, n + y + z, n + x + y + z].map(|index| &nodes[index])
    }
}

impl<T: Real> Grid<T> {
    fn new(lowest: [T; 3], highest: [T; 3], nodes: [usize; 3]) -> Result<Self> {
        let few = nodes.iter().any(|&count| count < 2);
        let total = nodes.iter().try_fold(1_usize, |product, &count| product.checked_mul(count));
        if few || total.is_none_or(|total| total > MOST_NODES) {
            return Err(Error::Value {
                name: "the baked grid's resolution",
                found: format!("{nodes:?}"),
                expected: format!("two or more nodes per axis and at most {MOST_NODES} in all"),
            });
        }
        if (0..3).any(|axis| !(lowest[axis] < highest[axis] && (highest[axis] - lowest[axis]).is_finite())) {
            return Err(Error::Value {
                name: "the baked grid's box",
                found: format!("{lowest:?} to {highest:?}"),
                expected: "finite corners, the lowest below the highest".to_owned(),
            });
        }
        let spacing = std::array::from_fn(|axis| (highest[axis] - lowest[axis]) / T::of((nodes[axis] - 1) as f64));
        Ok(Self { lowest, spacing, nodes })
    }

    fn len(&self) -> usize {
        self.nodes.iter().product()
    }

    fn position(&self, node: usize) -> [T; 3] {
        let [x, y, _] = self.nodes;
        let place = [node % x, node / x % y, node / (x * y)];
        std::array::from_fn(|axis| self.lowest[axis] + self.spacing[axis] * T::of(place[axis] as f64))
    }

    #[inline(always)]
    fn cell(&self, point: [T; 3]) -> Cell<T> {
        let strides = [1, self.nodes[0], self.nodes[0] * self.nodes[1]];
        let mut cell = Cell { node: 0, strides, fractions: [T::zero(); 3], slopes: [T::zero(); 3] };
        for axis in 0..3 {
            let last = T::of((self.nodes[axis] - 1) as f64);
            let place = (point[axis] - self.lowest[axis]) / self.spacing[axis];
            // `max` turns a NaN into the lowest node; the point's residual stays NaN and ends its search.
            let inside = place.max(T::zero()).min(last);
            let lower = inside.to_usize().unwrap_or(0).min(self.nodes[axis] - 2);
            cell.node += lower * strides[axis];
            cell.fractions[axis] = inside - T::of(lower as f64);
            cell.slopes[axis] = if inside == place { T::one() / self.spacing[axis] } else { T::zero() };
        }
        cell
    }
}
