//! A smooth analytic skinning field for tests: w = softmax(-|x - c_j|^2 / r^2) around J centres c_j; and posed bones.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use xavatar_network::{Real, SkinningWeights};

use crate::BoneTransform;

pub(crate) struct SoftmaxField<T> {
    pub centres: Vec<[T; 3]>,
    pub radius: T,
}

impl<T: Real> SkinningWeights<T> for SoftmaxField<T> {
    type Workspace = ();

    fn joints(&self) -> usize {
        self.centres.len()
    }

    fn weights(&self, workspace: &mut (), points: &[[T; 3]], weights: &mut [T]) {
        let mut gradients = vec![T::zero(); 3 * weights.len()];
        self.weights_and_gradients(workspace, points, weights, &mut gradients);
    }

    fn weights_and_gradients(&self, _: &mut (), points: &[[T; 3]], weights: &mut [T], gradients: &mut [T]) {
        let joints = self.centres.len();
        let scale = T::one() / (self.radius * self.radius);
        let rows = weights.chunks_exact_mut(joints).zip(gradients.chunks_exact_mut(3 * joints));
        for (point, (weights, gradients)) in points.iter().zip(rows) {
            for (weight, centre) in weights.iter_mut().zip(&self.centres) {
                let squared: T = (0..3).map(|axis| (point[axis] - centre[axis]).powi(2)).sum();
                *weight = (-scale * squared).exp();
            }
            let total: T = weights.iter().copied().sum();
            weights.iter_mut().for_each(|weight| *weight /= total);
            for (axis, row) in gradients.chunks_exact_mut(joints).enumerate() {
                let pull = |centre: &[T; 3]| T::of(2.0) * scale * (centre[axis] - point[axis]);
                let mean: T = weights.iter().zip(&self.centres).map(|(&weight, centre)| weight * pull(centre)).sum();
                for ((slope, &weight), centre) in row.iter_mut().zip(weights.iter()).zip(&self.centres) {
                    *slope = weight * (pull(centre) - mean);
                }
            }
        }
    }
}

pub(crate) fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// `count` vectors, uniform in +-`extent`.
pub(crate) fn vectors<T: Real>(generator: &mut ChaCha8Rng, count: usize, extent: f64) -> Vec<[T; 3]> {
    (0..count).map(|_| std::array::from_fn(|_| T::of(generator.random_range(-extent..extent)))).collect()
}

/// `count` numbers, uniform in +-1.
pub(crate) fn numbers<T: Real>(generator: &mut ChaCha8Rng, count: usize) -> Vec<T> {
    (0..count).map(|_| T::of(generator.random_range(-1.0..1.0))).collect()
}

/// A field of `joints` bones within half a metre, and a pose: rotations by up to `angle` about the bones' centres.
pub(crate) fn posed<T: Real>(seed: u64, joints: usize, angle: f64) -> (SoftmaxField<T>, Vec<BoneTransform<T>>) {
    let mut generator = generator(seed);
    let centres: Vec<[T; 3]> = vectors(&mut generator, joints, 0.5);
    let bone = |centre: &[T; 3]| {
        let turn = glam::DVec3::from(vectors::<f64>(&mut generator, 1, angle)[0]);
        let turn = glam::DMat3::from_quat(glam::DQuat::from_scaled_axis(turn)).transpose();
        let rows = [turn.x_axis, turn.y_axis, turn.z_axis];
        let pivot = glam::DVec3::from(centre.map(|coordinate| coordinate.wide()));
        std::array::from_fn(|index| {
            let (r, c) = (index / 4, index % 4);
            T::of(if c < 3 { rows[r][c] } else { pivot[r] - rows[r].dot(pivot) })
        })
    };
    let bones = centres.iter().map(bone).collect();
    (SoftmaxField { centres, radius: T::of(0.4) }, bones)
}
