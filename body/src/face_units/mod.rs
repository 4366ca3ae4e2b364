//! Facial actions, as ARKit names them, on any body with a head.
//!
//! [`FaceUnits`] are offsets on a mesh of their own. On a body of that very mesh they are what they are; to another they are carried by
//! closest points on its surface, over which the face is laid first (`alignment`). [`FittedUnit`] says what the body's own expressions, jaw
//! and eyes do of each, and what is left (`fit`). Bodies at rest, Y up, facing +Z; metres.

mod alignment;
mod fit;
#[cfg(test)]
mod tests;

use glam::{DVec3, Vec3};
use xavatar_formats::{Error, Result};
use xavatar_mesh::TriangleMesh;

use self::alignment::Alignment;
use super::{BodyModel, SurfaceMap};

pub use self::fit::{FittedUnit, UnitError};

/// What moves less is not part of an action, metres.
const MOVES: f64 = 1e-4;
/// How far around the face, and how far from its surface, a body's vertices take part, metres.
const REACH: f64 = 0.02;

/// Facial actions on a mesh of V vertices.
#[derive(Clone, Debug)]
pub struct FaceUnits {
    /// The mesh at rest (V).
    pub vertices: Vec<DVec3>,
    /// Its triangles.
    pub faces: Vec<[u32; 3]>,
    /// Its joints, by SMPL-X's names.
    pub joints: Vec<(String, DVec3)>,
    /// The name of each action, and what the whole action moves the vertices by (V).
    pub offsets: Vec<(String, Vec<DVec3>)>,
}

impl FaceUnits {
    /// The actions on a body at rest (actions, vertices of the body).
    fn on(&self, body: &BodyModel) -> Result<Vec<Vec<DVec3>>> {
        if body.vertex_count() == self.vertices.len() && body.faces().len() == self.faces.len() {
            return Ok(self.offsets.iter().map(|(_, offsets)| offsets.clone()).collect());
        }
        let face: Vec<usize> = (0..self.vertices.len()).filter(|vertex| self.is_moved(*vertex)).collect();
        let alignment = Alignment::of(self, &face, body)?;
        let laid: Vec<DVec3> = self.vertices.iter().map(|vertex| alignment.apply(*vertex)).collect();
        let (low, high) = face.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), vertex| {
            (low.min(laid[*vertex]), high.max(laid[*vertex]))
        });
        let (low, high) = (low - REACH, high + REACH);
        let template: Vec<DVec3> = body.template().iter().map(|vertex| vertex.as_dvec3()).collect();
        let normals = normals(body.template(), body.faces());
        let is_near = |vertex: &usize| template[*vertex].cmpge(low).all() && template[*vertex].cmple(high).all();
        let near: Vec<usize> = (0..template.len()).filter(is_near).collect();
        let [points, directions]: [Vec<DVec3>; 2] =
            [&template, &normals].map(|values| near.iter().map(|vertex| values[*vertex]).collect());
        let map = SurfaceMap::new(&points, &laid, &self.faces, Some(&directions))?;
        let found = map.points(&laid);
        let carried = |(_, offsets): &(String, Vec<DVec3>)| {
            let mut on_body = vec![DVec3::ZERO; template.len()];
            for ((vertex, offset), place) in near.iter().zip(map.points(offsets)).zip(&found) {
                if place.distance(template[*vertex]) < REACH {
                    on_body[*vertex] = offset * alignment.scale;
                }
            }
            on_body
        };
        Ok(self.offsets.iter().map(carried).collect())
    }

    /// Whether any action moves a vertex.
    fn is_moved(&self, vertex: usize) -> bool {
        self.offsets.iter().any(|(_, offsets)| offsets[vertex].length() > MOVES)
    }
}

fn normals(vertices: &[Vec3], faces: &[[u32; 3]]) -> Vec<DVec3> {
    let mesh = TriangleMesh { vertices: vertices.to_vec(), faces: faces.to_vec(), ..TriangleMesh::default() };
    mesh.vertex_normals().iter().map(|normal| normal.as_dvec3()).collect()
}

fn headless(body: &BodyModel) -> Error {
    Error::Unfit {
        message: format!("{} has too few joints of a head to lay a face over", body.path().display()),
        remedy: "give a model of a whole body, or of a head".into(),
    }
}
