//! A skinning field that is its grid: at each node a softmax over the few bones that may hold it.
//!
//! Node k keeps up to eight bones b with logits l_kb; w_kb = exp(l_kb) / sum_b' exp(l_kb'), and
//! w(x) = sum_k share_k(x) w_k, trilinear. P logits in all, in the order of the nodes; R nodes, J bones; metres.

use rayon::prelude::*;
use xavatar_network::{Real, SkinningWeights};
use xavatar_vector::vectorised;

use crate::error::expect_length;
use crate::{BakedWeights, Error, Grid, Result, SparseWeights, StartGroups};

/// Most bones of a node: with eight, all that meet at a shoulder.
const MOST_BONES: usize = 8;

/// Least share of a bone that a node keeps: a logit four below the others', from where learning still moves it.
const FLOOR: f64 = 0.01;

/// A learnable skinning field on a grid.
#[derive(Clone, Debug)]
pub struct VoxelSkinning<T> {
    baked: BakedWeights<T>,
    logits: Vec<T>,
    initial: Vec<T>,
}

impl<T: Real> VoxelSkinning<T> {
    /// A field over `joints` bones that starts from these rows of (bone, weight), one per node. The eight largest are kept and
    /// lifted to a hundredth of the row's sum, so that bones listed with a weight of zero can gain some.
    ///
    /// # Errors
    /// If there is not one row per node, or as [`SparseWeights::new`].
    pub fn new(grid: Grid<T>, joints: usize, rows: &[Vec<(usize, T)>]) -> Result<Self> {
        let kept = rows.iter().map(|row| {
            let floor = T::of(FLOOR) * row.iter().map(|&(_, weight)| weight).sum::<T>();
            let mut row = row.clone();
            row.sort_by(|a, b| b.1.partial_cmp(&a.1).unwrap_or(std::cmp::Ordering::Equal).then(a.0.cmp(&b.0)));
            row.truncate(MOST_BONES);
            // A weight that is not a number stays one, to be refused.
            row.iter_mut().for_each(|(_, weight)| *weight = if *weight < floor { floor } else { *weight });
            row
        });
        if rows.iter().flatten().any(|&(_, weight)| weight < T::zero()) {
            let (found, expected) = ("negative".to_owned(), "weights that are not".to_owned());
            return Err(Error::Value { name: "an initial skinning weight", found, expected });
        }
        let weights = SparseWeights::new(joints, kept)?;
        let logits: Vec<T> = weights.weights().iter().map(|weight| weight.ln()).collect();
        Ok(Self { initial: logits.clone(), logits, baked: BakedWeights::new(grid, weights)? })
    }

    /// A field whose nodes have these bones (R) with these logits (P), in this order: one that was stored.
    ///
    /// # Errors
    /// If there is not one row of bones per node and one finite logit per bone, or as [`SparseWeights::new`].
    pub fn from_logits(grid: Grid<T>, joints: usize, bones: &[Vec<usize>], logits: Vec<T>) -> Result<Self> {
        expect_length("the skinning logits", logits.len(), bones.iter().map(Vec::len).sum())?;
        if let Some(wrong) = logits.iter().find(|logit| !logit.is_finite()) {
            let (found, expected) = (format!("{wrong:?}"), "finite".to_owned());
            return Err(Error::Value { name: "a skinning logit", found, expected });
        }
        let equal = |row: &Vec<usize>| row.iter().map(|&bone| (bone, T::one())).collect::<Vec<_>>();
        let weights = SparseWeights::new(joints, bones.iter().map(equal))?;
        let mut field = Self { baked: BakedWeights::new(grid, weights)?, initial: logits.clone(), logits };
        field.update(|_| ());
        Ok(field)
    }

    /// The weights at the nodes, which give a frame's warp.
    pub fn baked(&self) -> &BakedWeights<T> {
        &self.baked
    }

    /// As [`BakedWeights::prune_starts`], with the weights as they are now. The bound stays true when they change.
    ///
    /// # Errors
    /// As [`BakedWeights::prune_starts`].
    pub fn prune_starts(&mut self, groups: &StartGroups, matters: &[bool]) -> Result<()> {
        self.baked.prune_starts(groups, matters)
    }

    /// The logits (P).
    pub fn parameters(&self) -> &[T] {
        &self.logits
    }

