//! The posterior of linear correctives y = x^T P + noise (Osman 6.10-6.12): a rank-one update a registration, no inverse.
//!
//! g = V x / (s^2 + x^T V x),  P <- P + g (y - x^T P),  V <- V - g (V x)^T. F features, N outputs that share V; metres.

use nalgebra::{DMatrix, DVector};

/// What is believed of the correctives of some outputs.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// P (F, N).
    pub mean: DMatrix<f64>,
    /// V (F, F).
    pub covariance: DMatrix<f64>,
    /// s^2: of every coordinate of a registration, metres^2.
    pub noise: f64,
}

impl Posterior {
    /// Takes in a registration: its features (F) and what was seen (N).
    pub fn observe(&mut self, x: &DVector<f64>, y: &DVector<f64>) {
        let spread = &self.covariance * x;
        let gain = &spread / (self.noise + x.dot(&spread));
        let surprise = y - self.mean.transpose() * x;
        self.mean += &gain * surprise.transpose();
        self.covariance -= &gain * spread.transpose();
    }

    /// The variance of an output in a pose with these features, the noise of a registration in it.
    pub fn variance(&self, x: &DVector<f64>) -> f64 {
        self.noise + x.dot(&(&self.covariance * x))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::reference::{largest_difference, reference};

    #[test]
    fn rank_one_updates_are_the_references_posterior() {
        let golden = reference("avatar_posterior");
        let (features, outputs) = (45, 30);
        let mut posterior = Posterior {
            mean: DMatrix::from_row_slice(features, outputs, &golden["P0"]),
            covariance: DMatrix::from_row_slice(features, features, &golden["V0"]),
            noise: golden["sigma2"][0],
        };
        let row = |name: &str, at: usize, width: usize| {
            DVector::from_column_slice(&golden[name][at * width..(at + 1) * width])
        };
        let flat = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        for scan in 0..3 {
            posterior.observe(&row("X", scan, features), &row("Y", scan, outputs));
            let expected = match scan {
                0 => "one",
                2 => "three",
                _ => continue,
            };
            assert!(largest_difference(&flat(&posterior.mean), &golden[&format!("{expected}_mean")]) < 1e-12);
            assert!(
                largest_difference(&flat(&posterior.covariance), &golden[&format!("{expected}_covariance")]) < 1e-12
            );
        }
        for (frame, variance) in golden["predicted_variance"].iter().enumerate() {
            let x = row("x", frame, features);
            let mean = posterior.mean.transpose() * &x;
            assert!(largest_difference(mean.as_slice(), row("predicted_mean", frame, outputs).as_slice()) < 1e-12);
            assert!((posterior.variance(&x) - variance).abs() < 1e-12);
        }
    }

    // Correctives drawn from the prior, one noisy scan, other poses near it and far from it: z^2 is one on the mean.
    #[test]
    fn a_scan_is_not_trusted_further_than_it_reaches() {
        let (features, outputs, noise, spread) = (27, 4000, 2e-3_f64, 3e-3_f64);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut normal = |scale: f64| -> f64 { scale * Distribution::<f64>::sample(&StandardNormal, &mut random) };
        let truth = DMatrix::from_fn(features, outputs, |_, _| normal(spread));
        let scan = DVector::from_fn(features, |_, _| normal(0.6));
        let mut posterior = Posterior {
            mean: DMatrix::zeros(features, outputs),
            covariance: DMatrix::identity(features, features) * spread.powi(2),
            noise: noise.powi(2),
        };
        let seen =
            |x: &DVector<f64>, normal: &mut dyn FnMut(f64) -> f64| truth.tr_mul(x).map(|value| value + normal(noise));
        let y = seen(&scan, &mut normal);
        posterior.observe(&scan, &y);
        let mut deviations = Vec::new();
        for share in [0.9, 0.0] {
            let x = DVector::from_fn(features, |at, _| share * scan[at] + normal(0.6 * (1.0 - share)));
            let z = (seen(&x, &mut normal) - posterior.mean.tr_mul(&x)) / posterior.variance(&x).sqrt();
            let squared = z.norm_squared() / outputs as f64;
            assert!((0.9..=1.1).contains(&squared), "{share}: {squared}");
            deviations.push(posterior.variance(&x));
        }
        assert!(deviations[0] < 0.5 * deviations[1]);
    }
}
