//! Skinning weights at fixed poses, templates and correctives (METHOD-BODY 3, step 3 and D1).
//!
//! A posed vertex is sum_j w_j z_fj, z_fj = G_fj T_f + A_fj + t_f: per vertex minimise sum_f |sum_j w_j z_fj - r_f|^2 + (s / d)^2 |w - w_0|^2 over w >= 0 with
//! sum 1, on the joints that it or a neighbour on the mesh follows; at most eight are kept. s is the registrations' noise, d how far a weight is believed to
//! be from the body's that training began with. V vertices; metres.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// What a registration is off by, metres.
const NOISE: f64 = 3e-3;
/// What a weight is off by.
const DEVIATION: f64 = 0.1;
/// Weights of a vertex that are kept.
const KEPT: usize = 8;
/// Smaller ones are none.
const NEGLIGIBLE: f64 = 0.01;

/// A row of weights that are not zero, by joint.
pub type WeightRow = Vec<(usize, f64)>;

/// The joints that each vertex may follow, with the weights that it has (V).
#[derive(Clone, Debug)]
pub struct Grown {
    rows: Vec<WeightRow>,
}

impl Grown {
    /// The joints of weights (V) and of their neighbours' on the mesh.
    pub fn of(weights: &[WeightRow], faces: &[[u32; 3]]) -> Self {
        let mut rows = weights.to_vec();
        for face in faces {
            for corner in face {
                for other in face {
                    for (joint, _) in &weights[*other as usize] {
                        let row = &mut rows[*corner as usize];
                        if row.iter().all(|(own, _)| own != joint) {
                            row.push((*joint, 0.0));
                        }
                    }
                }
            }
        }
        rows.iter_mut().for_each(|row| row.sort_by_key(|(joint, _)| *joint));
        Self { rows }
    }
}

/// What frames say of weights (V).
pub struct WeightMoments<'a> {
    grown: &'a Grown,
    /// sum z_i . z_j and sum z_i . r of each vertex.
    sums: Vec<(Vec<f64>, Vec<f64>)>,
}

impl<'a> WeightMoments<'a> {
    /// Of no frames.
    pub fn new(grown: &'a Grown) -> Self {
        let empty = |row: &WeightRow| (vec![0.0; row.len() * row.len()], vec![0.0; row.len()]);
        Self { grown, sums: grown.rows.iter().map(empty).collect() }
    }

    /// Adds a registration (V). `moved` is where a vertex would be if it followed a joint alone.
    pub fn add(&mut self, registration: &[DVec3], moved: impl Fn(usize, usize) -> DVec3 + Sync) {
        let rows = self.sums.par_iter_mut().zip(&self.grown.rows).enumerate();
        rows.for_each(|(vertex, ((products, pulls), row))| {
            let places: Vec<DVec3> = row.iter().map(|(joint, _)| moved(vertex, *joint)).collect();
            for (one, place) in places.iter().enumerate() {
                pulls[one] += place.dot(registration[vertex]);
                for (other, also) in places.iter().enumerate() {
                    products[one * row.len() + other] += place.dot(*also);
                }
            }
        });
    }

    /// The weights (V).
    pub fn solve(&self) -> Vec<WeightRow> {
        let prior = (NOISE / DEVIATION).powi(2);
        let rows = self.sums.par_iter().zip(&self.grown.rows);
        rows.map(|((products, pulls), row)| {
            let before: Vec<f64> = row.iter().map(|(_, weight)| *weight).collect();
            let mut matrix = DMatrix::from_row_slice(row.len(), row.len(), products);
            let mut right = DVector::from_column_slice(pulls);
            for (place, weight) in before.iter().enumerate() {
                matrix[(place, place)] += prior;
                right[place] += prior * weight;
            }
            let weights = convex(&matrix, &right, before.len());
            kept(row.iter().zip(weights).map(|((joint, _), weight)| (*joint, weight)).collect())
        })
        .collect()
    }
}

/// x >= 0 with sum 1 that makes x^T A x / 2 - b^T x small: of the solutions with sum 1 the negative entries leave, the most negative first.
fn convex(matrix: &DMatrix<f64>, right: &DVector<f64>, count: usize) -> Vec<f64> {
    let mut active: Vec<usize> = (0..count).collect();
    let mut found = vec![0.0; count];
    while active.len() > 1 {
        let size = active.len();
        // Lagrange's equations: A x + mu = b, sum x = 1.
        let bordered = DMatrix::from_fn(size + 1, size + 1, |row, column| match (row < size, column < size) {
            (true, true) => matrix[(active[row], active[column])],
            (false, false) => 0.0,
            _ => 1.0,
        });
        let goal = DVector::from_fn(size + 1, |row, _| if row < size { right[active[row]] } else { 1.0 });
        let Some(solution) = bordered.lu().solve(&goal) else { break };
        let lowest = (0..size).min_by(|one, other| solution[*one].total_cmp(&solution[*other])).unwrap_or_default();
        if solution[lowest] >= 0.0 {
            active.iter().zip(solution.iter()).for_each(|(place, weight)| found[*place] = *weight);
            return found;
        }
        active.remove(lowest);
    }
    active.iter().for_each(|place| found[*place] = 1.0 / active.len() as f64);
    found
}

/// The largest entries, summing to 1, by joint.
fn kept(mut row: WeightRow) -> WeightRow {
    row.sort_by(|one, other| other.1.total_cmp(&one.1).then(one.0.cmp(&other.0)));
    row.truncate(KEPT);
    let largest = row.first().map_or(0.0, |(_, weight)| *weight);
    row.retain(|(_, weight)| *weight > NEGLIGIBLE.min(0.5 * largest));
    let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
    row.iter_mut().for_each(|(_, weight)| *weight /= sum);
    row.sort_by_key(|(joint, _)| *joint);
    row
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn weights_are_found_again_from_vertices_that_they_moved() {
        let truth = vec![vec![(0, 0.3), (1, 0.7)], vec![(1, 1.0)], vec![(0, 0.5), (2, 0.5)]];
        let started = vec![vec![(0, 0.5), (1, 0.5)], vec![(1, 1.0)], vec![(0, 0.6), (2, 0.4)]];
        let grown = Grown::of(&started, &[[0, 1, 2]]);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut moments = WeightMoments::new(&grown);
        for _ in 0..60 {
            let places: Vec<DVec3> = (0..9).map(|_| DVec3::from_array(random.random())).collect();
            let at = |vertex: usize, joint: usize| places[3 * vertex + joint];
            let registration: Vec<DVec3> = truth
                .iter()
                .enumerate()
                .map(|(vertex, row)| row.iter().map(|(joint, weight)| at(vertex, *joint) * *weight).sum())
                .collect();
            moments.add(&registration, at);
        }
        for (found, truth) in moments.solve().iter().zip(&truth) {
            assert_eq!(found.len(), truth.len());
            for ((joint, weight), (expected, of)) in found.iter().zip(truth) {
                assert!(joint == expected && (weight - of).abs() < 1e-3, "{found:?}");
            }
        }
    }

    #[test]
    fn a_weight_that_would_be_negative_is_none() {
        // Nearest to (1.2, -0.2) with sum 1 and nothing negative is (1, 0).
        let found = convex(&DMatrix::identity(2, 2), &DVector::from_vec(vec![1.2, -0.2]), 2);
        assert_eq!(found, [1.0, 0.0]);
    }
}
