//! Connected parts of a mesh. Vertices at the same position are one, so a scan's texture seams do not tear it apart.

use glam::{DVec3, Vec3};

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

pub(super) fn root_of(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let grandparent = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = grandparent;
        vertex = grandparent;
    }
    vertex
}

/// One connected part of a mesh, perhaps with pockets in it.
#[derive(Clone, Debug, Default)]
pub struct Component {
    /// The part alone; its vertices keep their order.
    pub mesh: TriangleMesh,
    /// Which vertex of the whole mesh each of its vertices was (V).
    pub vertices: Vec<u32>,
    /// How many other parts there are.
    pub others: usize,
}

/// A closed part whose faces look inward: a hollow in another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pocket {
    /// What it encloses, positive, in the mesh's unit cubed.
    pub volume: f64,
    /// The mean of its faces' middles by area.
    pub centre: Vec3,
}

/// The connected part with the largest area.
#[must_use]
pub fn largest_component(mesh: &TriangleMesh) -> Component {
    largest_with_pockets(mesh, |_| false)
}

/// The connected part with the largest area, and those pockets that `is_kept`.
#[must_use]
pub fn largest_with_pockets(mesh: &TriangleMesh, is_kept: impl Fn(Pocket) -> bool) -> Component {
    let FaceComponents { of_face, count } = face_components(&mesh.merged_by_position());
    let mut parts = vec![Part::default(); count];
    for (face, &part) in of_face.iter().enumerate() {
        parts[part as usize].add(mesh.corners(face as u32), mesh.face_area(face as u32));
    }
    let largest = (0..count).reduce(|best, part| if parts[part].area > parts[best].area { part } else { best });
    let Some(largest) = largest else { return Component::default() };
    let kept: Vec<bool> =
        (0..count).map(|part| part == largest || parts[part].pocket().is_some_and(&is_kept)).collect();
    let faces = mesh.faces.iter().zip(&of_face).filter(|&(_, &part)| kept[part as usize]).map(|(&face, _)| face);
    let (mesh, vertices) = with_faces(mesh, faces.collect());
    Component { mesh, vertices, others: kept.iter().filter(|kept| !**kept).count() }
}

/// What the faces of a part add up to.
#[derive(Clone, Default)]
struct Part {
    area: f64,
    /// Signed, six times.
    volume: f64,
    /// Of the faces' middles, times their areas.
    centre: DVec3,
}

impl Part {
    fn add(&mut self, corners: [Vec3; 3], area: f64) {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        self.area += area;
        self.volume += a.dot(b.cross(c));
        self.centre += (a + b + c) / 3.0 * area;
    }

    fn pocket(&self) -> Option<Pocket> {
        let centre = (self.centre / self.area).as_vec3();
        (self.volume < 0.0).then_some(Pocket { volume: -self.volume / 6.0, centre })
    }
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

    /// The faces of a cube look outward.
    fn cube(middle: Vec3, half: f32) -> TriangleMesh {
        let vertices = (0..8).map(|corner| {
            let side = |bit: u32| if corner >> bit & 1 == 1 { half } else { -half };
            middle + Vec3::new(side(0), side(1), side(2))
        });
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let faces = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        TriangleMesh { vertices: vertices.collect(), faces, ..TriangleMesh::default() }
    }

    #[test]
    fn pockets_are_kept_as_asked_and_crumbs_are_not() {
        let mut mesh = cube(Vec3::ZERO, 1.0);
        assert!((mesh.volume() - 8.0).abs() < 1e-6);
        let mut add = |part: TriangleMesh, is_hollow: bool| {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(part.vertices);
            mesh.faces.extend(part.faces.iter().map(|[a, b, c]| {
                let [b, c] = if is_hollow { [c, b] } else { [b, c] };
                [a + first, b + first, c + first]
            }));
        };
        add(cube(Vec3::X * 0.5, 0.25), true);
        add(cube(Vec3::NEG_X * 0.5, 0.1), true);
        add(cube(Vec3::X * 3.0, 0.25), false);
        let seen = std::cell::RefCell::new(Vec::new());
        let found = largest_with_pockets(&mesh, |pocket| {
            seen.borrow_mut().push(pocket);
            pocket.volume > 0.1
        });
        assert_eq!((found.others, found.mesh.faces.len()), (2, 24));
        assert!((found.mesh.volume() - (8.0 - 0.125)).abs() < 1e-5);
        let seen = seen.into_inner();
        assert!(
            seen.len() == 2 && (seen[0].volume - 0.125).abs() < 1e-6 && seen[0].centre.distance(Vec3::X * 0.5) < 1e-6
        );
        assert_eq!(largest_component(&mesh).mesh.faces.len(), 12);
    }

    #[test]
    fn nothing_has_no_parts() {
        let Component { mesh, others, .. } = largest_component(&TriangleMesh::default());
        assert!(mesh.faces.is_empty());
        assert_eq!(others, 0);
    }
}
