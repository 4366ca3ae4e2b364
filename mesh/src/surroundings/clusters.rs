//! Connected parts of a mesh, of which those near each other are one.

use std::collections::HashMap;

use glam::Vec3;

use crate::TriangleMesh;
use crate::components::{FaceComponents, face_components, root_of, with_faces};

/// More points than this are not laid along an edge of a face, however long.
const MOST_POINTS: f32 = 16.0;

/// Parts of a mesh that are connected, or near each other.
pub(super) struct Clusters {
    /// The cluster of each face (F).
    pub of_face: Vec<u32>,
    /// The area of each.
    pub areas: Vec<f64>,
    /// The one with the largest area.
    pub largest: usize,
}

impl Clusters {
    /// Puts parts together that are nearer than `reach`; none that are farther than three times that.
    pub fn of(mesh: &TriangleMesh, reach: f32) -> Self {
        let FaceComponents { of_face, count } = face_components(&mesh.merged_by_position());
        let mut parent: Vec<u32> = (0..count as u32).collect();
        let mut unite = |one: u32, other: u32| {
            let (one, other) = (root_of(&mut parent, one), root_of(&mut parent, other));
            parent[other as usize] = one;
        };
        let mut cells: HashMap<[i32; 3], u32> = HashMap::new();
        for (face, &part) in of_face.iter().enumerate() {
            points_of(mesh.corners(face as u32), reach, |point| {
                let cell = (point / reach).floor().as_ivec3().to_array();
                unite(*cells.entry(cell).or_insert(part), part);
            });
        }
        for (&[x, y, z], &part) in &cells {
            for (dx, dy, dz) in half_of_neighbours() {
                let cell = [x.saturating_add(dx), y.saturating_add(dy), z.saturating_add(dz)];
                if let Some(&other) = cells.get(&cell) {
                    unite(part, other);
                }
            }
        }
        let roots: Vec<u32> = (0..count as u32).map(|part| root_of(&mut parent, part)).collect();
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        let of_part: Vec<u32> = roots
            .iter()
            .map(|root| {
                let next = numbers.len() as u32;
                *numbers.entry(*root).or_insert(next)
            })
            .collect();
        let of_face: Vec<u32> = of_face.iter().map(|part| of_part[*part as usize]).collect();
        let mut areas = vec![0.0; numbers.len()];
        of_face.iter().enumerate().for_each(|(face, part)| areas[*part as usize] += mesh.face_area(face as u32));
        let largest = (0..areas.len()).max_by(|one, other| areas[*one].total_cmp(&areas[*other])).unwrap_or(0);
        Self { of_face, areas, largest }
    }

    /// The largest, of the mesh they are of.
    pub fn largest_of(&self, mesh: &TriangleMesh) -> (TriangleMesh, Vec<u32>) {
        let of_largest = mesh.faces.iter().zip(&self.of_face).filter(|(_, part)| **part as usize == self.largest);
        with_faces(mesh, of_largest.map(|(face, _)| *face).collect())
    }
}

/// Points of a triangle that are no farther apart than `spacing`.
fn points_of([a, b, c]: [Vec3; 3], spacing: f32, mut visit: impl FnMut(Vec3)) {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let steps = (longest / spacing).ceil().clamp(1.0, MOST_POINTS) as u32;
    for i in 0..=steps {
        for j in 0..=steps - i {
            let [u, v] = [i, j].map(|step| step as f32 / steps as f32);
            visit(a + (b - a) * u + (c - a) * v);
        }
    }
}

/// One of each two opposite neighbours of a cell.
fn half_of_neighbours() -> impl Iterator<Item = (i32, i32, i32)> {
    let all = (0..27).map(|index| (index / 9 - 1, index / 3 % 3 - 1, index % 3 - 1));
    all.filter(|neighbour| *neighbour > (0, 0, 0))
}
