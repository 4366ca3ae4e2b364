//! Spirals of a mesh's vertices: the vertex, its first ring, its second, each counter-clockwise seen from outside (METHOD-BODY section 10).
//!
//! Ring 1 begins with the neighbour that is closest on the reference mesh (of two as close, the one with the smaller number); ring d + 1 goes along ring d
//! and takes each vertex's neighbours that were not seen, counter-clockwise after the one by which it was reached. At a border, where the neighbours of
//! a vertex are a fan and not a ring, the fan is taken as a ring. V vertices.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

/// The spirals of every vertex of a mesh (V), each with its own length.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spirals {
    /// The vertex, ring 1, ring 2 and on.
    pub rows: Vec<Vec<usize>>,
}

impl Spirals {
    /// The spirals of so many rings.
    pub fn new(points: &[DVec3], faces: &[[u32; 3]], rings: usize) -> Self {
        let neighbours = neighbours(faces, points.len());
        let rows = (0..points.len()).map(|vertex| spiral(points, &neighbours, vertex, rings)).collect();
        Self { rows }
    }

    /// A length that few spirals exceed: mean + 2 deviations of all lengths, rounded down.
    pub fn usual_length(&self) -> usize {
        let count = self.rows.len().max(1) as f64;
        let mean = self.rows.iter().map(|row| row.len() as f64).sum::<f64>() / count;
        let variance = self.rows.iter().map(|row| (row.len() as f64 - mean).powi(2)).sum::<f64>() / count;
        (mean + 2.0 * variance.sqrt()).floor() as usize
    }

    /// The spirals with this length (V, L), cut or filled up with V, the number of no vertex.
    pub fn of_length(&self, length: usize) -> Vec<u32> {
        let none = self.rows.len();
        let filled = |row: &Vec<usize>| -> Vec<u32> {
            row.iter().copied().chain(std::iter::repeat(none)).take(length).map(|vertex| vertex as u32).collect()
        };
        self.rows.iter().flat_map(filled).collect()
    }
}

fn spiral(points: &[DVec3], neighbours: &[Vec<usize>], vertex: usize, rings: usize) -> Vec<usize> {
    let ring = &neighbours[vertex];
    let distance = |place: &usize| points[ring[*place]].distance_squared(points[vertex]);
    let first = (0..ring.len())
        .min_by(|one, other| distance(one).total_cmp(&distance(other)).then(ring[*one].cmp(&ring[*other])));
    let mut spiral = vec![vertex];
    spiral.extend(after(ring, first));
    let mut seen: HashSet<usize> = spiral.iter().copied().collect();
    // Each with the neighbour by which it was reached.
    let mut layer: Vec<(usize, usize)> = spiral[1..].iter().map(|of_ring| (*of_ring, vertex)).collect();
    for _ in 1..rings {
        let mut next = Vec::new();
        for (of_ring, by) in layer {
            let ring = &neighbours[of_ring];
            let reached = ring.iter().position(|neighbour| *neighbour == by).map(|place| place + 1);
            for neighbour in after(ring, reached) {
                if seen.insert(neighbour) {
                    next.push((neighbour, of_ring));
                }
            }
        }
        spiral.extend(next.iter().map(|(of_ring, _)| *of_ring));
        layer = next;
    }
    spiral
}

/// A ring from one of its places on.
fn after(ring: &[usize], first: Option<usize>) -> impl Iterator<Item = usize> {
    let first = first.unwrap_or(0).min(ring.len());
    ring[first..].iter().chain(&ring[..first]).copied()
}

/// The neighbours of every vertex (V), counter-clockwise; of one where several sheets meet, those of one sheet.
fn neighbours(faces: &[[u32; 3]], vertices: usize) -> Vec<Vec<usize>> {
    let mut followers: Vec<HashMap<usize, usize>> = vec![HashMap::new(); vertices];
    for face in faces {
        let [a, b, c] = face.map(|corner| corner as usize);
        for (around, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            followers[around].insert(from, to);
        }
    }
    followers.iter().map(ring).collect()
}

fn ring(followers: &HashMap<usize, usize>) -> Vec<usize> {
    let followed: HashSet<usize> = followers.values().copied().collect();
    let starts = followers.keys().filter(|start| !followed.contains(*start)).min();
    let Some(first) = starts.or_else(|| followers.keys().min()) else { return Vec::new() };
    let next = |current: &usize| followers.get(current).copied().filter(|next| next != first);
    // Where sheets meet, a walk may not come back to where it began.
    std::iter::successors(Some(*first), next).take(followers.len() + 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{faces, indices, reference, vectors};

    fn as_numbers(values: &[f64]) -> Vec<u32> {
        indices(values).into_iter().map(|index| index as u32).collect()
    }

    #[test]
    fn spirals_are_the_references() {
        let golden = reference("spiral_convolution");
        for (prefix, rings, length, name) in
            [("", 1, 7, "spirals_1"), ("", 2, 17, "spirals_2"), ("open_", 2, 17, "open_spirals_2")]
        {
            let points = vectors(&golden[&format!("{prefix}points")]);
            let spirals = Spirals::new(&points, &faces(&golden[&format!("{prefix}faces")]), rings);
            assert_eq!(spirals.of_length(length), as_numbers(&golden[name]), "{name}");
        }
    }

    #[test]
    fn a_length_is_cut_and_filled_up() {
        let spirals = Spirals { rows: vec![vec![0, 1, 2, 3], vec![1, 0], vec![2, 0], vec![3, 0]] };
        assert_eq!(spirals.of_length(3), [0, 1, 2, 1, 0, 4, 2, 0, 4, 3, 0, 4]);
        // Lengths 4, 2, 2, 2: mean 2.5, deviation 0.87.
        assert_eq!(spirals.usual_length(), 4);
    }

    #[test]
    fn a_vertex_without_faces_is_alone() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let spirals = Spirals::new(&points, &[[0, 1, 2]], 2);
        assert_eq!(spirals.rows[3], [3]);
        assert_eq!(spirals.rows[0], [0, 1, 2]);
    }
}
