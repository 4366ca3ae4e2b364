//! Fewer rounds: the correctives that the last rounds point to (Anderson 1965).
//!
//! A round takes correctives p to g(p), slowly where poses have taken up what correctives should. With f_k = g(p_k) - p_k of the last rounds the
//! next starts from sum a_k g(p_k), a = argmin |sum a_k f_k|^2 with sum 1: of a linear map the best that these rounds can say.

use std::collections::BTreeMap;

use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::correctives::{PER_JOINT, SparseCorrectives, VertexBlocks};

/// Rounds that are looked at.
const LAST: usize = 5;
/// What keeps the shares small, of the mean of the diagonal.
const RIDGE: f64 = 1e-4;

/// What the last rounds did.
#[derive(Clone, Debug, Default)]
pub(super) struct Acceleration {
    pub(super) rounds: Vec<(SparseCorrectives, SparseCorrectives)>,
}

impl Acceleration {
    /// What to start the next round from, after one that took `from` to `to`.
    pub fn next(&mut self, from: SparseCorrectives, to: SparseCorrectives) -> SparseCorrectives {
        self.rounds.push((from, to));
        if self.rounds.len() > LAST {
            self.rounds.remove(0);
        }
        let changes: Vec<SparseCorrectives> =
            self.rounds.iter().map(|(from, to)| combined(&[(1.0, to), (-1.0, from)])).collect();
        let count = changes.len();
        let mut matrix = DMatrix::from_fn(count, count, |one, other| product(&changes[one], &changes[other]));
        let ridge = RIDGE * matrix.trace() / count as f64;
        (0..count).for_each(|place| matrix[(place, place)] += ridge);
        // argmin a^T A a with sum 1 is A^-1 1, scaled.
        let shares = matrix.cholesky().map(|cholesky| cholesky.solve(&DVector::from_element(count, 1.0)));
        let last = self.rounds.last().map(|(_, to)| to.clone()).unwrap_or_default();
        match shares.filter(|shares| shares.sum().abs() > f64::MIN_POSITIVE) {
            None => last,
            Some(shares) => {
                let sum = shares.sum();
                let terms: Vec<(f64, &SparseCorrectives)> =
                    shares.iter().map(|share| share / sum).zip(self.rounds.iter().map(|(_, to)| to)).collect();
                combined(&terms)
            }
        }
    }
}

fn combined(terms: &[(f64, &SparseCorrectives)]) -> SparseCorrectives {
    let vertices = terms.first().map_or(0, |(_, first)| first.vertices.len());
    let of_vertex = |vertex: usize| -> VertexBlocks {
        let mut blocks: BTreeMap<usize, [DVec3; PER_JOINT]> = BTreeMap::new();
        for (share, correctives) in terms {
            for (group, block) in &correctives.vertices[vertex] {
                let sum = blocks.entry(*group).or_default();
                sum.iter_mut().zip(block).for_each(|(sum, value)| *sum += *value * *share);
            }
        }
        blocks.into_iter().collect()
    };
    SparseCorrectives { vertices: (0..vertices).into_par_iter().map(of_vertex).collect() }
}

fn product(one: &SparseCorrectives, other: &SparseCorrectives) -> f64 {
    let of_vertex = |(one, other): (&VertexBlocks, &VertexBlocks)| -> f64 {
        let twins = one.iter().filter_map(|(group, block)| {
            let (_, twin) = other.iter().find(|(of, _)| of == group)?;
            Some(block.iter().zip(twin).map(|(a, b)| a.dot(*b)).sum::<f64>())
        });
        twins.sum()
    };
    let products: Vec<f64> = one.vertices.par_iter().zip(&other.vertices).map(of_vertex).collect();
    products.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn single(values: [f64; 2]) -> SparseCorrectives {
        let block = |value: f64| std::array::from_fn(|_| DVec3::splat(value));
        SparseCorrectives { vertices: vec![vec![(0, block(values[0])), (1, block(values[1]))]] }
    }

    fn values(of: &SparseCorrectives) -> [f64; 2] {
        [0, 1].map(|place| of.vertices[0][place].1[0].x)
    }

    // g halves the distance to 1 in one place and takes a twentieth of it in the other: plain rounds leave 0.95^6 = 0.74 of it.
    #[test]
    fn a_slow_map_arrives_within_few_rounds() {
        let map = |[a, b]: [f64; 2]| [a + 0.5 * (1.0 - a), b + 0.05 * (1.0 - b)];
        let mut acceleration = Acceleration::default();
        let mut at = [0.0, 0.0];
        for _ in 0..6 {
            at = values(&acceleration.next(single(at), single(map(at))));
        }
        assert!(at.iter().all(|value| (value - 1.0).abs() < 0.05), "{at:?}");
    }
}
