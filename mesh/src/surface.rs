//! Places on a mesh's surface, and what the mesh says there: position, normal, colour.

use glam::Vec3;

use super::texture::sample_bilinear;
use super::{Colouring, TriangleMesh};

/// A place on the surface of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The face.
    pub face: u32,
    /// Weights of the face's three vertices, at least 0, of sum 1.
    pub barycentric: [f32; 3],
}

impl TriangleMesh {
    /// The place in space, metres.
    ///
    /// # Panics
    /// Like its siblings, if the face is not one of the mesh.
    #[must_use]
    pub fn position_at(&self, point: &SurfacePoint) -> Vec3 {
        weighted(point, self.corners(point.face))
    }

    /// The unit normal: interpolated between the vertices where the mesh has normals, else the face's.
    #[must_use]
    pub fn normal_at(&self, point: &SurfacePoint) -> Vec3 {
        let face = self.faces[point.face as usize];
        let interpolated = self.normals.as_ref().map(|normals| weighted(point, face.map(|v| normals[v as usize])));
        interpolated.and_then(Vec3::try_normalize).unwrap_or_else(|| self.face_normal(point.face))
    }

    /// The unit normal of a face, to the side from which its vertices are counter-clockwise; zero without area.
    #[must_use]
    pub fn face_normal(&self, face: u32) -> Vec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// The sRGB colour, each channel in [0, 1]; `None` for a mesh without colours.
    #[must_use]
    pub fn colour_at(&self, point: &SurfacePoint) -> Option<Vec3> {
        let face = self.faces[point.face as usize];
        match &self.colouring {
            Colouring::None => None,
            Colouring::Vertex(colours) => {
                let corners = face.map(|v| Vec3::from(colours[v as usize].map(f32::from)));
                Some(weighted(point, corners) / 255.0)
            }
            Colouring::Texture { uvs, image } => {
                let uv = weighted(point, face.map(|v| uvs[v as usize].extend(0.0)));
                Some(sample_bilinear(image, uv.truncate()))
            }
        }
    }

    /// Unit normals (V), the mean of the adjacent faces' weighted by their angle, which the triangulation of a flat
    /// part does not change (Thürmer & Wüthrich 1998). Vertices at the same place share one, so seams do not show; zero
    /// at vertices of no face.
    #[must_use]
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let (merged, count) = self.merged_indices();
        let mut sums = vec![Vec3::ZERO; count];
        for (index, face) in self.faces.iter().enumerate() {
            let normal = self.face_normal(index as u32);
            if normal == Vec3::ZERO {
                continue;
            }
            let corners = self.corners(index as u32);
            for (k, &vertex) in face.iter().enumerate() {
                let to = |other: usize| corners[(k + other) % 3] - corners[k];
                sums[merged[vertex as usize] as usize] += normal * to(1).angle_between(to(2));
            }
        }
        merged.iter().map(|&place| sums[place as usize].normalize_or_zero()).collect()
    }
}

fn weighted(point: &SurfacePoint, corners: [Vec3; 3]) -> Vec3 {
    let [u, v, w] = point.barycentric;
    corners[0] * u + corners[1] * v + corners[2] * w
}

/// A file's normal at unit length; one that is already unit to rounding stays bit for bit.
pub(super) fn unit_normal(normal: Vec3) -> Vec3 {
    if (normal.length_squared() - 1.0).abs() < 1e-5 { normal } else { normal.normalize_or_zero() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::bumpy_sphere;
    use glam::Vec2;
    use image::{Rgb, RgbImage};
    use std::sync::Arc;

    fn triangle(colouring: Colouring) -> TriangleMesh {
        TriangleMesh { vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y], faces: vec![[0, 1, 2]], normals: None, colouring }
    }

    #[test]
    fn colours_are_interpolated_from_vertices_and_textures_alike() {
        let centre = SurfacePoint { face: 0, barycentric: [0.5, 0.25, 0.25] };
        let of_vertices = triangle(Colouring::Vertex(vec![[0, 0, 51], [255, 0, 51], [0, 255, 51]]));
        assert!(of_vertices.colour_at(&centre).unwrap().abs_diff_eq(Vec3::new(0.25, 0.25, 0.2), 1e-6));
        // The same ramp as an image: u is red, v is green, with texel centres at (i + 0.5) / 256.
        let image = RgbImage::from_fn(256, 256, |x, y| Rgb([x as u8, y as u8, 51]));
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y].map(|uv| (uv * 255.0 + 0.5) / 256.0).to_vec();
        let textured = triangle(Colouring::Texture { uvs, image: Arc::new(image) });
        assert!(textured.colour_at(&centre).unwrap().abs_diff_eq(Vec3::new(0.25, 0.25, 0.2), 1e-5));
        assert_eq!(triangle(Colouring::None).colour_at(&centre), None);
    }

    #[test]
    fn normals_come_from_vertices_if_there_are_any() {
        let mut mesh = triangle(Colouring::None);
        let centre = SurfacePoint { face: 0, barycentric: [1.0 / 3.0; 3] };
        assert_eq!(mesh.normal_at(&centre), Vec3::Z);
        mesh.normals = Some(vec![Vec3::X; 3]);
        assert!(mesh.normal_at(&centre).abs_diff_eq(Vec3::X, 1e-6));
        mesh.normals = Some(vec![Vec3::ZERO; 3]);
        assert_eq!(mesh.normal_at(&centre), Vec3::Z);
    }

    #[test]
    fn vertex_normals_point_outward_and_ignore_seams() {
        let mesh = bumpy_sphere(20);
        let normals = mesh.vertex_normals();
        assert!(mesh.vertices.iter().zip(&normals).all(|(v, n)| n.is_normalized() && n.dot(v.normalize()) > 0.7));

        let torn = TriangleMesh {
            vertices: (0..mesh.faces.len() as u32).flat_map(|f| mesh.corners(f)).collect(),
            faces: (0..mesh.faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
            ..TriangleMesh::default()
        };
        let expected = mesh.faces.iter().flatten().map(|&v| normals[v as usize]);
        assert!(torn.vertex_normals().into_iter().zip(expected).all(|(a, b)| a.abs_diff_eq(b, 1e-6)));
    }
}
