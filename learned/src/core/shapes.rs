//! The space of shapes of subjects' templates, and the regressor that finds their joints in them (METHOD-BODY 3, steps 5 and 6).
//!
//! T_i = mean + sum_k c_ik D_k with c of unit variance: principal components of what subjects differ by. A row of the regressor is a convex mean of
//! vertices near the joint that is the joint and follows it, over the strongest directions (non-negative least squares). V vertices; metres.

use glam::DVec3;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;
use xavatar_body::{JointFit, Motion};

use super::Identity;

/// Directions with a smaller share of the variance are rounding.
const NOTHING: f64 = 1e-7;
/// After so many it has long converged, if there is no NaN.
const ITERATIONS: usize = 100_000;
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
    let scale = 1.0 / (count.saturating_sub(1).max(1) as f64).sqrt();
    let offset = |subject: &Identity| {
        let places = subject.template.iter().zip(&mean);
        places.flat_map(|(place, mean)| ((*place - *mean) * scale).to_array()).collect::<Vec<f64>>()
    };
    // A column a subject.
    let offsets = DMatrix::from_vec(3 * vertices, count, subjects.iter().flat_map(offset).collect());
    let total = offsets.norm_squared();
    let (variances, axes) = principal_axes(&offsets, most);
    let kept = variances.iter().take_while(|variance| **variance > NOTHING * total).count();
    let along: Vec<Vec<f64>> =
        axes[..kept].iter().map(|axis| (offsets.tr_mul(axis) / scale).as_slice().to_vec()).collect();
    Shapes {
        directions: axes[..kept]
            .iter()
            .zip(&variances)
            .map(|(axis, variance)| {
                let places = axis.as_slice().as_chunks::<3>().0.iter();
                places.map(|place| DVec3::from_array(*place) * variance.sqrt()).collect()
            })
            .collect(),
        coefficients: (0..count)
            .map(|subject| {
                along.iter().zip(&variances).map(|(along, variance)| along[subject] / variance.sqrt()).collect()
            })
            .collect(),
        mean,
    }
}

/// The largest variances of columns (D, N) along axes (D) at right angles, the largest first; of each axis the largest entry is positive.
fn principal_axes(columns: &DMatrix<f64>, most: usize) -> (Vec<f64>, Vec<DVector<f64>>) {
    // Products of columns have the same variances as those of rows, and may be fewer.
    let is_flat = columns.ncols() <= columns.nrows();
    let products = if is_flat { columns.tr_mul(columns) } else { columns * columns.transpose() };
    let parts = Some(products).filter(|products| !products.is_empty());
    let parts = parts.and_then(|products| SymmetricEigen::try_new(products, f64::EPSILON, ITERATIONS));
    let Some(parts) = parts else { return (Vec::new(), Vec::new()) };
    let mut order: Vec<usize> = (0..parts.eigenvalues.len()).collect();
    order.sort_by(|one, other| parts.eigenvalues[*other].total_cmp(&parts.eigenvalues[*one]));
    order.truncate(most);
    let axis = |at: &usize| {
        let vector = parts.eigenvectors.column(*at);
        let axis = if is_flat { (columns * vector).normalize() } else { vector.into_owned() };
        let largest = axis.iter().copied().max_by(|one, other| one.abs().total_cmp(&other.abs())).unwrap_or(1.0);
        axis * largest.signum()
    };
    (order.iter().map(|at| parts.eigenvalues[*at]).collect(), order.iter().map(axis).collect())
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
