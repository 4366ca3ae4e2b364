//! Ambient occlusion: how open a place is to the light of an even sky, o(x) = sum_d (n.d)+ v(x, d) / sum_d (n.d)+.
//!
//! v says whether a place is seen from direction d, by a depth image from there: 64 directions over the whole sphere, so about
//! half of them count at a place. It does not depend on the camera, so a turntable pays once. V vertices; metres.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::rgbd::render_depth;
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;
use xavatar_mesh::camera::PinholeCamera;

/// Directions that light comes from.
const DIRECTIONS: usize = 64;
/// Side of a depth image, pixels: a body scan's are 4 to 5 mm large.
const SIDE: u32 = 448;
/// Distance of the cameras, in radii of the mesh: rays are within 3 degrees of parallel.
const DISTANCE: f32 = 20.0;
/// How far from its place, along the normal, the light is asked for, in pixels of the depth images.
const LIFT: f32 = 1.5;
/// How much deeper than the image a place may lie and still be seen, in pixels of the depth images.
const SLACK: f32 = 1.0;
/// Times that a vertex takes the mean with its neighbours: what is left of the images' pixels goes.
const SMOOTHINGS: usize = 2;

/// A mesh's shadows, as the depth images of all directions.
pub(super) struct Sky {
    shadows: Vec<Shadow>,
    /// Side of the depth images' pixels, metres.
    pixel: f32,
}

/// What a direction sees.
struct Shadow {
    direction: Vec3,
    camera: PinholeCamera,
    depth: Vec<f32>,
}

impl Sky {
    /// Draws the depth images; none of a mesh without an extent, which casts no shadow.
    pub fn over(mesh: &TriangleMesh) -> Result<Self> {
        let low = mesh.vertices.iter().copied().fold(Vec3::MAX, Vec3::min);
        let high = mesh.vertices.iter().copied().fold(Vec3::MIN, Vec3::max);
        let (centre, radius) = ((low + high) / 2.0, low.distance(high) / 2.0);
        if !(radius.is_finite() && radius > 1e-3) {
            return Ok(Self { shadows: Vec::new(), pixel: 0.0 });
        }
        let shadow = |index| {
            let direction = direction(index);
            let opening = 2.0 * (1.02 / DISTANCE).asin();
            let position = centre + direction * radius * DISTANCE;
            let camera = PinholeCamera::looking_at(position, centre, opening, [SIDE, SIDE])?;
            Ok(Shadow { direction, camera, depth: render_depth(mesh, &camera)? })
        };
        let shadows = (0..DIRECTIONS).map(shadow).collect::<Result<_>>()?;
        Ok(Self { shadows, pixel: 2.0 * radius / SIDE as f32 })
    }

    /// The openness of places with unit normals, from 0 (in a crease) to 1 (nothing near).
    pub fn openness(&self, places: &[Vec3], normals: &[Vec3]) -> Vec<f32> {
        let lift = LIFT * self.pixel;
        let openness = |(place, normal): (&Vec3, &Vec3)| {
            let (mut seen, mut all) = (0.0, 0.0);
            for shadow in &self.shadows {
                let share = normal.dot(shadow.direction);
                if share > 0.0 {
                    all += share;
                    seen += share * shadow.lit_share(*place + *normal * lift, SLACK * self.pixel);
                }
            }
            if all > 0.0 { seen / all } else { 1.0 }
        };
        places.par_iter().zip(normals).map(openness).collect()
    }

    /// The openness of each vertex (V), without the depth images' pixels.
    pub fn of_vertices(&self, mesh: &TriangleMesh, normals: &[Vec3]) -> Vec<f32> {
        let rough = self.openness(&mesh.vertices, normals);
        (0..SMOOTHINGS).fold(rough, |values, _| smoothed(mesh, &values))
    }
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
    /// The share of the light, 0 to 1, that reaches a place: bilinear over four pixels, each lit or not.
    fn lit_share(&self, place: Vec3, slack: f32) -> f32 {
        let (place, depth) = self.camera.project(place);
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
    use xavatar_mesh::{ExtractionGrid, Sign, extract};

    fn unit_ball() -> TriangleMesh {
        let (minimum, maximum) = (Vec3::splat(-1.2), Vec3::splat(1.2));
        let grid = ExtractionGrid { minimum, maximum, resolution: 40, level: 0.0, inside_is: Sign::Negative };
        let distance =
            |points: &[Vec3], values: &mut [f32]| points.iter().zip(values).for_each(|(p, v)| *v = p.length() - 1.0);
        extract(&distance, grid).unwrap().mesh
    }

    fn openness(mesh: &TriangleMesh) -> Vec<f32> {
        Sky::over(mesh).unwrap().of_vertices(mesh, &mesh.vertex_normals())
    }

    #[test]
    fn a_convex_body_is_open_and_a_slot_is_not() {
        let ball = unit_ball();
        let mut mesh = ball.clone();
        let count = ball.vertices.len();
        let alone = openness(&ball);
        // A second ball close to the first: where they face each other both are dark.
        mesh.vertices.extend(ball.vertices.iter().map(|vertex| *vertex + Vec3::X * 2.05));
        mesh.faces.extend(ball.faces.iter().map(|face| face.map(|vertex| vertex + count as u32)));
        let both = openness(&mesh);
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
        assert_eq!(openness(&mesh), [1.0; 3]);
        assert_eq!(openness(&TriangleMesh::default()), Vec::<f32>::new());
    }
}
