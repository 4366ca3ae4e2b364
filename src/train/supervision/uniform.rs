//! Points drawn uniformly in a cube around the body (thesis ch. 4.2.4): what keeps far space empty.

use glam::Vec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// How many a frame gets.
pub(super) const UNIFORM_POINTS: usize = 200;
/// Half the cube's edge, metres.
const HALF_EDGE: f32 = 1.8;

/// Draws [`UNIFORM_POINTS`].
pub(super) fn uniform_points(random: &mut ChaCha8Rng) -> impl Iterator<Item = Vec3> {
    (0..UNIFORM_POINTS).map(|_| Vec3::from_array(std::array::from_fn(|_| random.random_range(-HALF_EDGE..HALF_EDGE))))
}
