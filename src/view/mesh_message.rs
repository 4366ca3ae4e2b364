//! A mesh as `POST /mesh` answers it, little endian (docs/report.md):
//! V, F, resolution u32; seconds f32; positions, then normals f32 (V, 3); colours u8 (V, 3), filled up with zeros to a multiple
//! of four bytes; faces u32 (F, 3).

use glam::Vec3;

use crate::mesh::{Colouring, TriangleMesh};
use crate::{Error, InputError, Result};

const HEAD: usize = 16;

/// The message of a mesh that was extracted with `resolution` cells in `seconds`.
pub(super) fn encode_mesh(mesh: &TriangleMesh, resolution: usize, seconds: f32) -> Vec<u8> {
    let count = mesh.vertices.len();
    let mut bytes = Vec::with_capacity(HEAD + 27 * count + 3 + 12 * mesh.faces.len());
    for value in [count as u32, mesh.faces.len() as u32, resolution as u32, seconds.to_bits()] {
        bytes.extend(value.to_le_bytes());
    }
    let computed;
    let normals = match &mesh.normals {
        Some(normals) => normals,
        None => {
            computed = mesh.vertex_normals();
            &computed
        }
    };
    for vector in mesh.vertices.iter().chain(normals) {
        bytes.extend(vector.to_array().into_iter().flat_map(f32::to_le_bytes));
    }
    match &mesh.colouring {
        Colouring::Vertex(colours) => bytes.extend(colours.as_flattened()),
        Colouring::None | Colouring::Texture { .. } => bytes.resize(bytes.len() + 3 * count, 200),
    }
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend(mesh.faces.as_flattened().iter().flat_map(|vertex| vertex.to_le_bytes()));
    bytes
}

/// Reads a message: the mesh, its resolution, and the seconds that it took.
///
/// # Errors
/// [`InputError::Value`] if it is shorter or longer than it says.
pub fn decode_mesh(message: &[u8]) -> Result<(TriangleMesh, usize, f32)> {
    let words: Vec<u32> = message.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
    let extent = |index: usize| words.get(index).map_or(0, |word| *word as usize);
    let (count, faces) = (extent(0), extent(1));
    let colours = HEAD + 24 * count;
    let first_face = (colours + 3 * count).next_multiple_of(4);
    if message.len() < HEAD || message.len() != first_face + 12 * faces {
        return Err(Error::from(InputError::Value {
            name: "the mesh message".into(),
            found: format!("{} bytes for {count} vertices and {faces} faces", message.len()),
            expected: format!("{} bytes", first_face + 12 * faces),
        }));
    }
    let vectors: Vec<Vec3> = words[HEAD / 4..colours / 4]
        .as_chunks::<3>()
        .0
        .iter()
        .map(|vector| Vec3::from(vector.map(f32::from_bits)))
        .collect();
    let (vertices, normals) = vectors.split_at(count);
    let mesh = TriangleMesh {
        vertices: vertices.to_vec(),
        faces: words[first_face / 4..].as_chunks::<3>().0.to_vec(),
        normals: Some(normals.to_vec()),
        colouring: Colouring::Vertex(message[colours..colours + 3 * count].as_chunks::<3>().0.to_vec()),
    };
    Ok((mesh, extent(2), f32::from_bits(words[3])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_survives_its_message() {
        let mesh = TriangleMesh {
            vertices: vec![Vec3::X, Vec3::Y * 1.5, Vec3::Z, Vec3::NEG_X, Vec3::ONE],
            faces: vec![[0, 1, 2], [2, 3, 4]],
            normals: Some(vec![Vec3::Z; 5]),
            colouring: Colouring::Vertex((0..5).map(|vertex| [vertex, 2 * vertex, 255]).collect()),
        };
        let message = encode_mesh(&mesh, 96, 0.25);
        let (read, resolution, seconds) = decode_mesh(&message).unwrap();
        assert_eq!((read.vertices, read.faces, read.normals), (mesh.vertices, mesh.faces, mesh.normals));
        assert!(matches!((read.colouring, mesh.colouring), (Colouring::Vertex(a), Colouring::Vertex(b)) if a == b));
        assert_eq!((resolution, seconds), (96, 0.25));
        for length in [0, 3, 15, 16, message.len() - 1] {
            assert!(decode_mesh(&message[..length]).is_err(), "{length}");
        }
    }
}
