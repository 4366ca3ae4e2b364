//! A linear space of shapes: how well it compresses, what it can express, how plausible what it makes is (Wang ch. 3; METHOD-BODY sections 7, 8).
//!
//! mean + sum_k a_k sqrt(lambda_k) u_k with orthonormal u_k and a of unit variance. Moved to another mesh by W it is
//! W U L U^T W^T, with the misfit d = mean' - W mean as one more direction where that is wanted: the thin decomposition of
//! [W U L^(1/2) | d], of which no covariance is formed. K directions of V vertices; metres.

use super::retopology::SurfaceMap;
use super::symmetric::eigen;

/// A space of shapes.
#[derive(Clone, Debug)]
pub struct ShapeSpace {
    /// (3 V).
    pub mean: Vec<f64>,
    /// K orthonormal rows of (3 V), the one with the largest variance first; each with its largest entry positive.
    pub basis: Vec<Vec<f64>>,
    /// (K).
    pub variance: Vec<f64>,
}

impl ShapeSpace {
    /// The space of directions whose coefficients have unit variance, rows of (3 V).
    pub fn of_directions(mean: Vec<f64>, directions: &[Vec<f64>]) -> Self {
        let gram: Vec<Vec<f64>> =
            directions.iter().map(|one| directions.iter().map(|other| dot(one, other)).collect()).collect();
        let (variance, mixes) = eigen(gram);
        let row = |(mix, variance): (&Vec<f64>, &f64)| {
            let mut row = vec![0.0; mean.len()];
            for (share, direction) in mix.iter().zip(directions) {
                row.iter_mut().zip(direction).for_each(|(sum, value)| *sum += share * value);
            }
            let largest = row.iter().copied().max_by(|one, other| one.abs().total_cmp(&other.abs())).unwrap_or(1.0);
            let scale = if *variance > 0.0 { largest.signum() / variance.sqrt() } else { 0.0 };
            row.iter_mut().for_each(|value| *value *= scale);
            row
        };
        Self { basis: mixes.iter().zip(&variance).map(row).collect(), variance, mean }
    }

    /// The space on the points of `map`, whose mean is `mean`; with the misfit of the means as a direction of its own if that is wanted.
    pub fn moved(&self, map: &SurfaceMap, mean: Vec<f64>, with_misfit: bool) -> Self {
        let scaled = |(row, variance): (&Vec<f64>, &f64)| {
            map.apply(row, 3).into_iter().map(|value| value * variance.sqrt()).collect()
        };
        let mut directions: Vec<Vec<f64>> = self.basis.iter().zip(&self.variance).map(scaled).collect();
        if with_misfit {
            directions.push(mean.iter().zip(map.apply(&self.mean, 3)).map(|(own, found)| own - found).collect());
        }
        Self::of_directions(mean, &directions)
    }

    /// The share of the variance that the first 1, 2, ... K directions have.
    pub fn compactness(&self) -> Vec<f64> {
        let total: f64 = self.variance.iter().sum();
        let mut sum = 0.0;
        let share = |variance: &f64| {
            sum += variance;
            sum / total
        };
        self.variance.iter().map(share).collect()
    }

    /// How far shapes are from what the first 1, 2, ... K directions make of them: the mean distance of a vertex.
    pub fn generalisation(&self, shapes: &[Vec<f64>]) -> Vec<f64> {
        let mut sums = vec![0.0; self.basis.len()];
        for shape in shapes {
            let mut rest: Vec<f64> = shape.iter().zip(&self.mean).map(|(shape, mean)| shape - mean).collect();
            for (sum, row) in sums.iter_mut().zip(&self.basis) {
                let along = dot(row, &rest);
                rest.iter_mut().zip(row).for_each(|(rest, value)| *rest -= along * value);
                *sum += mean_length(&rest) / shapes.len() as f64;
            }
        }
        sums
    }

    /// The shape of coefficients of unit variance (K).
    pub fn shape(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut shape = self.mean.clone();
        for ((coefficient, variance), row) in coefficients.iter().zip(&self.variance).zip(&self.basis) {
            shape.iter_mut().zip(row).for_each(|(sum, value)| *sum += coefficient * variance.sqrt() * value);
        }
        shape
    }

    /// How far a shape is from the nearest of `shapes`: the mean distance of a vertex.
    pub fn specificity(shape: &[f64], shapes: &[Vec<f64>]) -> f64 {
        let distance = |other: &Vec<f64>| {
            mean_length(&shape.iter().zip(other).map(|(one, other)| one - other).collect::<Vec<f64>>())
        };
        shapes.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}

/// The mean length of rows of three.
fn mean_length(rows: &[f64]) -> f64 {
    let rows = rows.as_chunks::<3>().0;
    rows.iter().map(|row| dot(row, row).sqrt()).sum::<f64>() / rows.len().max(1) as f64
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
