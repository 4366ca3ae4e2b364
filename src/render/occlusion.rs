//! Ambient occlusion: how open the surface is to the light of an even sky, o(x) = sum_d (n.d)+ v(x, d) / sum_d (n.d)+.
//!
//! v says whether a vertex is seen from direction d, by a depth image from there: 64 directions over the whole sphere, so about
//! half of them count at a vertex. It does not depend on the camera, so a turntable pays once. V vertices; metres.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::rgbd::render_depth;
use crate::Result;
use crate::camera::PinholeCamera;
use crate::mesh::TriangleMesh;

/// Directions that light comes from.
const DIRECTIONS: usize = 64;
/// Side of a depth image, pixels: a body scan's are 4 to 5 mm large.
const SIDE: u32 = 448;
/// Distance of the cameras, in radii of the mesh: rays are within 3 degrees of parallel.
const DISTANCE: f32 = 20.0;
/// How far from its vertex, along the normal, the light is asked for, in pixels of the depth images.
const LIFT: f32 = 1.5;
/// How much deeper than the image a point may lie and still be seen, in pixels of the depth images.
const SLACK: f32 = 1.0;
/// Times that a vertex takes the mean with its neighbours: what is left of the images' pixels goes.
const SMOOTHINGS: usize = 2;

/// A depth image, and what it is of.
struct Shadow {
    camera: PinholeCamera,
    depth: Vec<f32>,
}

/// The openness of each vertex (V), from 0 (in a crease) to 1 (on a convex body); 1 for an empty mesh's none.
pub(super) fn openness(mesh: &TriangleMesh, normals: &[Vec3]) -> Result<Vec<f32>> {
    let low = mesh.vertices.iter().copied().fold(Vec3::MAX, Vec3::min);
    let high = mesh.vertices.iter().copied().fold(Vec3::MIN, Vec3::max);
    let (centre, radius) = ((low + high) / 2.0, low.distance(high) / 2.0);
    // Bodies without an extent have no creases.
    if !(radius.is_finite() && radius > 1e-3) {
        return Ok(vec![1.0; mesh.vertices.len()]);
    }
    let pixel = 2.0 * radius / SIDE as f32;
    let mut sums = vec![Vec2::ZERO; mesh.vertices.len()];
    for index in 0..DIRECTIONS {
        let direction = direction(index);
        let opening = 2.0 * (1.02 / DISTANCE).asin();
        let position = centre + direction * radius * DISTANCE;
        let camera = PinholeCamera::looking_at(position, centre, opening, [SIDE, SIDE])?;
        let shadow = Shadow { camera, depth: render_depth(mesh, &camera)? };
        sums.par_iter_mut().zip(mesh.vertices.par_iter().zip(normals)).for_each(|(sum, (vertex, normal))| {
            let share = normal.dot(direction);
            if share > 0.0 {
                *sum += share * Vec2::new(shadow.lit_share(*vertex + *normal * LIFT * pixel, SLACK * pixel), 1.0);
            }
        });
    }
    let mut openness: Vec<f32> = sums.iter().map(|sum| if sum.y > 0.0 { sum.x / sum.y } else { 1.0 }).collect();
    for _ in 0..SMOOTHINGS {
        openness = smoothed(mesh, &openness);
    }
    Ok(openness)
}

/// Evenly spread over the sphere (a Fibonacci lattice).
fn direction(index: usize) -> Vec3 {
    /// Radians.
    const GOLDEN_ANGLE: f32 = 2.399_963;
    let height = 1.0 - (2 * index + 1) as f32 / DIRECTIONS as f32;
    let (sin, cos) = (index as f32 * GOLDEN_ANGLE).sin_cos();
    let radius = (1.0 - height * height).sqrt();
    Vec3::new(radius * cos, height, radius * sin)
}

impl Shadow {
    /// The share of the light, 0 to 1, that reaches a point: bilinear over four pixels, each lit or not.
    fn lit_share(&self, point: Vec3, slack: f32) -> f32 {
        let (place, depth) = self.camera.project(point);
        // Depths are those of pixels' centres.
        let place = place - 0.5;
        let first = place.floor();
        let part = place - first;
        let lit = |x: f32, y: f32| {
            let inside = (0.0..SIDE as f32).contains(&x) && (0.0..SIDE as f32).contains(&y);
            let seen = if inside { self.depth[y as usize * SIDE as usize + x as usize] } else { f32::INFINITY };
            f32::from(u8::from(depth <= seen + slack))
        };
        let row = |y: f32| lit(first.x, y) * (1.0 - part.x) + lit(first.x + 1.0, y) * part.x;
        row(first.y) * (1.0 - part.y) + row(first.y + 1.0) * part.y
    }
}

/// Each vertex's mean with the means of its faces.
fn smoothed(mesh: &TriangleMesh, values: &[f32]) -> Vec<f32> {
    let mut sums: Vec<Vec2> = values.iter().map(|value| Vec2::new(*value, 1.0)).collect();
    for face in &mesh.faces {
        let mean = face.iter().map(|&vertex| values[vertex as usize]).sum::<f32>() / 3.0;
        face.iter().for_each(|&vertex| sums[vertex as usize] += Vec2::new(mean, 1.0));
    }
    sums.iter().map(|sum| sum.x / sum.y).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::testing::bumpy_sphere;

    #[test]
    fn a_convex_body_is_open_and_a_slot_is_not() {
        let ball = bumpy_sphere(40);
        let mut mesh = ball.clone();
        let count = ball.vertices.len();
        let alone = openness(&ball, &ball.vertex_normals()).unwrap();
        // A second ball close to the first: where they face each other both are dark.
        mesh.vertices.extend(ball.vertices.iter().map(|vertex| *vertex + Vec3::X * 2.1));
        mesh.faces.extend(ball.faces.iter().map(|face| face.map(|vertex| vertex + count as u32)));
        let both = openness(&mesh, &mesh.vertex_normals()).unwrap();
        let between = (0..count).max_by(|a, b| ball.vertices[*a].x.total_cmp(&ball.vertices[*b].x)).unwrap();
        let far = (0..count).min_by(|a, b| ball.vertices[*a].x.total_cmp(&ball.vertices[*b].x)).unwrap();
        assert!(both[between] < 0.5, "{}", both[between]);
        assert!(both[far] > 0.8 && (both[far] - alone[far]).abs() < 0.1, "{} {}", both[far], alone[far]);
        let mean: f32 = alone.iter().sum::<f32>() / count as f32;
        assert!(mean > 0.85, "{mean}");
    }

    #[test]
    fn meshes_without_extent_are_open() {
        let mesh = TriangleMesh { vertices: vec![Vec3::ONE; 3], faces: vec![[0, 1, 2]], ..TriangleMesh::default() };
        assert_eq!(openness(&mesh, &[Vec3::Z; 3]).unwrap(), [1.0; 3]);
        assert_eq!(openness(&TriangleMesh::default(), &[]).unwrap(), Vec::<f32>::new());
    }
}
