//! What a triangle mesh's connectivity gives: neighbours, and a subdivision that halves long edges.

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;

/// The vertices that share an edge with each vertex (V), ascending.
pub(super) fn neighbours(vertices: usize, faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); vertices];
    for face in faces {
        for corner in 0..3 {
            neighbours[face[corner] as usize].extend([face[(corner + 1) % 3], face[(corner + 2) % 3]]);
        }
    }
    for around in &mut neighbours {
        around.sort_unstable();
        around.dedup();
    }
    neighbours
}

/// A mesh whose long edges were halved. Vertices of the mesh come first; each further one is the middle of two before it.
pub(super) struct Subdivision {
    pub(super) faces: Vec<[u32; 3]>,
    original: usize,
    halves: Vec<[u32; 2]>,
}

impl Subdivision {
    /// Halves edges that `too_long` says are, round by round; neighbours agree on each edge, so closed stays closed.
    ///
    /// `positions` becomes that of all vertices; `onto_surface` places the middle of an edge.
    pub(super) fn of(
        faces: &[[u32; 3]],
        positions: &mut Vec<Vec3>,
        too_long: impl Fn(Vec3, Vec3) -> bool,
        onto_surface: impl Fn(Vec3) -> Vec3 + Sync,
    ) -> Self {
        const ROUNDS: usize = 4;
        let mut subdivision = Self { faces: faces.to_vec(), original: positions.len(), halves: Vec::new() };
        for _ in 0..ROUNDS {
            let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
            let mut refined = Vec::with_capacity(subdivision.faces.len() * 2);
            let vertices = positions.len();
            for face in &subdivision.faces {
                let middle = [0, 1, 2].map(|corner| {
                    let (a, b) = (face[corner], face[(corner + 1) % 3]);
                    let ends = [a.min(b), a.max(b)];
                    let [start, end] = ends.map(|vertex| positions[vertex as usize]);
                    too_long(start, end).then(|| {
                        let next = (vertices + middles.len()) as u32;
                        *middles.entry(ends).or_insert_with(|| {
                            subdivision.halves.push(ends);
                            next
                        })
                    })
                });
                refined.extend(split(*face, middle));
            }
            subdivision.faces = refined;
            if middles.is_empty() {
                break;
            }
            let halves = &subdivision.halves[vertices - subdivision.original..];
            let middle_of = |[a, b]: &[u32; 2]| onto_surface((positions[*a as usize] + positions[*b as usize]) / 2.0);
            let placed: Vec<Vec3> = halves.par_iter().map(middle_of).collect();
            positions.extend(placed);
        }
        subdivision
    }

    /// What the mesh's vertices have, for all vertices: halfway between on each halved edge.
    pub(super) fn spread<T: Clone>(&self, values: &[T], middle: impl Fn(&T, &T) -> T) -> Vec<T> {
        let mut spread = values[..self.original].to_vec();
        spread.reserve(self.halves.len());
        for [a, b] in &self.halves {
            spread.push(middle(&spread[*a as usize], &spread[*b as usize]));
        }
        spread
    }
}

/// The triangles of a face whose edges (from corner i to i + 1) are halved where there is a middle.
fn split([a, b, c]: [u32; 3], middles: [Option<u32>; 3]) -> Vec<[u32; 3]> {
    match middles {
        [None, None, None] => vec![[a, b, c]],
        [Some(ab), None, None] => vec![[a, ab, c], [ab, b, c]],
        [Some(ab), Some(bc), None] => vec![[ab, b, bc], [a, ab, bc], [a, bc, c]],
        [Some(ab), Some(bc), Some(ca)] => vec![[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]],
        // The remaining cases are those above with the corners turned by one.
        [ab, bc, ca] => split([b, c, a], [bc, ca, ab]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Topology, TriangleMesh};

    /// An octahedron, one of whose corners is far away.
    fn spike() -> TriangleMesh {
        let vertices = vec![Vec3::X * 4.0, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        TriangleMesh { vertices, faces, ..TriangleMesh::default() }
    }

    #[test]
    fn subdivision_leaves_short_edges_alone_and_closed_meshes_closed() {
        let mesh = spike();
        let volume = mesh.volume();
        for limit in [0.3, 0.8, 1.5, 3.0, 9.0] {
            let mut vertices = mesh.vertices.clone();
            let too_long = |start: Vec3, end: Vec3| start.distance(end) > limit;
            let subdivision = Subdivision::of(&mesh.faces, &mut vertices, too_long, |point| point);
            let spread = subdivision.spread(&mesh.vertices, |a, b| (a + b) / 2.0);
            assert_eq!(spread, vertices);
            let fine = TriangleMesh { vertices, faces: subdivision.faces, ..TriangleMesh::default() };
            assert!(Topology::of(&fine).is_watertight());
            assert_eq!(Topology::of(&fine).euler_characteristic(), 2);
            assert!((fine.volume() - volume).abs() < 1e-5);
            assert_eq!(fine.faces.len() > mesh.faces.len(), limit < 4.0);
            let edges = fine.faces.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
            let longest = edges.map(|ends| ends.map(|v| fine.vertices[*v as usize])).map(|[a, b]| a.distance(b));
            assert!(longest.fold(0.0, f32::max) <= limit.max(0.32));
        }
    }

    #[test]
    fn neighbours_are_mutual() {
        let neighbours = neighbours(6, &spike().faces);
        assert_eq!(neighbours[0], [2, 3, 4, 5]);
        for (vertex, around) in neighbours.iter().enumerate() {
            assert!(around.iter().all(|other| neighbours[*other as usize].contains(&(vertex as u32))));
        }
    }
}
