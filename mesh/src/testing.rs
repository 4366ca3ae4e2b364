//! Shapes and points that the tests of several files here share.

use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{ExtractionGrid, Sign, SurfacePoint, TriangleMesh, extract};

/// Radius of the bumpy sphere in the direction of a point.
pub(super) fn bumpy_radius(point: Vec3) -> f32 {
    let direction = point.normalize_or_zero();
    1.0 + 0.15 * (4.0 * direction.x).sin() * (3.0 * direction.y + 1.0).cos()
}

/// A closed star-shaped surface of about 3 `resolution`^2 faces.
pub(super) fn bumpy_sphere(resolution: usize) -> TriangleMesh {
    let grid = ExtractionGrid {
        minimum: Vec3::splat(-1.3),
        maximum: Vec3::splat(1.3),
        resolution,
        level: 0.0,
        inside_is: Sign::Negative,
    };
    let field = |points: &[Vec3], values: &mut [f32]| {
        points.iter().zip(values).for_each(|(p, v)| *v = p.length() - bumpy_radius(*p))
    };
    extract(&field, grid).unwrap().mesh
}

/// Points in the cube from -`half` to `half`.
pub(super) fn random_points(count: usize, half: f32, seed: u64) -> Vec<Vec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| Vec3::from(std::array::from_fn(|_| rng.random_range(-half..half)))).collect()
}

/// The colour at the centre of a face, in bytes.
pub(super) fn face_colour(mesh: &TriangleMesh, face: u32) -> [u8; 3] {
    let centre = SurfacePoint { face, barycentric: [1.0 / 3.0; 3] };
    mesh.colour_at(&centre).unwrap().to_array().map(|channel| (channel * 255.0).round() as u8)
}
