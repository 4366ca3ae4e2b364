//! A shape that the tests of several files here share.

use glam::Vec3;
use xavatar_mesh::{ExtractionGrid, Sign, TriangleMesh, extract};

/// A ball of one metre's radius, of about 3 `resolution`^2 faces.
pub(super) fn ball(resolution: usize) -> TriangleMesh {
    let grid = ExtractionGrid {
        minimum: Vec3::splat(-1.3),
        maximum: Vec3::splat(1.3),
        resolution,
        level: 0.0,
        inside_is: Sign::Negative,
    };
    let field = |points: &[Vec3], values: &mut [f32]| {
        points.iter().zip(values).for_each(|(point, value)| *value = point.length() - 1.0);
    };
    extract(&field, grid).unwrap().mesh
}
