//! The gradient of a frame's roots in the logits of a voxel skinning field.
//!
//! d(x_c) = sum_k share_k A_k (x_c + o_k) = x_d at fixed x_d, so with lambda = -J^-T xbar_c the weight of bone b at node k has
//! the cotangent share_k lambda . (B_b (x_c + o_k)); the softmax of the node takes it to the logits. J is the look-up's own
//! Jacobian. K roots, P logits, R nodes; metres. Sums run in the order of the roots, whatever the threads.

use rayon::prelude::*;
use xavatar_network::Real;

use crate::affine::{apply, dot};
use crate::error::expect_length;
use crate::{BakedWarp, Error, Result, VoxelSkinning, Warp};

/// Roots that one task pulls back.
const BLOCK: usize = 256;

impl<T: Real> VoxelSkinning<T> {
    /// Adds to `gradient` (P) what the cotangents of a frame's roots (K) pull back to. `warp` is the frame's, made from
    /// this field, with `offsets` (R) if it was made with them. Returns how many roots have a singular Jacobian: no derivative.
    ///
    /// # Errors
    /// If the batches differ in length, or the warp is of another field.
    pub fn root_backward(
        &self,
        warp: &BakedWarp<'_, T>,
        offsets: Option<&[[T; 3]]>,
        roots: &[[T; 3]],
        root_cotangents: &[[T; 3]],
        gradient: &mut [T],
    ) -> Result<usize> {
        expect_length("cotangents of roots", root_cotangents.len(), roots.len())?;
        expect_length("the gradient of the skinning logits", gradient.len(), self.parameters().len())?;
        if let Some(offsets) = offsets {
            expect_length("the nodes' offsets", offsets.len(), self.baked().grid().len())?;
        }
        if !std::ptr::eq(warp.grid(), self.baked().grid()) {
            let (found, expected) = ("of another field".to_owned(), "made from this field's weights".to_owned());
            return Err(Error::Value { name: "the frame's warp", found, expected });
        }
        let blocks: Vec<_> = roots
            .par_chunks(BLOCK)
            .zip(root_cotangents.par_chunks(BLOCK))
            .map(|(roots, cotangents)| {
                let mut shares = Vec::with_capacity(32 * roots.len());
                let mut transforms = vec![[T::zero(); 12]; roots.len()];
                let mut jacobians = vec![[[T::zero(); 3]; 3]; roots.len()];
                warp.transforms_and_jacobians(&mut (), roots, &mut transforms, &mut jacobians);
                let mut lambdas = vec![[T::zero(); 3]; roots.len()];
                let singular = crate::root_cotangents(&jacobians, cotangents, &mut lambdas)?;
                for (&root, &lambda) in roots.iter().zip(&lambdas) {
                    self.pull_back(warp, offsets, root, lambda, &mut shares);
                }
                Ok((singular, shares))
            })
            .collect::<Result<_>>()?;
        let mut singular = 0;
        for (count, shares) in blocks {
            singular += count;
            shares.into_iter().for_each(|(index, share)| gradient[index as usize] += share);
        }
        Ok(singular)
    }

