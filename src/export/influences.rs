//! Few joints a vertex, as file formats and graphics cards want them: the K strongest, scaled to sum to one.
//!
//! V vertices, J joints, K influences.

use std::cmp::Ordering;

/// Weights below this are rounding.
const NEGLIGIBLE: f32 = 1e-7;

/// The joints of each vertex and their weights, K a row.
#[derive(Clone, Debug, Default)]
pub(super) struct Influences {
    pub(super) count: usize,
    /// (V, K), the strongest first; 0 where the weight is 0.
    pub(super) joints: Vec<u8>,
    /// (V, K), rows of sum 1.
    pub(super) weights: Vec<f32>,
    /// What each vertex's weights summed to before they were scaled (V).
    pub(super) kept: Vec<f32>,
}

impl Influences {
    /// The `count` strongest of each row of `weights` (V, `width`).
    pub(super) fn strongest(weights: &[f32], width: usize, count: usize) -> Self {
        let mut influences = Self { count, ..Self::default() };
        for row in weights.chunks_exact(width) {
            let mut order: Vec<usize> = (0..width).filter(|joint| row[*joint] > NEGLIGIBLE).collect();
            order.sort_by(|a, b| row[*b].partial_cmp(&row[*a]).unwrap_or(Ordering::Equal));
            order.truncate(count);
            let sum: f32 = order.iter().map(|joint| row[*joint]).sum();
            let first = influences.weights.len();
            influences.joints.extend(order.iter().map(|joint| *joint as u8));
            influences.weights.extend(order.iter().map(|joint| row[*joint] / sum));
            influences.joints.resize(first + count, 0);
            influences.weights.resize(first + count, 0.0);
            // The strongest takes the rounding: readers check that rows sum to one.
            influences.weights[first] = 1.0 - influences.weights[first + 1..].iter().sum::<f32>();
            influences.kept.push(sum);
        }
        influences
    }

    /// How many joints the vertex with most of them has, of those that count at all.
    pub(super) fn most(weights: &[f32], width: usize) -> usize {
        let held = |row: &[f32]| row.iter().filter(|weight| **weight > NEGLIGIBLE).count();
        weights.chunks_exact(width).map(held).max().unwrap_or(0)
    }

    /// The row of a vertex.
    pub(super) fn row(&self, vertex: usize) -> (&[u8], &[f32]) {
        let places = vertex * self.count..(vertex + 1) * self.count;
        (&self.joints[places.clone()], &self.weights[places])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_are_kept_in_order_and_sum_to_one() {
        let weights = [0.1, 0.4, 0.2, 0.3, 0.0, 1.0, 0.0, 0.0];
        let influences = Influences::strongest(&weights, 4, 2);
        assert_eq!(influences.row(0).0, [1, 3]);
        assert!((influences.row(0).1[0] - 4.0 / 7.0).abs() < 1e-6);
        assert_eq!(influences.row(1), (&[1, 0][..], &[1.0, 0.0][..]));
        assert!((influences.kept[0] - 0.7).abs() < 1e-6);
        assert_eq!(Influences::most(&weights, 4), 4);
    }
}
