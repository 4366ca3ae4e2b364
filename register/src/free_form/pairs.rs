//! Which places of a surface and of a scan are one place of the person.
//!
//! Each vertex and the nearest place of the scan, and each of the scan's samples and the nearest place of the surface, if they are near, face
//! the same way and are each other's nearest, almost: over a hole the nearest place is its border, whose own nearest is elsewhere. Metres.

use glam::Vec3;
use rayon::prelude::*;
use xavatar_formats::Result;
use xavatar_mesh::{ClosestPoint, SurfaceIndex, TriangleMesh};

use super::Freedom;
use super::terms::Pull;
use crate::target::ScanTarget;

/// Places that are farther apart are not one, metres.
const FARTHEST: f32 = 0.1;
/// Cosine of the largest angle between the normals of one place.
const ALIKE: f32 = 0.5;
/// How far the way back may end from where the way began: metres, and share of the way.
const ASTRAY: (f32, f32) = (0.003, 0.5);
/// Samples of a scan that look for their place on the surface.
const SAMPLES: usize = 20_000;

/// A surface that can be asked for its nearest place.
struct Surface {
    mesh: TriangleMesh,
    index: SurfaceIndex,
}

/// A scan that a surface is moved onto.
pub struct Scan {
    surface: Surface,
    samples: Vec<(Vec3, Vec3)>,
}

impl Surface {
    fn new(mut mesh: TriangleMesh) -> Result<Self> {
        mesh.normals = Some(mesh.vertex_normals());
        Ok(Self { index: SurfaceIndex::new(&mesh)?, mesh })
    }

    /// The nearest place to one with a normal, if both are one place; `back` is where the place came from.
    fn partner(&self, back: &Self, place: Vec3, normal: Vec3) -> Option<ClosestPoint> {
        let found = self.index.closest_within(place, FARTHEST)?;
        if self.mesh.normal_at(&found.surface_point()).dot(normal) < ALIKE {
            return None;
        }
        let (least, share) = ASTRAY;
        let returned = back.index.closest_within(found.position, FARTHEST)?;
        (returned.position.distance(place) <= least + share * found.distance).then_some(found)
    }
}

impl Scan {
    /// Prepares a scan.
    ///
    /// # Errors
    /// Those of [`ScanTarget::of`].
    pub fn new(scan: &TriangleMesh) -> Result<Self> {
        let target = ScanTarget::of(scan)?;
        let samples = target.points().iter().zip(target.normals()).take(SAMPLES);
        Ok(Self {
            samples: samples.map(|(point, normal)| (point.as_vec3(), normal.as_vec3())).collect(),
            surface: Surface::new(TriangleMesh {
                vertices: scan.vertices.clone(),
                faces: scan.faces.clone(),
                ..TriangleMesh::default()
            })?,
        })
    }

    /// What pulls at a mesh, from each of its vertices that are drawn and from the scan's samples, in this order.
    ///
    /// # Errors
    /// Those of [`SurfaceIndex::new`].
    pub fn pulls(&self, mesh: TriangleMesh, freedoms: &[Freedom]) -> Result<Vec<Pull>> {
        let surface = Surface::new(mesh)?;
        let TriangleMesh { vertices, faces, normals, .. } = &surface.mesh;
        let normals = normals.as_deref().unwrap_or_default();
        let of_vertex = |(vertex, (place, normal)): (usize, (&Vec3, &Vec3))| {
            let found =
                (freedoms[vertex] == Freedom::Drawn).then(|| self.surface.partner(&surface, *place, *normal))??;
            Some(Pull::of_vertex(vertex, found.position.as_dvec3()))
        };
        let of_sample = |(place, normal): &(Vec3, Vec3)| {
            let found = surface.partner(&self.surface, *place, *normal)?;
            let corners = faces[found.face as usize].map(|vertex| vertex as usize);
            let is_drawn = corners.iter().all(|vertex| freedoms[*vertex] == Freedom::Drawn);
            let weights = found.barycentric.map(f64::from);
            is_drawn.then(|| Pull { vertices: corners, weights, place: place.as_dvec3() })
        };
        let mut pulls: Vec<Pull> = vertices.par_iter().zip(normals).enumerate().filter_map(of_vertex).collect();
        pulls.extend(self.samples.par_iter().filter_map(of_sample).collect::<Vec<_>>());
        Ok(pulls)
    }
}