    /// Changes the logits (P) and with them the weights.
    pub fn update(&mut self, change: impl FnOnce(&mut [T])) {
        change(&mut self.logits);
        softmax_rows(self.baked.weights_mut(), &self.logits);
    }

    /// Pulls logits towards where they began: the mean over nodes of |l - l_initial|^2, of the nodes where `gradient` (P)
    /// is not all zero. Returns the mean and adds `weight` times its gradient.
    ///
    /// # Errors
    /// If `gradient` has not one element per logit.
    pub fn pull_to_initial(&self, weight: T, gradient: &mut [T]) -> Result<T> {
        expect_length("the gradient of the skinning logits", gradient.len(), self.logits.len())?;
        let weights = self.baked.weights();
        let is_touched = |&node: &usize| gradient[weights.range(node)].iter().any(|&value| value != T::zero());
        let touched: Vec<usize> = (0..weights.len()).filter(is_touched).collect();
        let share = T::one() / T::of(touched.len().max(1) as f64);
        let mut sum = T::zero();
        for index in touched.into_iter().flat_map(|node| weights.range(node)) {
            let moved = self.logits[index] - self.initial[index];
            sum += moved * moved;
            gradient[index] += T::of(2.0) * weight * share * moved;
        }
        Ok(sum * share)
    }

    /// A gradient that nothing has been added to yet (P).
    pub fn zero_gradient(&self) -> Vec<T> {
        vec![T::zero(); self.logits.len()]
    }

    /// Adds the weights of the eight nodes around each point, scaled, to dense rows.
    fn interpolate(&self, point: [T; 3], mut add: impl FnMut(usize, usize, T)) {
        let cell = self.baked.grid().cell(point);
        for corner in 0..8 {
            let (bones, weights) = self.baked.weights().row(cell.corner(corner));
            bones.iter().zip(weights).for_each(|(&bone, &weight)| add(corner, usize::from(bone), weight));
        }
    }
}

impl<T: Real> SkinningWeights<T> for VoxelSkinning<T> {
    type Workspace = ();

    fn joints(&self) -> usize {
        self.baked.weights().joints()
    }

    fn weights(&self, (): &mut (), points: &[[T; 3]], weights: &mut [T]) {
        weights.fill(T::zero());
        for (&point, row) in points.iter().zip(weights.chunks_exact_mut(self.joints())) {
            let cell = self.baked.grid().cell(point);
            self.interpolate(point, |corner, bone, weight| row[bone] += cell.share(corner) * weight);
        }
    }

    fn weights_and_gradients(&self, (): &mut (), points: &[[T; 3]], weights: &mut [T], gradients: &mut [T]) {
        let joints = self.joints();
        self.weights(&mut (), points, weights);
        gradients.fill(T::zero());
        for (&point, rows) in points.iter().zip(gradients.chunks_exact_mut(3 * joints)) {
            let cell = self.baked.grid().cell(point);
            let slopes = self.baked.grid().slopes(&cell, point);
            self.interpolate(point, |corner, bone, weight| {
                for (axis, slope) in cell.share_gradient(corner, slopes).into_iter().enumerate() {
                    rows[axis * joints + bone] += slope * weight;
                }
            });
        }
    }
}

