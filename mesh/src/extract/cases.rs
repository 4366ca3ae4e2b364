//! The 256 cases of marching cubes, derived instead of listed.
//!
//! Around each face of the cube, every run of inside corners is cut off by one segment. That rule looks at the face alone, so
//! two cells that share a face draw the same segments: no cracks. The segments close to loops around the inside; loops are
//! cut into triangles with no chord inside a cube face, where the neighbour could have the same chord: no edge gets four
//! triangles. Corners are numbered by bits: 1 is x, 2 is y, 4 is z.

use std::sync::LazyLock;

/// An edge of the cube: eight times its axis plus its lower corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge(u8);

impl Edge {
    fn between(a: u8, b: u8) -> Self {
        Self(8 * (a ^ b).trailing_zeros() as u8 + (a & b))
    }

    pub(super) fn axis(self) -> usize {
        usize::from(self.0 / 8)
    }

    pub(super) fn lower_corner(self) -> u8 {
        self.0 % 8
    }

    fn upper_corner(self) -> u8 {
        self.lower_corner() | 1 << self.axis()
    }

    /// Whether a face of the cube holds both edges.
    fn shares_face(self, other: Self) -> bool {
        let corners = [self.lower_corner(), self.upper_corner(), other.lower_corner(), other.upper_corner()];
        let all_high = corners.iter().fold(7, |bits, c| bits & c);
        let all_low = corners.iter().fold(7, |bits, c| bits & !c);
        all_high | all_low != 0
    }
}

/// The triangles of a case (bit c is set where corner c is inside), counter-clockwise seen from outside.
pub(super) fn triangles(case: u8) -> &'static [[Edge; 3]] {
    static TABLE: LazyLock<Vec<Vec<[Edge; 3]>>> = LazyLock::new(|| (0..=255).map(case_triangles).collect());
    &TABLE[usize::from(case)]
}

fn case_triangles(case: u8) -> Vec<[Edge; 3]> {
    let mut triangles = Vec::new();
    for polygon in loops(&segments(case)) {
        let found = triangulate(&polygon, &mut triangles);
        debug_assert!(found, "every loop of the 256 has a triangulation");
    }
    triangles
}

/// The corners of the six faces, counter-clockwise seen from outside the cube.
fn face_corners() -> impl Iterator<Item = [u8; 4]> {
    (0..3).flat_map(|axis| {
        let (high, u, v) = (1u8 << axis, 1u8 << ((axis + 1) % 3), 1u8 << ((axis + 2) % 3));
        [[high, high | u, high | u | v, high | v], [0, v, u | v, u]]
    })
}

/// Segments that cut off the inside runs of all faces, from where a run is entered to where it is left.
fn segments(case: u8) -> Vec<[Edge; 2]> {
    let inside = |corner: u8| case >> corner & 1 == 1;
    let mut segments = Vec::new();
    for corners in face_corners() {
        let edge = |i: usize| (corners[i % 4], corners[(i + 1) % 4]);
        for entered in (0..4).filter(|&i| !inside(edge(i).0) && inside(edge(i).1)) {
            let left = (entered + 1..entered + 4).find(|&i| !inside(edge(i).1));
            segments.extend(left.map(|left| [edge(entered), edge(left)].map(|(a, b)| Edge::between(a, b))));
        }
    }
    segments
}

/// Chains segments end to start; each crossed edge starts one segment, so every loop closes.
fn loops(segments: &[[Edge; 2]]) -> Vec<Vec<Edge>> {
    let mut left = segments.to_vec();
    let mut loops = Vec::new();
    while let Some([first, mut end]) = left.pop() {
        let mut polygon = vec![first];
        while let Some(next) = left.iter().position(|segment| segment[0] == end) {
            polygon.push(end);
            end = left.swap_remove(next)[1];
        }
        loops.push(polygon);
    }
    loops
}

/// Adds the triangles of a polygon, without chords inside a cube face; whether that is possible.
fn triangulate(polygon: &[Edge], triangles: &mut Vec<[Edge; 3]>) -> bool {
    let &[first, .., last] = polygon else { return true };
    let count = polygon.len();
    if count == 2 {
        return true;
    }
    let before = triangles.len();
    for apex in 1..count - 1 {
        let corner = polygon[apex];
        let chords_allowed =
            (apex == 1 || !first.shares_face(corner)) && (apex == count - 2 || !last.shares_face(corner));
        if chords_allowed {
            triangles.push([first, corner, last]);
            if triangulate(&polygon[..=apex], triangles) && triangulate(&polygon[apex..], triangles) {
                return true;
            }
            triangles.truncate(before);
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_separates_its_corners_by_sound_triangles() {
        for case in 0..=255u8 {
            let inside = |corner: u8| case >> corner & 1 == 1;
            let polygons = loops(&segments(case));
            let crossed = |corner: u8, bit: u8| inside(corner) != inside(corner | bit);
            let crossings =
                (0..8).flat_map(|c| [1, 2, 4].into_iter().filter(move |&bit| c & bit == 0 && crossed(c, bit))).count();
            // Each crossed edge is a corner of exactly one loop, and a polygon of n corners has n - 2 triangles.
            assert_eq!(polygons.iter().map(Vec::len).sum::<usize>(), crossings, "case {case}");
            assert_eq!(triangles(case).len(), crossings - 2 * polygons.len(), "case {case}");
            // Two corners of a triangle share a cube face only along a segment.
            let segments = segments(case);
            for triangle in triangles(case) {
                for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (triangle[i], triangle[j])) {
                    let is_segment = segments.contains(&[a, b]) || segments.contains(&[b, a]);
                    assert!(is_segment || !a.shares_face(b), "case {case}: {a:?} {b:?}");
                }
            }
        }
    }
}
