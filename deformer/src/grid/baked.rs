//! Skinning baked into a grid, after Fast-SNARF (Chen et al. 2023): weights once per field, transforms once per frame.
//!
//! The few weights that count at each node are, per frame, multiplied by the bone transforms, so that an evaluation is one
//! trilinear look-up of the 12 numbers of A. Blending is linear, so blending then interpolating equals interpolating then
//! blending. With an offset o_k at each node k (a body model's blend shapes) the warp is
//! d(x) = sum_k share_k(x) A_k (x + o_k): A_k o_k joins the node's translation, and the look-up stays the same.
//! R nodes, J bones; metres. The error is that of linear interpolation of the weights.

use rayon::prelude::*;
use xavatar_network::{Real, SkinningWeights};
use xavatar_vector::vectorised;

use crate::affine::expect_finite_bones;
use crate::error::expect_length;
use crate::grid::baked_warp::Spare;
use crate::grid::sparse_weights::padded;
use crate::{BakedWarp, BoneTransform, Error, Grid, Result, SparseWeights, StartGroups, StartRegions};

/// Nodes that one task samples or blends.
const BLOCK: usize = 1024;

/// Skinning weights at the nodes of a grid. Sample anew when the field has changed.
#[derive(Clone, Debug)]
pub struct BakedWeights<T> {
    grid: Grid<T>,
    weights: SparseWeights<T>,
    regions: Option<StartRegions<T>>,
    spare: Spare<T>,
}

impl<T: Real> BakedWeights<T> {
    /// Samples `field` at the nodes of `grid`. Weights up to 0.001 are dropped and the rest scaled to sum to one.
    ///
    /// # Errors
    /// If the field has no bones or more than 256, or its weights at a node are not finite.
    pub fn sample<S: SkinningWeights<T>>(field: &S, grid: Grid<T>) -> Result<Self> {
        let joints = field.joints();
        if joints == 0 {
            let (found, expected) = ("0".to_owned(), "at least one".to_owned());
            return Err(Error::Skeleton { name: "the skinning field's number of joints", found, expected });
        }
        let parts = (0..grid.len().div_ceil(BLOCK)).into_par_iter().map_init(
            || (S::Workspace::default(), vec![T::zero(); BLOCK * joints]),
            |(workspace, weights), block| {
                let nodes = block * BLOCK..grid.len().min((block + 1) * BLOCK);
                let points: Vec<_> = nodes.map(|node| grid.position(node)).collect();
                let weights = &mut weights[..points.len() * joints];
                field.weights(workspace, &points, weights);
                SparseWeights::of_dense(joints, weights)
            },
        );
        let weights = SparseWeights::joined(parts.collect::<Result<_>>()?, joints);
        Ok(Self { grid, weights, regions: None, spare: Spare::default() })
    }

    /// Weights that are known at the nodes.
    ///
    /// # Errors
    /// If there is not one row of weights per node.
    pub fn new(grid: Grid<T>, weights: SparseWeights<T>) -> Result<Self> {
        expect_length("rows of skinning weights", weights.len(), grid.len())?;
        Ok(Self { grid, weights, regions: None, spare: Spare::default() })
    }

    /// Lets searches that start from `groups` skip starts that can reach no cell that matters (one flag per cell), and
    /// drop roots in cells that do not.
    ///
    /// # Errors
    /// If there is not one flag per cell, or the groups are of another skeleton.
    pub fn prune_starts(&mut self, groups: &StartGroups, matters: &[bool]) -> Result<()> {
        self.regions = Some(StartRegions::new(&self.grid, &self.weights, groups, matters)?);
        Ok(())
    }

    /// Where the nodes are.
    pub fn grid(&self) -> &Grid<T> {
        &self.grid
    }

    /// The weights at the nodes.
    pub fn weights(&self) -> &SparseWeights<T> {
        &self.weights
    }

    pub(crate) fn weights_mut(&mut self) -> &mut SparseWeights<T> {
        &mut self.weights
    }

