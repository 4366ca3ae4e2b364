//! What a triangle mesh's connectivity gives: neighbours, normals, subdivision.

use glam::Vec3;

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

/// Unit vertex normals (V), outward, area-weighted.
pub(super) fn vertex_normals(vertices: &[Vec3], faces: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|corner| vertices[corner as usize]);
        let area = (b - a).cross(c - a);
        for corner in face {
            normals[*corner as usize] += area;
        }
    }
    normals.into_iter().map(|normal| normal.normalize_or(Vec3::Y)).collect()
}
