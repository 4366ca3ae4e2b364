//! A surface with fewer faces, and how far it is from what it was.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use super::rig::RiggedMesh;
use crate::Result;
use crate::mesh::{Decimated, SurfaceIndex, TriangleMesh, decimated};

/// What fewer faces cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FewerFaces {
    /// Faces before.
    pub before: usize,
    /// Faces that are left.
    pub faces: usize,
    /// Distance of the vertices there were from the surface there is, mean, millimetres.
    pub mean_mm: f64,
    /// The largest of them.
    pub max_mm: f64,
}

/// The mesh with at most so many faces, if that is fewer than it has.
///
/// # Errors
/// As [`SurfaceIndex::new`].
pub fn with_fewer_faces(mesh: &TriangleMesh, faces: usize) -> Result<(Decimated, FewerFaces)> {
    let left = decimated(mesh, faces);
    let distances = SurfaceIndex::new(&left.mesh)?.closest_to_each(&mesh.vertices);
    let millimetres = || distances.iter().map(|closest| 1000.0 * f64::from(closest.distance));
    let cost = FewerFaces {
        before: mesh.faces.len(),
        faces: left.mesh.faces.len(),
        mean_mm: millimetres().sum::<f64>() / distances.len().max(1) as f64,
        max_mm: millimetres().fold(0.0, f64::max),
    };
    Ok((left, cost))
}

impl RiggedMesh {
    /// The rig with at most so many faces: weights and morphs of the vertices that are left are as they were.
    ///
    /// # Errors
    /// As [`with_fewer_faces`].
    pub fn with_fewer_faces(self, faces: usize) -> Result<(Self, FewerFaces)> {
        let (Decimated { mesh, sources }, cost) = with_fewer_faces(&self.mesh, faces)?;
        Ok((self.on_vertices(mesh, &sources), cost))
    }
}

impl Display for FewerFaces {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self { before, faces, mean_mm, max_mm } = self;
        write!(
            formatter,
            "{faces} faces of {before}; the surface before is {mean_mm:.3} mm off, {max_mm:.2} mm at most"
        )
    }
}
