//! MHR's pose correctives, a network of the joints' rotations, and what is linear in the rotations of SMPL-X's joints of it.
//!
//! Offsets = W relu(S f): f has the first two columns of each joint's own rotation but the first two joints', less the identity's. Between the
//! T-pose and others, relu(S f) is fitted by ridge regression on the entries of the 54 rotations less the identity's, over poses drawn at random;
//! W takes the fit to the vertices. V vertices, H hidden units, N poses; centimetres.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use xavatar_vector::{Matrix, MatrixMut, Write, product};

use super::rig::{Rig, Similarity};
use super::t_pose::TPose;
use crate::imported::POSE_FEATURES;
use crate::smplx;

/// Joints whose rotations are no features: those of the whole body.
const FIRST: usize = 2;
/// Features of a joint.
const PER_JOINT: usize = 6;
/// Poses that the fit is made on, and measured on.
const FITTED: usize = 2000;
const MEASURED: usize = 100;
/// How far each component of a joint's rotation is spread, radians.
const SPREAD: f64 = 0.3;
/// Ridge, as a share of the features' mean square.
const RIDGE: f64 = 1e-3;
/// Rows that a thread multiplies at a time.
const ROWS: usize = 512;

/// The network.
pub(super) struct Network {
    pub hidden: usize,
    /// S: (hidden unit, feature, weight).
    pub first: Vec<(u32, u32, f64)>,
    /// W: (3 V, H), row-major.
    pub second: Vec<f32>,
}

/// What is left of it in a body of SMPL-X's layout, in the frame that MHR was made in.
pub(super) struct LinearCorrectives {
    /// Offsets in the T-pose (V).
    pub at_rest: Vec<DVec3>,
    /// What a unit of each feature adds to them (V, 3, 486).
    pub directions: Vec<f32>,
    /// Root mean square of what the network adds to the T-pose's offsets over poses that were not fitted, millimetres.
    pub rms: f64,
    /// The same of what the directions leave of it.
    pub left: f64,
}

/// Poses as both sides see them.
struct Poses {
    /// Entries of the rotations less the identity's (N, 486), row-major.
    features: Vec<f64>,
    /// Hidden units less the T-pose's (N, H), row-major.
    hidden: Vec<f64>,
}

impl Network {
    /// How many features so many joints have.
    pub fn features(joints: usize) -> usize {
        PER_JOINT * joints.saturating_sub(FIRST)
    }

    /// The hidden units (H) for the joints' own turns.
    fn activations(&self, own_turns: &[DQuat]) -> Vec<f64> {
        let features: Vec<f64> = own_turns.iter().skip(FIRST).flat_map(columns_less_identity).collect();
        let mut units = vec![0.0; self.hidden];
        self.first
            .iter()
            .for_each(|(unit, feature, weight)| units[*unit as usize] += weight * features[*feature as usize]);
        units.iter_mut().for_each(|unit| *unit = unit.max(0.0));
        units
    }

    /// Offsets (columns of 3 V) for columns of hidden units (H, N), row-major.
    fn offsets(&self, units: &[f32]) -> Vec<f32> {
        let (rows, columns) = (self.second.len() / self.hidden, units.len() / self.hidden);
        let mut offsets = vec![0.0; rows * columns];
        let blocks = offsets.par_chunks_mut(ROWS * columns).zip(self.second.par_chunks(ROWS * self.hidden));
        blocks.for_each(|(offsets, second)| {
            let rows = second.len() / self.hidden;
            let second = Matrix::new(second, rows, self.hidden, self.hidden);
            let units = Matrix::new(units, self.hidden, columns, columns);
            product(MatrixMut::new(offsets, rows, columns, columns), Write::Replace, second, units);
        });
        offsets
    }

