//! The modes in which people's bones differ: principal components of bone lengths (METHOD-BODY 9.4 b).
//!
//! lengths = mean + c P, c of unit variance, each mode with its largest entry positive; modes are kept up to a share of the variance. As scales they are
//! divided by the lengths of the skeleton at rest. B bones.

use xavatar_body::ShapeSpace;

/// Modes of bones.
#[derive(Clone, Debug, PartialEq)]
pub struct BoneModes {
    /// Mean scales (B).
    pub mean: Vec<f64>,
    /// Scales of each mode (K, B).
    pub basis: Vec<Vec<f64>>,
    /// c of each subject (N, K).
    pub coefficients: Vec<Vec<f64>>,
    /// The share of the variance that all components have (N or fewer).
    pub explained: Vec<f64>,
}

/// The modes of subjects' bone lengths (N, B), of a skeleton with these lengths at rest (B): as many as have `share` of the variance, at most `most`.
pub fn bone_modes(lengths: &[Vec<f64>], rest: &[f64], share: f64, most: usize) -> BoneModes {
    let count = lengths.len().max(1) as f64;
    let mean: Vec<f64> = (0..rest.len()).map(|bone| lengths.iter().map(|of| of[bone]).sum::<f64>() / count).collect();
    let deviation = (count - 1.0).max(1.0).sqrt();
    let centred = |of: &Vec<f64>| of.iter().zip(&mean).map(|(length, mean)| length - mean).collect::<Vec<f64>>();
    let centred: Vec<Vec<f64>> = lengths.iter().map(centred).collect();
    let scaled: Vec<Vec<f64>> = centred.iter().map(|row| row.iter().map(|value| value / deviation).collect()).collect();
    let space = ShapeSpace::of_directions(mean.clone(), &scaled);
    let total: f64 = space.variance.iter().sum();
    let explained: Vec<f64> = space.variance.iter().map(|variance| variance / total.max(f64::MIN_POSITIVE)).collect();
    let mut reached = 0.0;
    let wanted = explained.iter().take_while(|of| {
        let is_needed = reached < share;
        reached += **of;
        is_needed
    });
    let kept = wanted.count().min(most).min(space.variance.iter().filter(|variance| **variance > 0.0).count());
    let along = |row: &Vec<f64>, mode: usize| {
        let product: f64 = row.iter().zip(&space.basis[mode]).map(|(value, entry)| value * entry).sum();
        product / space.variance[mode].sqrt()
    };
    // A bone without length has no scale.
    let as_scale = |(length, rest): (f64, &f64)| if *rest > 0.0 { length / rest } else { 0.0 };
    let mode = |mode: usize| {
        let deviation = space.variance[mode].sqrt();
        space.basis[mode].iter().map(|entry| entry * deviation).zip(rest).map(as_scale).collect()
    };
    BoneModes {
        mean: mean.iter().copied().zip(rest).map(|(mean, rest)| if *rest > 0.0 { mean / rest } else { 1.0 }).collect(),
        basis: (0..kept).map(mode).collect(),
        coefficients: centred.iter().map(|row| (0..kept).map(|mode| along(row, mode)).collect()).collect(),
        explained,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{largest_difference, reference};

    #[test]
    fn modes_are_the_references() {
        let golden = reference("blsm_bone_basis");
        let lengths: Vec<Vec<f64>> = golden["lengths"].chunks_exact(23).map(<[f64]>::to_vec).collect();
        let modes = bone_modes(&lengths, &golden["rest_lengths"], 1.0, 3);
        assert!(largest_difference(&modes.mean, &golden["bone_mean"]) < 1e-12);
        assert!(largest_difference(&modes.basis.concat(), &golden["bone_basis"]) < 1e-9);
        assert!(largest_difference(&modes.explained[..6], &golden["explained"]) < 1e-9);
        let variance: f64 = modes.coefficients.iter().map(|c| c[0] * c[0]).sum::<f64>() / 49.0;
        assert!((variance - 1.0).abs() < 1e-9);
        // No more than are needed.
        let first = modes.explained[0];
        assert_eq!(bone_modes(&lengths, &golden["rest_lengths"], first * 0.9, 6).basis.len(), 1);
        assert_eq!(bone_modes(&lengths, &golden["rest_lengths"], first * 1.001, 6).basis.len(), 2);
    }
}
