//! Ground under a scan's feet, as a capture brings it along.

use glam::Vec3;
use xavatar::mesh::{Colouring, TriangleMesh};

/// Squares along a side.
const SQUARES: u32 = 40;

/// Adds a level square of ground, 2.4 m wide, under a scan whose unit is `metre`-th of a metre.
pub fn add_ground(scan: &mut TriangleMesh, metre: f32) {
    let low = scan.vertices.iter().copied().reduce(Vec3::min).unwrap();
    let middle = scan.vertices.iter().sum::<Vec3>() / scan.vertices.len() as f32;
    let first = scan.vertices.len() as u32;
    let corners = (SQUARES + 1) * (SQUARES + 1);
    let place = |index: u32| {
        let side = |at: u32| 2.4 * metre * (at as f32 / SQUARES as f32 - 0.5);
        Vec3::new(middle.x + side(index / (SQUARES + 1)), low.y, middle.z + side(index % (SQUARES + 1)))
    };
    scan.vertices.extend((0..corners).map(place));
    let squares = (0..SQUARES * SQUARES).flat_map(|index| {
        let at = first + index / SQUARES * (SQUARES + 1) + index % SQUARES;
        let next = at + SQUARES + 1;
        [[at, at + 1, next], [at + 1, next + 1, next]]
    });
    scan.faces.extend(squares);
    if let Some(normals) = &mut scan.normals {
        normals.resize(scan.vertices.len(), Vec3::Y);
    }
    if let Colouring::Vertex(colours) = &mut scan.colouring {
        colours.resize(scan.vertices.len(), [90; 3]);
    }
}
