//! How far every vertex is from every joint along the surface (METHOD-BODY 3): Dijkstra on the mesh's edges from the joint's ring.
//!
//! The ring of joint j are the vertices that follow both it and its parent, w > 0.2 each; a joint without one has the vertex nearest to it. Pieces of
//! the mesh that no edge leads to are as far as the straight way from the ring. V vertices, J joints; metres.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use crate::core::Identity;

/// Both weights of a vertex of the ring are larger.
const RING: f64 = 0.2;

/// The distances (J - 1, V) to every joint but the root, of a body with these weights (V), parents (J) and faces.
pub fn distances_to_joints(
    body: &Identity,
    weights: &[Vec<(usize, f64)>],
    parents: &[Option<usize>],
    faces: &[[u32; 3]],
) -> Vec<Vec<f64>> {
    let edges = edges(&body.template, faces);
    let of_joint = |joint: usize| {
        let weight = |row: &Vec<(usize, f64)>, of: usize| {
            row.iter().find(|(joint, _)| *joint == of).map_or(0.0, |(_, weight)| *weight)
        };
        let parent = parents[joint].unwrap_or_default();
        let is_ring = |row: &Vec<(usize, f64)>| weight(row, joint) > RING && weight(row, parent) > RING;
        let mut ring: Vec<usize> = (0..weights.len()).filter(|vertex| is_ring(&weights[*vertex])).collect();
        if ring.is_empty() {
            let place = body.joints[joint];
            let distance = |vertex: &usize| body.template[*vertex].distance_squared(place);
            let nearest = (0..weights.len()).min_by(|one, other| distance(one).total_cmp(&distance(other)));
            ring.extend(nearest);
        }
        distances(&edges, &body.template, &ring)
    };
    (1..parents.len()).into_par_iter().map(of_joint).collect()
}

/// The neighbours of each vertex (V), and how far they are.
fn edges(template: &[DVec3], faces: &[[u32; 3]]) -> Vec<Vec<(usize, f64)>> {
    let mut edges: Vec<Vec<(usize, f64)>> = vec![Vec::new(); template.len()];
    for face in faces {
        for (one, other) in [(0, 1), (1, 2), (2, 0)] {
            let (one, other) = (face[one] as usize, face[other] as usize);
            let length = template[one].distance(template[other]);
            for (from, to) in [(one, other), (other, one)] {
                if edges[from].iter().all(|(known, _)| *known != to) {
                    edges[from].push((to, length));
                }
            }
        }
    }
    edges
}

/// A length that is a number.
#[derive(Clone, Copy, PartialEq)]
struct Length(f64);

impl Eq for Length {}

impl PartialOrd for Length {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Length {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

fn distances(edges: &[Vec<(usize, f64)>], template: &[DVec3], ring: &[usize]) -> Vec<f64> {
    let mut distances = vec![f64::INFINITY; edges.len()];
    let mut queue: BinaryHeap<Reverse<(Length, usize)>> = BinaryHeap::new();
    for vertex in ring {
        distances[*vertex] = 0.0;
        queue.push(Reverse((Length(0.0), *vertex)));
    }
    while let Some(Reverse((Length(distance), vertex))) = queue.pop() {
        if distance > distances[vertex] {
            continue;
        }
        for (neighbour, length) in &edges[vertex] {
            if distance + length < distances[*neighbour] {
                distances[*neighbour] = distance + length;
                queue.push(Reverse((Length(distance + length), *neighbour)));
            }
        }
    }
    for vertex in (0..edges.len()).filter(|vertex| distances[*vertex].is_infinite()).collect::<Vec<_>>() {
        let straight = ring.iter().map(|other| template[*other].distance(template[vertex]));
        distances[vertex] = straight.fold(f64::INFINITY, f64::min);
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_along_edges_and_over_gaps_straight() {
        // A strip along x whose ring is its first vertex, and a triangle that hangs nowhere.
        let template: Vec<DVec3> = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 0.0], [3.0, 1.0], [4.0, 0.0]]
            .map(|[x, y]| DVec3::new(x, y, 0.0))
            .to_vec();
        let faces = [[0, 1, 2], [1, 3, 2], [4, 6, 5]];
        let mut weights = vec![vec![(1, 1.0)]; 7];
        weights[0] = vec![(0, 0.5), (1, 0.5)];
        let body = Identity { template, joints: vec![DVec3::ZERO; 2] };
        let found = &distances_to_joints(&body, &weights, &[None, Some(0)], &faces)[0];
        let expected = [0.0, 1.0, 2.0_f64.sqrt(), 1.0 + 2.0_f64.sqrt(), 3.0, 10.0_f64.sqrt(), 4.0];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
