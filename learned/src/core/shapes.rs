//! The space of shapes of subjects' templates, and the regressor that finds their joints in them (METHOD-BODY 3, steps 5 and 6).
//!
//! T_i = mean + sum_k c_ik D_k with c of unit variance: principal components of what subjects differ by. A row of the regressor is a convex mean of
//! vertices near the joint that is the joint and follows it, over the strongest directions (non-negative least squares). V vertices; metres.

use glam::DVec3;
use rayon::prelude::*;
use xavatar_body::{JointFit, Motion, ShapeSpace};

use super::Identity;

/// Directions with a smaller share of the variance are rounding.
const NOTHING: f64 = 1e-7;
/// Directions that joints follow.
const FOLLOWED: usize = 20;
/// Entries of a row that are kept.
const KEPT: usize = 12;

/// A linear space of shapes.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// (V).
    pub mean: Vec<DVec3>,
    /// Directions whose coefficients have unit variance, the one that moves most first, each (V).
    pub directions: Vec<Vec<DVec3>>,
    /// The coefficients of each subject.
    pub coefficients: Vec<Vec<f64>>,
}

/// The space of these subjects, with at most `most` directions.
pub fn shapes_of(subjects: &[Identity], most: usize) -> Shapes {
    let vertices = subjects.first().map_or(0, |subject| subject.template.len());
    let count = subjects.len();
    let mut mean = vec![DVec3::ZERO; vertices];
    for subject in subjects {
        mean.iter_mut().zip(&subject.template).for_each(|(sum, place)| *sum += *place / count as f64);
    }
    let offsets = |subject: &Identity| -> Vec<f64> {
        subject.template.iter().zip(&mean).flat_map(|(place, mean)| (*place - *mean).to_array()).collect()
    };
    let scale = 1.0 / (count.saturating_sub(1).max(1) as f64).sqrt();
    let differences: Vec<Vec<f64>> = subjects.iter().map(offsets).collect();
    let scaled: Vec<Vec<f64>> = differences.iter().map(|row| row.iter().map(|value| value * scale).collect()).collect();
    let space = ShapeSpace::of_directions(mean.iter().flat_map(|place| place.to_array()).collect(), &scaled);
    let total: f64 = space.variance.iter().sum();
    let kept = space.variance.iter().take(most).take_while(|variance| **variance > NOTHING * total).count();
    let along = |row: &[f64], direction: usize| -> f64 {
        row.iter().zip(&space.basis[direction]).map(|(value, entry)| value * entry).sum::<f64>()
            / space.variance[direction].sqrt()
    };
    Shapes {
        directions: (0..kept)
            .map(|direction| {
                let deviation = space.variance[direction].sqrt();
                let rows = space.basis[direction].as_chunks::<3>().0;
                rows.iter().map(|row| DVec3::from_array(*row) * deviation).collect()
            })
            .collect(),
        coefficients: differences
            .iter()
            .map(|row| (0..kept).map(|direction| along(row, direction)).collect())
            .collect(),
        mean,
    }
}

impl Shapes {
    /// Brings a direction to another place; what were before it move on.
    pub fn move_to(&mut self, from: usize, to: usize) {
        let direction = self.directions.remove(from);
        self.directions.insert(to, direction);
        for subject in &mut self.coefficients {
            let coefficient = subject.remove(from);
            subject.insert(to, coefficient);
        }
    }
}

/// The rows of the joint regressor (J, V) of subjects in their space.
pub fn joint_rows(subjects: &[Identity], shapes: &Shapes) -> Vec<Vec<f64>> {
    let joints = subjects.first().map_or(0, |subject| subject.joints.len());
    let followed = shapes.directions.len().min(FOLLOWED);
    // What a unit of each coefficient does to a joint: coefficients are uncorrelated, so each is a mean of products.
    let fit = |joint: usize| {
        let mean = subjects.iter().map(|subject| subject.joints[joint]).sum::<DVec3>() / subjects.len() as f64;
        let moved = |direction: usize| -> DVec3 {
            let products = subjects.iter().zip(&shapes.coefficients);
            let sum: DVec3 = products.map(|(subject, c)| (subject.joints[joint] - mean) * c[direction]).sum();
            sum / subjects.len().saturating_sub(1).max(1) as f64
        };
        let motions = (0..followed).map(|direction| Motion {
            offsets: &shapes.directions[direction],
            joint: moved(direction),
            weight: 1.0,
        });
        let fit = JointFit { template: &shapes.mean, joint: mean, candidates: Vec::new(), motions: motions.collect() };
        pruned(fit.row())
    };
    (0..joints).into_par_iter().map(fit).collect()
}

/// The largest entries alone, summing to 1.
fn pruned(mut row: Vec<f64>) -> Vec<f64> {
    let mut sizes: Vec<f64> = row.iter().copied().filter(|weight| *weight > 0.0).collect();
    sizes.sort_by(|one, other| other.total_cmp(one));
    let least = sizes.get(KEPT - 1).copied().unwrap_or(0.0);
    row.iter_mut().for_each(|weight| *weight = if *weight < least { 0.0 } else { *weight });
    let sum: f64 = row.iter().sum();
    row.iter_mut().for_each(|weight| *weight /= sum);
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes of several sizes about their joint.
    fn boxes() -> Vec<Identity> {
        let corner = |index: usize, size: DVec3| {
            let sign = |bit: usize| if index >> bit & 1 == 0 { -1.0 } else { 1.0 };
            DVec3::new(sign(0), sign(1), sign(2)) * size
        };
        let of = |size: DVec3| Identity {
            template: (0..8).map(|index| corner(index, size)).collect(),
            joints: vec![DVec3::ZERO],
        };
        [(1.0, 2.0), (2.0, 2.0), (3.0, 1.0), (1.0, 1.0)].map(|(x, y)| of(DVec3::new(x, y, 1.0) * 0.1)).to_vec()
    }

    #[test]
    fn subjects_are_their_coefficients_shapes() {
        let subjects = boxes();
        let mut shapes = shapes_of(&subjects, 10);
        assert_eq!(shapes.directions.len(), 2);
        shapes.move_to(1, 0);
        for (subject, coefficients) in subjects.iter().zip(&shapes.coefficients) {
            for (vertex, place) in subject.template.iter().enumerate() {
                let moved = shapes.directions.iter().zip(coefficients).map(|(direction, c)| direction[vertex] * *c);
                assert!((shapes.mean[vertex] + moved.sum::<DVec3>()).distance(*place) < 1e-12);
            }
        }
        let variance: f64 = shapes.coefficients.iter().map(|c| c[0] * c[0]).sum::<f64>() / 3.0;
        assert!((variance - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_regressor_finds_the_joint_of_every_subject() {
        let subjects = boxes();
        let rows = joint_rows(&subjects, &shapes_of(&subjects, 10));
        for subject in &subjects {
            let joint: DVec3 = rows[0].iter().zip(&subject.template).map(|(weight, place)| *place * *weight).sum();
            assert!(joint.distance(subject.joints[0]) < 1e-6, "{joint}");
        }
    }
}
