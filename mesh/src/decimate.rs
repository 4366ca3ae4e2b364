//! The same surface with fewer faces: edges are collapsed, those first that change it least (Garland and Heckbert 1997).
//!
//! The error of moving a vertex to a place is the squared distance to the planes of its faces, weighted by their areas:
//!
//! ```text
//! e(x) = sum_f A_f (n_f . x + d_f)^2 = x^T Q x + 2 b . x + c
//! ```
//!
//! A collapse moves a vertex onto a neighbour, never to a new place: every vertex that is left is one of the mesh's, with all that is known
//! of it (weights, colours, shapes). Collapses that would turn a face over or tear the surface are not made. V vertices, F faces.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::{DMat3, DVec3};

use super::TriangleMesh;
use super::components::with_faces;

/// A face that turns by more than this cosine, about 78 degrees, counts as turned over.
const LEAST_COSINE: f64 = 0.2;
/// What a border resists with, against the faces beside it.
const BORDER: f64 = 100.0;
/// Longer edges cost a little even where the surface is flat, so that faces stay compact; a share of the squared length times the area.
const COMPACT: f64 = 1e-3;

/// What is left of a mesh.
#[derive(Clone, Debug)]
pub struct Decimated {
    /// The surface, on some of the mesh's vertices in their order.
    pub mesh: TriangleMesh,
    /// Which those are (V').
    pub sources: Vec<u32>,
}

/// At most `faces` faces of a mesh, or as few as there can be without turning faces over.
#[must_use]
pub fn decimated(mesh: &TriangleMesh, faces: usize) -> Decimated {
    let mut surface = Collapsing::new(mesh);
    surface.run(faces);
    let (mesh, sources) = with_faces(mesh, surface.left());
    Decimated { mesh, sources }
}

/// x^T Q x + 2 b . x + c.
#[derive(Clone, Copy, Debug, Default)]
struct Quadric {
    matrix: DMat3,
    vector: DVec3,
    constant: f64,
}

impl Quadric {
    fn of_plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let distance = -normal.dot(point);
        let outer = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        Self { matrix: outer * weight, vector: normal * (distance * weight), constant: distance * distance * weight }
    }

    fn add(&mut self, other: &Self) {
        self.matrix += other.matrix;
        self.vector += other.vector;
        self.constant += other.constant;
    }

    fn error(&self, place: DVec3) -> f64 {
        place.dot(self.matrix * place) + 2.0 * self.vector.dot(place) + self.constant
    }
}

/// A vertex that could be moved onto a neighbour. The smallest cost is the greatest in a heap.
struct Candidate {
    cost: f64,
    from: u32,
    to: u32,
    /// Of both ends: an older candidate is out of date.
    versions: [u32; 2],
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then((other.from, other.to).cmp(&(self.from, self.to)))
    }
}

struct Collapsing {
    places: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    is_alive: Vec<bool>,
    alive: usize,
    /// The living faces of each vertex.
    around: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    /// Area of the faces that were around each vertex.
    areas: Vec<f64>,
    versions: Vec<u32>,
    heap: BinaryHeap<Candidate>,
}

impl Collapsing {
    fn new(mesh: &TriangleMesh) -> Self {
        let count = mesh.vertices.len();
        let mut collapsing = Self {
            places: mesh.vertices.iter().map(|vertex| vertex.as_dvec3()).collect(),
            faces: mesh.faces.clone(),
            is_alive: vec![true; mesh.faces.len()],
            alive: mesh.faces.len(),
            around: vec![Vec::new(); count],
            quadrics: vec![Quadric::default(); count],
            areas: vec![0.0; count],
            versions: vec![0; count],
            heap: BinaryHeap::new(),
        };
        for (index, face) in mesh.faces.iter().enumerate() {
            face.iter().for_each(|vertex| collapsing.around[*vertex as usize].push(index as u32));
        }
        for index in 0..mesh.faces.len() {
            collapsing.weigh(index);
        }
        for vertex in 0..count as u32 {
            collapsing.offer(vertex);
        }
        collapsing
    }

