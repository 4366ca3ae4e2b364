//! Adam (Kingma & Ba 2015) with its whole state in the open, so that a checkpoint can hold it.
//!
//! m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,  p -= rate * (m / (1 - b1^t)) / (sqrt(v / (1 - b2^t)) + epsilon).

use serde::{Deserialize, Serialize};

use crate::Real;
use crate::activation::vectorised;

/// The constants of [`Adam`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdamSettings {
    /// Decay of the first moment.
    pub first_decay: f64,
    /// Decay of the second moment.
    pub second_decay: f64,
    /// Keeps the division finite.
    pub epsilon: f64,
}

impl Default for AdamSettings {
    fn default() -> Self {
        Self { first_decay: 0.9, second_decay: 0.999, epsilon: 1e-8 }
    }
}

/// The moments of one flat parameter vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam<T> {
    /// First moment of each parameter.
    pub first_moment: Vec<T>,
    /// Second moment of each parameter.
    pub second_moment: Vec<T>,
    /// Updates done.
    pub updates: u64,
}

impl<T: Real> Adam<T> {
    /// The state before the first update of `length` parameters.
    pub fn new(length: usize) -> Self {
        Self { first_moment: vec![T::zero(); length], second_moment: vec![T::zero(); length], updates: 0 }
    }

    /// Updates `parameters` against `factor * gradient` (the factor is what clipping leaves).
    pub fn step(&mut self, settings: AdamSettings, rate: f64, factor: f64, gradient: &[T], parameters: &mut [T]) {
        self.updates += 1;
        let steps = self.updates as f64;
        let (b1, b2) = (T::of(settings.first_decay), T::of(settings.second_decay));
        let rate = T::of(rate / (1.0 - settings.first_decay.powf(steps)));
        let correction = T::of(1.0 / (1.0 - settings.second_decay.powf(steps)));
        let (factor, epsilon) = (T::of(factor), T::of(settings.epsilon));
        let moments = self.first_moment.iter_mut().zip(&mut self.second_moment);
        vectorised(
            #[inline(always)]
            || {
                for ((parameter, gradient), (first, second)) in parameters.iter_mut().zip(gradient).zip(moments) {
                    let gradient = factor * *gradient;
                    *first = b1 * *first + (T::one() - b1) * gradient;
                    *second = b2 * *second + (T::one() - b2) * gradient * gradient;
                    *parameter -= rate * *first / ((*second * correction).sqrt() + epsilon);
                }
            },
        );
    }
}

/// The factor that brings the joint norm of several gradients down to `maximum`; 1 where it is below. NaN stays NaN.
pub fn clipping_factor<T: Real>(gradients: &[&[T]], maximum: f64) -> f64 {
    let norm = gradients.iter().flat_map(|gradient| gradient.iter()).map(|g| g.wide() * g.wide()).sum::<f64>().sqrt();
    if norm <= maximum { 1.0 } else { maximum / norm }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two updates computed by hand: after the first, |change| = rate whatever the gradient's size.
    #[test]
    fn first_updates_follow_the_definition() {
        let mut adam = Adam::<f64>::new(2);
        let mut parameters = [1.0, -1.0];
        adam.step(AdamSettings::default(), 0.1, 1.0, &[4.0, -0.5], &mut parameters);
        assert!((parameters[0] - 0.9).abs() < 1e-8 && (parameters[1] + 0.9).abs() < 1e-8);
        adam.step(AdamSettings::default(), 0.1, 0.5, &[0.0, 0.0], &mut parameters);
        let m = 0.9 * 0.4 / (1.0 - 0.81);
        let v: f64 = 0.999 * 0.016 / (1.0 - 0.999f64.powi(2));
        assert!((parameters[0] - (0.9 - 0.1 * m / v.sqrt())).abs() < 1e-8);
    }

    #[test]
    fn clipping_scales_the_joint_norm() {
        assert_eq!(clipping_factor(&[&[3.0f32], &[4.0]], 10.0), 1.0);
        assert!((clipping_factor(&[&[3.0f32], &[4.0]], 0.1) - 0.02).abs() < 1e-12);
        assert!(clipping_factor(&[&[f32::NAN]], 0.1).is_nan());
    }
}
