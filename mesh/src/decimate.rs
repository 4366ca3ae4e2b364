//! The same surface with fewer faces, by meshoptimizer: edges are collapsed, those first that change it least.
//!
//! A vertex is moved onto a neighbour, never to a new place: every vertex that is left is one of the mesh's, with all that is known of it
//! (weights, colours, shapes). V' vertices are left.

use meshopt::SimplifyOptions;

use super::TriangleMesh;
use super::components::with_faces;

/// What is left of a mesh.
#[derive(Clone, Debug)]
pub struct Decimated {
    /// The surface, on some of the mesh's vertices in their order.
    pub mesh: TriangleMesh,
    /// Which those are (V').
    pub sources: Vec<u32>,
}

/// At most `faces` faces of a mesh, or as few as there can be on the same topology.
#[must_use]
pub fn decimated(mesh: &TriangleMesh, faces: usize) -> Decimated {
    let places: Vec<[f32; 3]> = mesh.vertices.iter().map(|vertex| vertex.to_array()).collect();
    let corners = mesh.faces.as_flattened();
    let error = f32::MAX;
    let left = meshopt::simplify_decoder(corners, &places, 3 * faces, error, SimplifyOptions::None, None);
    let (mesh, sources) = with_faces(mesh, left.as_chunks().0.to_vec());
    Decimated { mesh, sources }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{ClosestPoint, SurfaceIndex, Topology};

    /// A ball of radius 1 of so many rings.
    fn ball(rings: u32) -> TriangleMesh {
        let columns = 2 * rings;
        let mut vertices = vec![Vec3::Y];
        for ring in 1..rings {
            let polar = std::f32::consts::PI * ring as f32 / rings as f32;
            vertices.extend((0..columns).map(|column| {
                let azimuth = std::f32::consts::TAU * column as f32 / columns as f32;
                Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), polar.sin() * azimuth.cos())
            }));
        }
        vertices.push(-Vec3::Y);
        let last = vertices.len() as u32 - 1;
        let at = |ring: u32, column: u32| 1 + (ring - 1) * columns + column % columns;
        let mut faces = Vec::new();
        for column in 0..columns {
            faces.push([0, at(1, column), at(1, column + 1)]);
            faces.push([last, at(rings - 1, column + 1), at(rings - 1, column)]);
            for ring in 1..rings - 1 {
                faces.push([at(ring, column), at(ring + 1, column), at(ring + 1, column + 1)]);
                faces.push([at(ring, column), at(ring + 1, column + 1), at(ring, column + 1)]);
            }
        }
        TriangleMesh { vertices, faces, ..TriangleMesh::default() }
    }

    #[test]
    fn a_ball_stays_a_closed_ball() {
        let ball = ball(40);
        let few = decimated(&ball, 400).mesh;
        assert!(few.faces.len() <= 400 && few.faces.len() > 390, "{}", few.faces.len());
        assert!(Topology::of(&few).is_watertight(), "{:?}", Topology::of(&few));
        let index = SurfaceIndex::new(&few).unwrap();
        let distance = |closest: ClosestPoint| closest.distance;
        let farthest = index.closest_to_each(&ball.vertices).into_iter().map(distance).fold(0.0, f32::max);
        // 400 equal triangles on the ball: edges of 0.27, whose middles are 0.012 deep at the centre of a face. On its own vertices, it is three
        // times that.
        assert!(farthest < 0.036, "{farthest}");
        for [a, b, c] in &few.faces {
            let [a, b, c] = [a, b, c].map(|vertex| few.vertices[*vertex as usize]);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "a face is turned over");
        }
    }

    #[test]
    fn flat_places_go_first_and_borders_stay() {
        // A square of 10 x 10 cells with a ridge along its middle.
        let at = |x: u32, y: u32| 11 * y + x;
        let height = |x: u32| if x == 5 { 1.0 } else { 0.0 };
        let places = (0..11).flat_map(|y| (0..11).map(move |x| Vec3::new(x as f32, y as f32, height(x))));
        let cells = (0..10).flat_map(|y| (0..10).map(move |x| (x, y)));
        let faces = cells.flat_map(|(x, y)| {
            [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]]
        });
        let square = TriangleMesh { vertices: places.collect(), faces: faces.collect(), ..TriangleMesh::default() };
        let left = decimated(&square, 40);
        for corner in [at(0, 0), at(10, 0), at(0, 10), at(10, 10), at(5, 0), at(5, 10)] {
            assert!(left.sources.contains(&corner), "{corner} is gone: {:?}", left.sources);
        }
        assert!(left.mesh.faces.len() <= 40);
        let index = SurfaceIndex::new(&left.mesh).unwrap();
        let farthest = index.closest_to_each(&square.vertices).into_iter().map(|closest| closest.distance);
        assert!(farthest.fold(0.0, f32::max) < 1e-4);
    }

    #[test]
    fn as_many_faces_as_there_are_change_nothing() {
        let ball = ball(6);
        let same = decimated(&ball, ball.faces.len());
        assert_eq!(same.sources, (0..ball.vertices.len() as u32).collect::<Vec<_>>());
        assert_eq!((same.mesh.vertices, same.mesh.faces), (ball.vertices, ball.faces));
    }
}