    /// Adds a face's plane to its vertices, and planes that hold its borders.
    fn weigh(&mut self, index: usize) {
        let face = self.faces[index];
        let [a, b, c] = face.map(|vertex| self.places[vertex as usize]);
        let cross = (b - a).cross(c - a);
        let Some(normal) = cross.try_normalize() else { return };
        let area = 0.5 * cross.length();
        let plane = Quadric::of_plane(normal, a, area);
        for vertex in face {
            self.quadrics[vertex as usize].add(&plane);
            self.areas[vertex as usize] += area;
        }
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (face[from], face[to])) {
            if self.shared(from, to) > 1 {
                continue;
            }
            let edge = self.places[to as usize] - self.places[from as usize];
            let Some(outward) = edge.cross(normal).try_normalize() else { continue };
            let border = Quadric::of_plane(outward, self.places[from as usize], BORDER * area);
            [from, to].iter().for_each(|vertex| self.quadrics[*vertex as usize].add(&border));
        }
    }

    /// How many faces have both vertices.
    fn shared(&self, a: u32, b: u32) -> usize {
        self.around[a as usize].iter().filter(|face| self.faces[**face as usize].contains(&b)).count()
    }

    /// The vertices that share a face with one, ascending.
    fn neighbours(&self, vertex: u32) -> Vec<u32> {
        let corners = self.around[vertex as usize].iter().flat_map(|face| self.faces[*face as usize]);
        let mut neighbours: Vec<u32> = corners.filter(|corner| *corner != vertex).collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        neighbours
    }

    /// Puts the cheapest way to move a vertex onto a neighbour on the heap.
    fn offer(&mut self, from: u32) {
        let cost = |to: u32| {
            let mut quadric = self.quadrics[from as usize];
            quadric.add(&self.quadrics[to as usize]);
            let length = self.places[from as usize].distance_squared(self.places[to as usize]);
            quadric.error(self.places[to as usize]).max(0.0) + COMPACT * length * self.areas[from as usize]
        };
        let costs = self.neighbours(from).into_iter().map(|to| (cost(to), to));
        let allowed = costs.filter(|(_, to)| self.can_collapse(from, *to));
        if let Some((cost, to)) = allowed.min_by(|a, b| a.0.total_cmp(&b.0)) {
            let versions = [self.versions[from as usize], self.versions[to as usize]];
            self.heap.push(Candidate { cost, from, to, versions });
        }
    }

    /// Whether the surface stays one (the ends share no neighbours but those across the edge's faces), and no face turns over.
    fn can_collapse(&self, from: u32, to: u32) -> bool {
        let (own, others) = (self.neighbours(from), self.neighbours(to));
        let common = own.iter().filter(|vertex| others.binary_search(vertex).is_ok()).count();
        // A border's vertex stays on the border; four vertices are the least that enclose anything.
        if common != self.shared(from, to)
            || (self.is_border(from) && self.shared(from, to) > 1)
            || own.len() + others.len() < 8
        {
            return false;
        }
        let staying = self.around[from as usize].iter().map(|face| self.faces[*face as usize]);
        staying.filter(|face| !face.contains(&to)).all(|face| {
            let normal = |place: &dyn Fn(u32) -> DVec3| {
                let [a, b, c] = face.map(place);
                (b - a).cross(c - a)
            };
            let before = normal(&|vertex| self.places[vertex as usize]);
            let after = normal(&|vertex| self.places[if vertex == from { to } else { vertex } as usize]);
            after.dot(before) > LEAST_COSINE * after.length() * before.length()
        })
    }

    fn is_border(&self, vertex: u32) -> bool {
        self.neighbours(vertex).into_iter().any(|neighbour| self.shared(vertex, neighbour) == 1)
    }

    fn run(&mut self, faces: usize) {
        while self.alive > faces {
            let Some(Candidate { from, to, versions, .. }) = self.heap.pop() else { return };
            if self.around[from as usize].is_empty() || versions[0] != self.versions[from as usize] {
                continue;
            }
            // What was cheapest may have changed meanwhile.
            if versions[1] != self.versions[to as usize] || !self.can_collapse(from, to) {
                self.versions[from as usize] += 1;
                self.offer(from);
                continue;
            }
            self.collapse(from, to);
        }
    }

    fn collapse(&mut self, from: u32, to: u32) {
        for face in std::mem::take(&mut self.around[from as usize]) {
            let corners = self.faces[face as usize];
            if corners.contains(&to) {
                self.is_alive[face as usize] = false;
                self.alive -= 1;
                for corner in corners.into_iter().filter(|corner| *corner != from) {
                    self.around[corner as usize].retain(|other| *other != face);
                }
            } else {
                self.faces[face as usize] = corners.map(|corner| if corner == from { to } else { corner });
                self.around[to as usize].push(face);
            }
        }
        let moved = self.quadrics[from as usize];
        self.quadrics[to as usize].add(&moved);
        self.areas[to as usize] += self.areas[from as usize];
        let changed = self.neighbours(to);
        for vertex in changed.into_iter().chain([to]) {
            self.versions[vertex as usize] += 1;
            self.offer(vertex);
        }
    }

    fn left(self) -> Vec<[u32; 3]> {
        self.faces.into_iter().zip(self.is_alive).filter_map(|(face, is_alive)| is_alive.then_some(face)).collect()
    }
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
        // 400 equal triangles on the ball: edges of 0.27, whose middles are 0.012 deep at the centre of a face.
        assert!(farthest < 0.03, "{farthest}");
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