/// Sets each row of weights to the softmax of its logits.
fn softmax_rows<T: Real>(weights: &mut SparseWeights<T>, logits: &[T]) {
    const ROWS: usize = 4096;
    let (offsets, mut rest) = weights.offsets_and_weights_mut();
    let mut blocks = Vec::new();
    for first in (0..offsets.len() - 1).step_by(ROWS) {
        let offsets = &offsets[first..(first + ROWS + 1).min(offsets.len())];
        let count = (offsets[offsets.len() - 1] - offsets[0]) as usize;
        let (block, after) = rest.split_at_mut(count);
        rest = after;
        blocks.push((offsets, block));
    }
    blocks.into_par_iter().for_each(|(offsets, weights)| {
        let first = offsets[0] as usize;
        let rows = || offsets.windows(2).map(|row| row[0] as usize - first..row[1] as usize - first);
        let logits = &logits[first..first + weights.len()];
        vectorised(
            #[inline(always)]
            || {
                for row in rows() {
                    let greatest = logits[row.clone()].iter().copied().fold(T::neg_infinity(), T::max);
                    let shifted = weights[row.clone()].iter_mut().zip(&logits[row]);
                    shifted.for_each(|(weight, &logit)| *weight = logit - greatest);
                }
                // All rows in one pass: they are too short to fill a vector.
                weights.iter_mut().for_each(|weight| *weight = T::exp_negative(*weight));
                for row in rows() {
                    let scale = T::one() / weights[row.clone()].iter().copied().sum::<T>();
                    weights[row].iter_mut().for_each(|weight| *weight *= scale);
                }
            },
        );
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::softmax_field::{generator, numbers, vectors};

    fn field(joints: usize) -> VoxelSkinning<f64> {
        let grid = Grid::regular([-1.0; 3], [1.0; 3], [5, 6, 7]).unwrap();
        let mut generator = generator(81);
        let row = |_| (0..joints).zip(numbers::<f64>(&mut generator, joints)).map(|(b, w)| (b, w.abs())).collect();
        let rows: Vec<_> = (0..grid.len()).map(row).collect();
        VoxelSkinning::new(grid, joints, &rows).unwrap()
    }

    #[test]
    fn weight_gradients_match_finite_differences_and_weights_sum_to_one() {
        let field = field(10);
        let points: Vec<[f64; 3]> = vectors(&mut generator(82), 40, 1.2);
        let (mut weights, mut gradients) = (vec![0.0; 400], vec![0.0; 1200]);
        field.weights_and_gradients(&mut (), &points, &mut weights, &mut gradients);
        for (index, point) in points.iter().enumerate() {
            assert!((weights[10 * index..10 * index + 10].iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for axis in 0..3 {
                let at = |step: f64| {
                    let (mut moved, mut weights) = (*point, vec![0.0; 10]);
                    moved[axis] += step;
                    field.weights(&mut (), &[moved], &mut weights);
                    weights
                };
                let (above, below) = (at(1e-6), at(-1e-6));
                for bone in 0..10 {
                    let expected = (above[bone] - below[bone]) / 2e-6;
                    assert!((gradients[30 * index + 10 * axis + bone] - expected).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn updates_are_the_softmax_and_nodes_keep_eight_bones() {
        let mut field = field(12);
        let before = field.baked().weights().clone();
        assert!((0..before.len()).all(|node| before.row(node).0.len() == MOST_BONES));
        field.update(|logits| logits.iter_mut().for_each(|logit| *logit += 3.0));
        let after = field.baked().weights();
        assert!(after.weights().iter().zip(before.weights()).all(|(a, b)| (a - b).abs() < 1e-12));
        field.update(|logits| logits[0] += 50.0);
        assert!((field.baked().weights().row(0).1[0] - 1.0).abs() < 1e-12);
    }

    // L = mean over touched nodes of |l - l_initial|^2
    #[test]
    fn the_pull_is_the_gradient_of_its_mean() {
        let mut field = field(4);
        let changes = numbers::<f64>(&mut generator(83), field.parameters().len());
        field.update(|logits| logits.iter_mut().zip(&changes).for_each(|(logit, change)| *logit += change));
        let mut touched = field.zero_gradient();
        (touched[0], touched[9]) = (1e-300, 1e-300);
        let mut gradient = touched.clone();
        field.pull_to_initial(0.7, &mut gradient).unwrap();
        for index in 0..16 {
            let at = |step: f64| {
                let mut moved = field.clone();
                moved.update(|logits| logits[index] += step);
                0.7 * moved.pull_to_initial(0.7, &mut touched.clone()).unwrap()
            };
            let expected = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((gradient[index] - expected).abs() < 1e-9, "{index}");
        }
    }

    #[test]
    fn rows_that_do_not_fit_are_refused() {
        let grid = || Grid::<f64>::regular([0.0; 3], [1.0; 3], [2; 3]).unwrap();
        let rows = |row: Vec<(usize, f64)>, count| VoxelSkinning::new(grid(), 3, &vec![row; count]).is_err();
        assert!(rows(vec![(0, 1.0)], 7) && rows(vec![], 8) && rows(vec![(3, 1.0)], 8));
        assert!(rows(vec![(0, 2.0), (1, -0.5)], 8) && rows(vec![(0, f64::NAN)], 8));
    }
}