    /// The correctives of a rig that was made with its joints (J) where `made` has them, in SMPL-X's terms.
    pub fn linear(&self, rig: &Rig, made: &[Similarity], pose: &TPose) -> LinearCorrectives {
        let at_rest = self.activations(&rig.own_turns(made, pose.turns()));
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let [fitted, measured] = [FITTED, MEASURED].map(|count| {
            let drawn: Vec<Vec<DQuat>> = (0..count).map(|_| drawn(&mut random)).collect();
            let hidden: Vec<Vec<f64>> = drawn
                .par_iter()
                .map(|local| {
                    let world: Vec<DQuat> =
                        in_world(local).into_iter().zip(pose.turns()).map(|(turn, made)| turn * *made).collect();
                    let units = self.activations(&rig.own_turns(made, &world));
                    units.into_iter().zip(&at_rest).map(|(unit, rest)| unit - rest).collect()
                })
                .collect();
            let features = drawn.iter().flat_map(|local| local[1..].iter().flat_map(entries_less_identity)).collect();
            Poses { features, hidden: hidden.concat() }
        });
        let by_feature = fitted.regression(self.hidden);
        let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
        let directions = self.offsets(&narrow(by_feature.as_slice()));
        let true_offsets =
            self.offsets(&narrow(DMatrix::from_row_slice(MEASURED, self.hidden, &measured.hidden).as_slice()));
        let features = DMatrix::from_row_slice(MEASURED, POSE_FEATURES, &measured.features);
        let fit = self.offsets(&narrow((features * &by_feature).as_slice()));
        let rms = |values: &mut dyn Iterator<Item = f32>| {
            let squares: f64 = values.map(|value| f64::from(value).powi(2)).sum();
            10.0 * (3.0 * squares / true_offsets.len().max(1) as f64).sqrt()
        };
        let rest = self.offsets(&narrow(&at_rest));
        LinearCorrectives {
            at_rest: rest.as_chunks::<3>().0.iter().map(|row| DVec3::from_array(row.map(f64::from))).collect(),
            rms: rms(&mut true_offsets.iter().copied()),
            left: rms(&mut true_offsets.iter().zip(&fit).map(|(own, fit)| own - fit)),
            directions,
        }
    }
}

impl Poses {
    /// What each feature adds to the hidden units: (486, H).
    fn regression(&self, hidden: usize) -> DMatrix<f64> {
        let count = self.features.len() / POSE_FEATURES;
        let features = Matrix::new(&self.features, count, POSE_FEATURES, POSE_FEATURES);
        let against = |values: &[f64], columns: usize| {
            let mut sums = vec![0.0; POSE_FEATURES * columns];
            let values = Matrix::new(values, count, columns, columns);
            product(
                MatrixMut::new(&mut sums, POSE_FEATURES, columns, columns),
                Write::Replace,
                features.transposed(),
                values,
            );
            DMatrix::from_row_slice(POSE_FEATURES, columns, &sums)
        };
        let mut squares = against(&self.features, POSE_FEATURES);
        let ridge = RIDGE * squares.trace() / POSE_FEATURES as f64;
        (0..POSE_FEATURES).for_each(|at| squares[(at, at)] += ridge);
        let sums = against(&self.hidden, hidden);
        squares.cholesky().map_or_else(|| DMatrix::zeros(POSE_FEATURES, hidden), |factor| factor.solve(&sums))
    }
}

/// A pose drawn at random: each joint's turn (55), the root's none.
fn drawn(random: &mut impl Rng) -> Vec<DQuat> {
    let mut turn = || {
        DQuat::from_scaled_axis(DVec3::from_array(std::array::from_fn(|_| {
            SPREAD * random.sample::<f64, _>(StandardNormal)
        })))
    };
    std::iter::once(DQuat::IDENTITY).chain((1..smplx::joint::COUNT).map(|_| turn())).collect()
}

/// The turns of joints (55) in the world.
fn in_world(local: &[DQuat]) -> Vec<DQuat> {
    let mut world: Vec<DQuat> = Vec::with_capacity(local.len());
    for (turn, parent) in local.iter().zip(&smplx::skeleton().parents) {
        world.push(parent.map_or(*turn, |parent| world[parent] * *turn));
    }
    world
}

fn columns_less_identity(turn: &DQuat) -> [f64; PER_JOINT] {
    let [x, y, _] = (DMat3::from_quat(*turn) - DMat3::IDENTITY).to_cols_array_2d();
    [x[0], x[1], x[2], y[0], y[1], y[2]]
}

/// Row-major, as SMPL-X's pose features.
fn entries_less_identity(turn: &DQuat) -> [f64; 9] {
    (DMat3::from_quat(*turn) - DMat3::IDENTITY).transpose().to_cols_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_linear_in_the_rotations_is_found() {
        let poses = {
            let mut random = ChaCha8Rng::seed_from_u64(3);
            let drawn: Vec<Vec<DQuat>> = (0..700).map(|_| drawn(&mut random)).collect();
            let features: Vec<f64> =
                drawn.iter().flat_map(|local| local[1..].iter().flat_map(entries_less_identity)).collect();
            let unit = |row: &[f64]| [row[1] - 0.5 * row[30], 2.0 * row[485]];
            Poses { hidden: features.chunks_exact(POSE_FEATURES).flat_map(unit).collect(), features }
        };
        let found = poses.regression(2);
        for (row, goal) in poses.features.chunks_exact(POSE_FEATURES).zip(poses.hidden.as_chunks::<2>().0) {
            let fit = DMatrix::from_row_slice(1, POSE_FEATURES, row) * &found;
            assert!((fit[0] - goal[0]).abs() + (fit[1] - goal[1]).abs() < 0.02, "{fit} {goal:?}");
        }
    }
}