    /// The warp of one frame, with an offset (R) in canonical space for each node if given.
    ///
    /// # Errors
    /// If there is not one finite bone transform per joint, or not one offset per node.
    pub fn warp<'a>(&'a self, bones: &'a [BoneTransform<T>], offsets: Option<&[[T; 3]]>) -> Result<BakedWarp<'a, T>> {
        expect_finite_bones(bones)?;
        expect_length("the list of bone transforms", bones.len(), self.weights.joints())?;
        if let Some(offsets) = offsets {
            expect_length("the nodes' offsets", offsets.len(), self.grid.len())?;
        }
        let mut transforms = self.spare.take(self.grid.len());
        let lanes = padded(bones);
        transforms.par_chunks_mut(BLOCK).enumerate().for_each(|(block, nodes)| {
            let first = block * BLOCK;
            vectorised(
                #[inline(always)]
                || {
                    for (index, node) in nodes.iter_mut().enumerate() {
                        node.0 = self.weights.blended(first + index, &lanes);
                    }
                },
            );
            if let Some(offsets) = offsets {
                nodes.iter_mut().zip(&offsets[first..]).for_each(|(node, offset)| node.translate_first(*offset));
            }
        });
        let starts = self.regions.as_ref().map(|regions| regions.boxes(&transforms, bones)).transpose()?;
        Ok(BakedWarp::new(&self.grid, transforms, bones, starts, &self.spare))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::affine::apply;
    use crate::warp::softmax_field::{SoftmaxField, generator, posed, vectors};
    use crate::{ExactWarp, Warp};

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
        BakedWeights::sample(field, Grid::regular(LOWEST, HIGHEST, nodes).unwrap()).unwrap()
    }

    #[test]
    fn nodes_hold_the_fields_transforms_also_on_the_upper_faces() {
        let (field, bones) = posed::<f64>(51, JOINTS, 0.8);
        let baked = bake(&field, [5, 4, 3]);
        let points: Vec<_> = (0..60).map(|node| baked.grid().position(node)).collect();
        assert!(points[59].iter().zip(HIGHEST).all(|(found, expected)| (found - expected).abs() < 1e-12));
        let exact = transforms(&ExactWarp::new(&field, &bones).unwrap(), &points);
        // Weights up to 0.001 are dropped.
        assert!(greatest_difference(&transforms(&baked.warp(&bones, None).unwrap(), &points), &exact) < 5e-3);
    }

    // Linear interpolation: halving the cells quarters the error
    #[test]
    fn the_error_falls_with_the_square_of_the_spacing() {
        let (field, bones) = posed::<f64>(52, JOINTS, 0.8);
        let points: Vec<[f64; 3]> = vectors(&mut generator(53), 300, 0.7);
        let exact = transforms(&ExactWarp::new(&field, &bones).unwrap(), &points);
        let error =
            |nodes| greatest_difference(&transforms(&bake(&field, nodes).warp(&bones, None).unwrap(), &points), &exact);
        let (coarse, fine) = (error([33, 33, 17]), error([65, 65, 33]));
        assert!(coarse > 3.0 * fine && fine < 3e-3, "{coarse} -> {fine}");
    }

    #[test]
    fn jacobians_match_finite_differences_and_are_the_blend_where_clamped() {
        let (field, bones) = posed::<f64>(54, JOINTS, 0.8);
        let weights = bake(&field, [9, 10, 11]);
        let offsets: Vec<[f64; 3]> = vectors(&mut generator(59), weights.grid().len(), 0.05);
        let warp = weights.warp(&bones, Some(&offsets)).unwrap();
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
        let warp = weights.warp(&ones, None).unwrap();
        let points: Vec<[f64; 3]> = vectors(&mut generator(57), 100, 2.0);
        let found = transforms(&warp, &points);
        assert!(found.as_flattened().iter().all(|value| (value - 1.0).abs() < 1e-12));
    }

    #[test]
    fn impossible_grids_and_other_skeletons_are_refused() {
        let (field, bones) = posed::<f64>(58, JOINTS, 0.8);
        for nodes in [[1, 8, 8], [8, 0, 8], [usize::MAX, 2, 2], [1 << 10, 1 << 10, 1 << 10]] {
            assert!(Grid::regular(LOWEST, HIGHEST, nodes).is_err());
        }
        for highest in [LOWEST, [f64::NAN; 3], [f64::INFINITY; 3], [1.0, -2.0, 1.0]] {
            assert!(Grid::regular(LOWEST, highest, [4; 3]).is_err());
        }
        let baked = bake(&field, [2, 2, 2]);
        assert!(baked.warp(&bones[1..], None).is_err());
        assert!(baked.warp(&[[f64::NAN; 12]; JOINTS], None).is_err());
    }
}
