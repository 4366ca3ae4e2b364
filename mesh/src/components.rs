//! Connected parts of a mesh. Vertices at the same position are one, so a scan's texture seams do not tear it apart.

use super::{Colouring, TriangleMesh};

/// Which part each face belongs to.
pub(super) struct FaceComponents {
    /// The part (F), numbered in the order of first faces.
    pub(super) of_face: Vec<u32>,
    pub(super) count: usize,
}

/// Parts of a mesh whose faces are connected by shared vertex indices.
pub(super) fn face_components(mesh: &TriangleMesh) -> FaceComponents {
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for &[a, b, c] in &mesh.faces {
        let root = root_of(&mut parent, a);
        for other in [b, c] {
            let other = root_of(&mut parent, other);
            parent[other as usize] = root;
        }
    }
    const UNSEEN: u32 = u32::MAX;
    let mut number_of_root = vec![UNSEEN; mesh.vertices.len()];
    let mut count = 0;
    let of_face = mesh
        .faces
        .iter()
        .map(|&[vertex, ..]| {
            let number = &mut number_of_root[root_of(&mut parent, vertex) as usize];
            if *number == UNSEEN {
                *number = count;
                count += 1;
            }
            *number
        })
        .collect();
    FaceComponents { of_face, count: count as usize }
}

fn root_of(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let grandparent = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = grandparent;
        vertex = grandparent;
    }
    vertex
}

/// One connected part of a mesh.
#[derive(Clone, Debug, Default)]
pub struct Component {
    /// The part alone; its vertices keep their order.
    pub mesh: TriangleMesh,
    /// Which vertex of the whole mesh each of its vertices was (V).
    pub vertices: Vec<u32>,
    /// How many other parts there are.
    pub others: usize,
}

/// The connected part with the largest area.
#[must_use]
pub fn largest_component(mesh: &TriangleMesh) -> Component {
    let FaceComponents { of_face, count } = face_components(&mesh.merged_by_position());
    let mut areas = vec![0.0; count];
    for (face, &part) in of_face.iter().enumerate() {
        areas[part as usize] += mesh.face_area(face as u32);
    }
    let largest = (0..count).reduce(|best, part| if areas[part] > areas[best] { part } else { best });
    let Some(largest) = largest else { return Component::default() };
    let faces: Vec<[u32; 3]> =
        mesh.faces.iter().zip(&of_face).filter(|&(_, &part)| part as usize == largest).map(|(&face, _)| face).collect();
    let (mesh, vertices) = with_faces(mesh, faces);
    Component { mesh, vertices, others: count - 1 }
}

/// The mesh with these faces only and the vertices they use, and which those are.
pub(super) fn with_faces(mesh: &TriangleMesh, mut faces: Vec<[u32; 3]>) -> (TriangleMesh, Vec<u32>) {
    let mut used = vec![false; mesh.vertices.len()];
    faces.iter().flatten().for_each(|&v| used[v as usize] = true);
    let kept: Vec<u32> = (0..used.len() as u32).filter(|&v| used[v as usize]).collect();
    let mut renumbered = vec![0; mesh.vertices.len()];
    kept.iter().enumerate().for_each(|(new, &old)| renumbered[old as usize] = new as u32);
    faces.iter_mut().flatten().for_each(|v| *v = renumbered[*v as usize]);

    fn pick<T: Copy>(values: &[T], kept: &[u32]) -> Vec<T> {
        kept.iter().map(|&v| values[v as usize]).collect()
    }
    let mesh = TriangleMesh {
        vertices: pick(&mesh.vertices, &kept),
        faces,
        normals: mesh.normals.as_ref().map(|normals| pick(normals, &kept)),
        colouring: match &mesh.colouring {
            Colouring::None => Colouring::None,
            Colouring::Vertex(colours) => Colouring::Vertex(pick(colours, &kept)),
            Colouring::Texture { uvs, image } => Colouring::Texture { uvs: pick(uvs, &kept), image: image.clone() },
        },
    };
    (mesh, kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_largest_part_by_area_keeps_its_colours_and_the_rest_is_counted() {
        // A small triangle, a large square torn along its diagonal, a vertex of no face.
        let mut vertices = vec![Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.1, Vec3::ONE];
        vertices.extend([Vec3::Z, Vec3::Z + Vec3::X, Vec3::Z + Vec3::Y]);
        vertices.extend([Vec3::Z + Vec3::Y, Vec3::Z + Vec3::X, Vec3::new(1.0, 1.0, 1.5)]);
        let colours: Vec<[u8; 3]> = (0..10).map(|v| [v, 0, 0]).collect();
        let mesh = TriangleMesh {
            vertices,
            faces: vec![[0, 1, 2], [4, 5, 6], [7, 8, 9]],
            normals: None,
            colouring: Colouring::Vertex(colours),
        };
        let Component { mesh: largest, vertices, others } = largest_component(&mesh);
        assert_eq!(others, 1);
        assert_eq!(largest.faces, [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(largest.vertices, mesh.vertices[4..]);
        assert_eq!(vertices, [4, 5, 6, 7, 8, 9]);
        assert!(matches!(largest.colouring, Colouring::Vertex(c) if c[0] == [4, 0, 0] && c[5] == [9, 0, 0]));
    }

    #[test]
    fn nothing_has_no_parts() {
        let Component { mesh, others, .. } = largest_component(&TriangleMesh::default());
        assert!(mesh.faces.is_empty());
        assert_eq!(others, 0);
    }
}