    /// Appends one root's shares of the gradient, each with its logit, given the cotangent lambda of its image.
    fn pull_back(
        &self,
        warp: &BakedWarp<'_, T>,
        offsets: Option<&[[T; 3]]>,
        root: [T; 3],
        lambda: [T; 3],
        shares: &mut Vec<(u32, T)>,
    ) {
        let cell = warp.grid().cell(root);
        let weights = self.baked().weights();
        for corner in 0..8 {
            let (node, share) = (cell.corner(corner), cell.share(corner));
            let offset = offsets.map_or([T::zero(); 3], |offsets| offsets[node]);
            let point = std::array::from_fn(|axis| root[axis] + offset[axis]);
            let (bones, row) = weights.row(node);
            let first = shares.len();
            let mut mean = T::zero();
            for ((&bone, &weight), index) in bones.iter().zip(row).zip(weights.range(node)) {
                let to_weight = share * dot(lambda, apply(&warp.bones()[usize::from(bone)], point));
                mean += weight * to_weight;
                shares.push((index as u32, to_weight));
            }
            for ((_, value), &weight) in shares[first..].iter_mut().zip(row) {
                *value = weight * (*value - mean);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::softmax_field::{generator, posed, vectors};
    use crate::{BoneTransform, Grid, SearchSettings, StartGroups, search};

    const JOINTS: usize = 4;

    fn nearest_roots(
        field: &VoxelSkinning<f64>,
        bones: &[BoneTransform<f64>],
        offsets: &[[f64; 3]],
        targets: &[[f64; 3]],
        near: &[[f64; 3]],
    ) -> Vec<[f64; 3]> {
        let warp = field.baked().warp(bones, Some(offsets)).unwrap();
        let settings = SearchSettings { tolerance: 1e-14, ..SearchSettings::default() };
        let found = search(&warp, &StartGroups::all(JOINTS).unwrap(), targets, None, &settings).unwrap();
        let distance = |root: &[f64; 3], point: usize| (0..3).map(|a| (root[a] - near[point][a]).abs()).sum::<f64>();
        let nearest = |point: usize| {
            let roots = found.points[found.range(point)].iter();
            *roots.min_by(|a, b| distance(a, point).total_cmp(&distance(b, point))).expect("a root")
        };
        (0..targets.len()).map(nearest).collect()
    }

    // d/dl of d(x_c(l)) = x_d at fixed x_d, by solving again with each logit moved
    #[test]
    fn logit_gradients_match_finite_differences_of_the_search() {
        let (dense, bones) = posed::<f64>(91, JOINTS, 0.4);
        let grid = Grid::regular([-1.0; 3], [1.0; 3], [5; 3]).unwrap();
        let sampled = crate::BakedWeights::sample(&dense, grid.clone()).unwrap();
        let rows: Vec<Vec<_>> = (0..grid.len())
            .map(|node| {
                let (bones, weights) = sampled.weights().row(node);
                bones.iter().zip(weights).map(|(&bone, &weight)| (usize::from(bone), weight)).collect()
            })
            .collect();
        let mut field = VoxelSkinning::new(grid, JOINTS, &rows).unwrap();
        let mut generator = generator(92);
        let offsets: Vec<[f64; 3]> = vectors(&mut generator, 125, 0.02);
        let canonical: Vec<[f64; 3]> = vectors(&mut generator, 6, 0.6);
        let cotangents: Vec<[f64; 3]> = vectors(&mut generator, 6, 1.0);
        let (targets, gradient) = {
            let warp = field.baked().warp(&bones, Some(&offsets)).unwrap();
            let targets: Vec<_> =
                canonical.iter().map(|&point| apply(&warp.look_up_with_jacobian(point).0, point)).collect();
            let mut gradient = field.zero_gradient();
            let backward = field.root_backward(&warp, Some(&offsets), &canonical, &cotangents, &mut gradient);
            assert_eq!(backward.unwrap(), 0);
            (targets, gradient)
        };
        let step = 1e-5;
        let mut moved = 0;
        for index in (0..gradient.len()).filter(|index| gradient[*index] != 0.0) {
            let mut at = |step: f64| -> f64 {
                field.update(|logits| logits[index] += step);
                let roots = nearest_roots(&field, &bones, &offsets, &targets, &canonical);
                roots.as_flattened().iter().zip(cotangents.as_flattened()).map(|(a, b)| a * b).sum()
            };
            let (above, below) = (at(step), at(-2.0 * step));
            at(step);
            let expected = (above - below) / (2.0 * step);
            assert!((gradient[index] - expected).abs() < 1e-7, "{index}: {} != {expected}", gradient[index]);
            moved += 1;
        }
        assert!(moved > 80, "{moved} logits matter");
    }

    #[test]
    fn gradients_do_not_depend_on_the_threads_and_other_fields_are_refused() {
        let (dense, bones) = posed::<f32>(93, JOINTS, 0.4);
        let grid = Grid::regular([-1.0; 3], [1.0; 3], [5; 3]).unwrap();
        let rows = vec![(0..JOINTS).map(|bone| (bone, 1.0 + bone as f32)).collect(); 125];
        let field = VoxelSkinning::new(grid.clone(), JOINTS, &rows).unwrap();
        let (roots, cotangents) = (vectors(&mut generator(94), 900, 0.9), vectors(&mut generator(95), 900, 1.0));
        let warp = field.baked().warp(&bones, None).unwrap();
        let gradient = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut gradient = field.zero_gradient();
            pool.install(|| field.root_backward(&warp, None, &roots, &cotangents, &mut gradient)).unwrap();
            gradient
        };
        assert_eq!(gradient(1), gradient(3));
        let other = crate::BakedWeights::sample(&dense, grid).unwrap();
        let other = other.warp(&bones, None).unwrap();
        assert!(field.root_backward(&other, None, &roots, &cotangents, &mut field.zero_gradient()).is_err());
    }
}
