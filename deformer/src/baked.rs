//! Skinning baked into a grid, after Fast-SNARF (Chen et al. 2023): weights once per field, transforms once per frame.
//!
//! Weights are sampled at the nodes of a regular grid over the canonical box; per frame they are multiplied by the bone
//! transforms, so that an evaluation is one trilinear look-up of the 12 numbers of A. Blending is linear, so blending
//! then interpolating equals interpolating then blending. Outside the box the nearest point of its surface counts.
//! R = X * Y * Z nodes, x fastest; J bones; metres. The error is that of linear interpolation of the weights.

use rayon::prelude::*;
use xavatar_network::{Real, SkinningWeights};

use crate::affine::expect_finite_bones;
use crate::error::expect_length;
use crate::skinning::{blend, jacobian_from_slopes, vectorised};
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
    /// 1 / spacing.
    density: [T; 3],
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
        vectorised(
            #[inline(always)]
            || {
                for (&point, transform) in points.iter().zip(transforms) {
                    let cell = self.grid.cell(point);
                    let mut sum = [T::zero(); 16];
                    for corner in 0..8 {
                        let [x, y, z] = cell.shares(corner);
                        let share = x * y * z;
                        for (sum, &value) in sum.iter_mut().zip(&self.transforms[cell.corner(corner)].0) {
                            *sum += share * value;
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
            *transform = [T::zero(); 12];
            let mut slopes = [[T::zero(); 12]; 3];
            for corner in 0..8 {
                let [x, y, z] = cell.shares(corner);
                let [dx, dy, dz] = cell.share_slopes(corner);
                let shares = [dx * y * z, x * dy * z, x * y * dz];
                for (index, &value) in self.transforms[cell.corner(corner)].0[..12].iter().enumerate() {
                    transform[index] += x * y * z * value;
                    for (slope, share) in slopes.iter_mut().zip(shares) {
                        slope[index] += share * value;
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
    /// The node at one of the eight corners; bit 0 of the number is x, bit 1 y, bit 2 z.
    #[inline(always)]
    fn corner(&self, corner: usize) -> usize {
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

    /// The derivatives of `shares`, each along its own axis.
    fn share_slopes(&self, corner: usize) -> [T; 3] {
        let along = |axis: usize| if corner >> axis & 1 == 1 { self.slopes[axis] } else { -self.slopes[axis] };
        [along(0), along(1), along(2)]
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
        let spacing: [T; 3] =
            std::array::from_fn(|axis| (highest[axis] - lowest[axis]) / T::of((nodes[axis] - 1) as f64));
        Ok(Self { lowest, spacing, density: spacing.map(|spacing| T::one() / spacing), nodes })
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
            let place = (point[axis] - self.lowest[axis]) * self.density[axis];
            // `max` turns a NaN into the lowest node; the point's residual stays NaN and ends its search.
            let inside = place.max(T::zero()).min(last);
            let lower = inside.to_usize().unwrap_or(0).min(self.nodes[axis] - 2);
            cell.node += lower * strides[axis];
            cell.fractions[axis] = inside - T::of(lower as f64);
            cell.slopes[axis] = if inside == place { self.density[axis] } else { T::zero() };
        }
        cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ExactWarp;
    use crate::affine::apply;
    use crate::softmax_field::{SoftmaxField, generator, posed, vectors};

    const JOINTS: usize = 5;
    const LOWEST: [f64; 3] = [-0.9, -1.0, -0.8];
    const HIGHEST: [f64; 3] = [1.0, 0.9, 0.7];

    fn transforms(warp: &impl Warp<f64>, points: &[[f64; 3]]) -> Vec<[f64; 12]> {
        let mut transforms = vec![[0.0; 12]; points.len()];
        warp.transforms(&mut Default::default(), points, &mut transforms);
        transforms
    }

    fn greatest_difference(a: &[[f64; 12]], b: &[[f64; 12]]) -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn bake(field: &SoftmaxField<f64>, nodes: [usize; 3]) -> BakedWeights<f64> {
        BakedWeights::sample(field, LOWEST, HIGHEST, nodes).unwrap()
    }

    #[test]
    fn nodes_hold_the_exact_transforms_also_on_the_upper_faces() {
        let (field, bones) = posed::<f64>(51, JOINTS, 0.8);
        let baked = bake(&field, [5, 4, 3]);
        let points: Vec<_> = (0..60).map(|node| baked.grid.position(node)).collect();
        assert!(points[59].iter().zip(HIGHEST).all(|(found, expected)| (found - expected).abs() < 1e-12));
        let exact = transforms(&ExactWarp::new(&field, &bones).unwrap(), &points);
        assert!(greatest_difference(&transforms(&baked.warp(&bones).unwrap(), &points), &exact) < 1e-12);
    }

    // Linear interpolation: halving the cells quarters the error
    #[test]
    fn the_error_falls_with_the_square_of_the_spacing() {
        let (field, bones) = posed::<f64>(52, JOINTS, 0.8);
        let points: Vec<[f64; 3]> = vectors(&mut generator(53), 300, 0.7);
        let exact = transforms(&ExactWarp::new(&field, &bones).unwrap(), &points);
        let error =
            |nodes| greatest_difference(&transforms(&bake(&field, nodes).warp(&bones).unwrap(), &points), &exact);
        let (coarse, fine) = (error([33, 33, 17]), error([65, 65, 33]));
        assert!(coarse > 3.0 * fine && fine < 3e-3, "{coarse} -> {fine}");
    }

    #[test]
    fn jacobians_match_finite_differences_and_are_the_blend_where_clamped() {
        let (field, bones) = posed::<f64>(54, JOINTS, 0.8);
        let weights = bake(&field, [9, 10, 11]);
        let warp = weights.warp(&bones).unwrap();
        let mut points: Vec<[f64; 3]> = vectors(&mut generator(55), 50, 0.65);
        points.extend([[1.7, 0.123, 0.2], [0.1, -3.0, 5.0], [-9.0, 9.0, -9.0]]);
        let (mut blended, mut jacobians) = (vec![[0.0; 12]; 53], vec![[[0.0; 3]; 3]; 53]);
        warp.transforms_and_jacobians(&mut (), &points, &mut blended, &mut jacobians);
        assert!(greatest_difference(&blended, &transforms(&warp, &points)) < 1e-14);
        let step = 1e-6;
        for (point, jacobian) in points.iter().zip(&jacobians) {
            for axis in 0..3 {
                let at = |offset: f64| {
                    let mut moved = *point;
                    moved[axis] += offset;
                    apply(&transforms(&warp, &[moved])[0], moved)
                };
                let (above, below) = (at(step), at(-step));
                for (r, row) in jacobian.iter().enumerate() {
                    let expected = (above[r] - below[r]) / (2.0 * step);
                    assert!((row[axis] - expected).abs() < 1e-7, "{point:?}: {} != {expected}", row[axis]);
                }
            }
        }
        assert_eq!(jacobians[52], crate::affine::rotation(&blended[52]));
    }

    #[test]
    fn interpolated_weights_still_sum_to_one() {
        let (field, _) = posed::<f64>(56, JOINTS, 0.8);
        let weights = bake(&field, [7, 6, 5]);
        let ones = vec![[1.0; 12]; JOINTS];
        let warp = weights.warp(&ones).unwrap();
        let points: Vec<[f64; 3]> = vectors(&mut generator(57), 100, 2.0);
        let found = transforms(&warp, &points);
        assert!(found.as_flattened().iter().all(|value| (value - 1.0).abs() < 1e-12));
    }

    #[test]
    fn impossible_grids_and_other_skeletons_are_refused() {
        let (field, bones) = posed::<f64>(58, JOINTS, 0.8);
        let sample = |lowest, highest, nodes| BakedWeights::sample(&field, lowest, highest, nodes);
        for nodes in [[1, 8, 8], [8, 0, 8], [usize::MAX, 2, 2], [1 << 10, 1 << 10, 1 << 10]] {
            assert!(sample(LOWEST, HIGHEST, nodes).unwrap_err().to_string().contains("resolution"));
        }
        for highest in [LOWEST, [f64::NAN; 3], [f64::INFINITY; 3], [1.0, -2.0, 1.0]] {
            assert!(sample(LOWEST, highest, [4; 3]).unwrap_err().to_string().contains("box"));
        }
        let baked = bake(&field, [2, 2, 2]);
        assert!(baked.warp(&bones[1..]).is_err());
        assert!(baked.warp(&[[f64::NAN; 12]; JOINTS]).is_err());
    }
}
