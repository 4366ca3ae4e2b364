//! How far correctives may be from the body's, and how noisy registrations are: the scales for which what is seen is most probable (METHOD-BODY 6).
//!
//! log N(Y | X P_0, s^2 I + X V_0 X^T) summed over outputs, V_0 = (a^2 / 1.84) I for entries of rotations: a joint turned by one radian, |R - I|^2 = 1.84,
//! moves a coordinate by a on the mean. Of a grid of seven by seven the best. n scans; metres.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::Support;

/// |x|^2 of a joint that is turned by a radian: of R - I, and of q - (0, 0, 0, 1).
const TURNED: [f64; 2] = [1.84, 0.245];
/// What is tried, metres.
const SPREADS: [f64; 7] = [0.5e-3, 1e-3, 2e-3, 3e-3, 5e-3, 8e-3, 12e-3];
const NOISES: [f64; 7] = [0.2e-3, 0.5e-3, 1e-3, 1.5e-3, 2e-3, 3e-3, 5e-3];

/// The scales of a personal body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// a, metres.
    pub spread: f64,
    /// s, metres.
    pub noise: f64,
}

impl Scales {
    /// The variance of each entry of the correctives, for joints of so many features.
    pub fn variance(self, per_joint: usize) -> f64 {
        self.spread * self.spread / if per_joint == 9 { TURNED[0] } else { TURNED[1] }
    }

    /// The most probable ones for features (n, F) and what was seen beyond the body's correctives (n, 3 V).
    pub fn most_probable(support: &Support, features: &[Vec<f64>], seen: &[Vec<f64>]) -> Self {
        let grid: Vec<Self> =
            SPREADS.iter().flat_map(|spread| NOISES.map(|noise| Self { spread: *spread, noise })).collect();
        let of_pattern = |(joints, vertices): &(Vec<usize>, Vec<usize>)| -> Vec<f64> {
            let rows: Vec<Vec<f64>> = features.iter().map(|all| support.features(joints, all)).collect();
            let count = rows.len();
            let inner = DMatrix::from_fn(count, count, |one, other| dot(&rows[one], &rows[other]));
            let outputs: Vec<usize> = vertices.iter().flat_map(|vertex| 3 * vertex..3 * vertex + 3).collect();
            let values = DMatrix::from_fn(count, outputs.len(), |scan, at| seen[scan][outputs[at]]);
            let covariance = |scales: &Self| {
                &inner * scales.variance(support.per_joint) + DMatrix::identity(count, count) * scales.noise.powi(2)
            };
            grid.iter().map(|scales| log_evidence(covariance(scales), &values)).collect()
        };
        let sums: Vec<Vec<f64>> = support.patterns.par_iter().map(of_pattern).collect();
        let total = |place: usize| sums.iter().map(|row| row[place]).sum::<f64>();
        let best = (0..grid.len()).max_by(|one, other| total(*one).total_cmp(&total(*other))).unwrap_or_default();
        grid[best]
    }
}

/// The logarithm of the probability of outputs (n, N), each normal about zero with the same covariance (n, n).
pub fn log_evidence(covariance: DMatrix<f64>, outputs: &DMatrix<f64>) -> f64 {
    let count = covariance.nrows() as f64;
    let Some(cholesky) = covariance.cholesky() else { return f64::NEG_INFINITY };
    let logarithm: f64 = cholesky.l_dirty().diagonal().iter().map(|entry| 2.0 * entry.ln()).sum();
    let solved = cholesky.solve(outputs);
    let squares: f64 = solved.iter().zip(outputs.iter()).map(|(one, other)| one * other).sum();
    -0.5 * (squares + outputs.ncols() as f64 * (logarithm + count * std::f64::consts::TAU.ln()))
}

fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::reference;

    #[test]
    fn the_evidence_is_the_references() {
        let golden = reference("avatar_posterior");
        let (features, outputs) = (45, 30);
        let matrix = |name: &str, rows, columns| DMatrix::from_row_slice(rows, columns, &golden[name]);
        let x = matrix("X", 3, features);
        let seen = matrix("Y", 3, outputs) - &x * matrix("P0", features, outputs);
        let covariance =
            &x * matrix("V0", features, features) * x.transpose() + DMatrix::identity(3, 3) * golden["sigma2"][0];
        let found = log_evidence(covariance, &seen);
        assert!(
            (found - golden["log_evidence"][0]).abs() < 1e-9 * found.abs(),
            "{found} {}",
            golden["log_evidence"][0]
        );
    }
}
