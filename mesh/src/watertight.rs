//! Whether a mesh encloses a volume, and which: merging of seams, edges, components, volume.
//!
//! Scans repeat vertices along the seams of their texture; merge those by position first, or every seam is a hole.

use std::collections::HashMap;

use glam::Vec3;

use super::components::face_components;
use super::{Colouring, TriangleMesh};

/// How the faces of a mesh hang together, counted by vertex index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Vertices used by a face.
    pub vertices: usize,
    /// Undirected edges.
    pub edges: usize,
    /// Faces.
    pub faces: usize,
    /// Edges of one face: the rims of holes.
    pub open_edges: usize,
    /// Edges of more than two faces, or of two that run along them the same way (one of them is inside out).
    pub irregular_edges: usize,
    /// Parts connected through vertices.
    pub components: usize,
}

impl Topology {
    /// Counts a mesh, which [`TriangleMesh::check`] accepts.
    #[must_use]
    pub fn of(mesh: &TriangleMesh) -> Self {
        // Both directions of an edge stand next to each other once sorted.
        let mut directed: Vec<(u32, u32, bool)> = mesh
            .faces
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(from, to)| (from.min(to), from.max(to), from < to))
            .collect();
        directed.sort_unstable();
        let (mut edges, mut open_edges, mut irregular_edges) = (0, 0, 0);
        for edge in directed.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            edges += 1;
            match edge {
                [_] => open_edges += 1,
                [(.., false), (.., true)] => {}
                _ => irregular_edges += 1,
            }
        }
        let mut used = vec![false; mesh.vertices.len()];
        mesh.faces.iter().flatten().for_each(|&v| used[v as usize] = true);
        Self {
            vertices: used.into_iter().filter(|&used| used).count(),
            edges,
            faces: mesh.faces.len(),
            open_edges,
            irregular_edges,
            components: face_components(mesh).count,
        }
    }

    /// Whether every edge has two faces that agree on which side is outside.
    #[must_use]
    pub fn is_watertight(&self) -> bool {
        self.faces > 0 && self.open_edges == 0 && self.irregular_edges == 0
    }

    /// V - E + F: 2 for a sphere, 0 for a torus; the sum over components.
    #[must_use]
    pub fn euler_characteristic(&self) -> isize {
        self.vertices as isize - self.edges as isize + self.faces as isize
    }

    /// The handles of all components together, their genus: 0 for spheres, 1 for a torus. None for a surface that is not watertight, or
    /// that touches itself in a vertex.
    #[must_use]
    pub fn handles(&self) -> Option<usize> {
        let doubled = 2 * self.components as isize - self.euler_characteristic();
        (self.is_watertight() && doubled % 2 == 0).then(|| usize::try_from(doubled / 2).ok()).flatten()
    }
}

impl TriangleMesh {
    /// The same surface with one vertex a position (bit for bit; -0 is 0), without normals and colours.
    ///
    /// Vertices keep the order of their first appearance; faces keep theirs, also those that have lost their area.
    #[must_use]
    pub fn merged_by_position(&self) -> Self {
        let (merged, count) = self.merged_indices();
        let mut vertices = Vec::with_capacity(count);
        for (&place, &vertex) in merged.iter().zip(&self.vertices) {
            if place as usize == vertices.len() {
                vertices.push(vertex);
            }
        }
        let faces = self.faces.iter().map(|face| face.map(|v| merged[v as usize])).collect();
        Self { vertices, faces, normals: None, colouring: Colouring::None }
    }

    /// The number of each vertex (V) if there were one a position, in order of first appearance; and how many there are.
    pub(super) fn merged_indices(&self) -> (Vec<u32>, usize) {
        let mut places = HashMap::with_capacity(self.vertices.len());
        let place_of = |vertex: &Vec3| {
            let next = places.len() as u32;
            *places.entry((*vertex + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(next)
        };
        let merged = self.vertices.iter().map(place_of).collect();
        (merged, places.len())
    }

    /// The enclosed volume, cubic metres; negative if inside out, meaningless if open.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let six_times = |face: u32| {
            let [a, b, c] = self.corners(face).map(|v| v.as_dvec3());
            a.dot(b.cross(c))
        };
        (0..self.faces.len() as u32).map(six_times).sum::<f64>() / 6.0
    }

    /// The area of all faces, square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        (0..self.faces.len() as u32).map(|face| self.face_area(face)).sum()
    }

    /// The area of one face, square metres.
    #[must_use]
    pub fn face_area(&self, face: u32) -> f64 {
        let [a, b, c] = self.corners(face).map(|v| v.as_dvec3());
        (b - a).cross(c - a).length() / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            ..TriangleMesh::default()
        }
    }

    /// Every face with vertices of its own, as if each had its own seam.
    fn torn(mesh: &TriangleMesh) -> TriangleMesh {
        let vertices: Vec<Vec3> = (0..mesh.faces.len() as u32).flat_map(|f| mesh.corners(f)).collect();
        let faces = (0..mesh.faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        TriangleMesh { vertices, faces, ..TriangleMesh::default() }
    }

    #[test]
    fn seams_are_holes_until_merged() {
        let torn = torn(&tetrahedron());
        let before = Topology::of(&torn);
        assert_eq!((before.components, before.open_edges), (4, 12));
        assert!(!before.is_watertight());
        assert_eq!(before.handles(), None);
        let merged = Topology::of(&torn.merged_by_position());
        assert!(merged.is_watertight());
        assert_eq!((merged.components, merged.vertices, merged.euler_characteristic()), (1, 4, 2));
        assert_eq!(merged.handles(), Some(0));
    }

    #[test]
    fn negative_zero_is_the_same_place() {
        let mut mesh = torn(&tetrahedron());
        mesh.vertices.iter_mut().step_by(2).for_each(|v| *v = v.map(|x| if x == 0.0 { -0.0 } else { x }));
        assert_eq!(mesh.merged_by_position().vertices.len(), 4);
    }

    #[test]
    fn a_flipped_face_is_irregular_and_a_missing_one_open() {
        let mut flipped = tetrahedron();
        flipped.faces[2].swap(0, 1);
        assert_eq!(Topology::of(&flipped).irregular_edges, 3);
        let mut open = tetrahedron();
        open.faces.pop();
        assert_eq!(Topology::of(&open).open_edges, 3);
    }

    #[test]
    fn volume_and_area_of_a_tetrahedron_wherever_it_stands() {
        let mut mesh = tetrahedron();
        mesh.vertices.iter_mut().for_each(|v| *v += Vec3::new(3.0, -2.0, 1.0));
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
        assert!((mesh.area() - (1.5 + 0.75f64.sqrt())).abs() < 1e-12);
        mesh.faces.iter_mut().for_each(|face| face.swap(0, 1));
        assert!((mesh.volume() + 1.0 / 6.0).abs() < 1e-12);
    }
}
