//! The product of training: fields and skeleton, to query, extract and pose.
//!
//! [`Avatar::save`] makes it one self-contained file.

mod animator;
mod file;
mod fixed_topology;
mod official;
mod query;
mod subject;

use glam::Vec3;
use xavatar_network::Representation;

pub use self::animator::Animator;
pub use self::fixed_topology::FixedTopology;
pub use self::official::OfficialMeta;
pub use self::query::Sample;
pub use self::subject::Subject;

use crate::Result;
use crate::body::{BodyModel, PartLabels, Pose};
use crate::config::Config;
use crate::fields::{Condition, FieldEvaluator, Fields, Shade};
use crate::mesh::{Colouring, Component, ExtractionGrid, Sign, TriangleMesh, extract_ball};

/// An animatable avatar.
#[derive(Clone, Debug)]
pub struct Avatar {
    /// Geometry, texture and skinning.
    pub fields: Fields<f32>,
    /// The configuration it was trained with.
    pub config: Config,
    /// Whom it was made of.
    pub subject: Subject,
    /// Steps on frames it was trained for.
    pub steps: u64,
}

/// A mesh extracted from an avatar.
#[derive(Clone, Debug)]
pub struct Extraction {
    /// The largest component, with normals and vertex colours.
    pub mesh: TriangleMesh,
    /// Smaller components that were left out.
    pub dropped_components: usize,
}

impl Avatar {
    /// What its geometry is told of a pose.
    pub fn condition(&self) -> Condition {
        self.subject.condition()
    }

    /// The canonical surface under the condition of a pose, with `resolution` cells along the longest side; without handles, as
    /// [`extract_ball`] has it.
    ///
    /// # Errors
    /// [`Error::NoSurface`](crate::Error::NoSurface) with the range of values seen;
    /// [`InputError::Value`](crate::InputError::Value) for a resolution out of range.
    pub fn extract_canonical(&self, pose: &Pose, resolution: usize) -> Result<Extraction> {
        self.canonical_surface(&self.condition().of(pose), resolution)
    }

    /// The canonical surface under no condition: that of [`FixedTopology`].
    ///
    /// # Errors
    /// As [`Avatar::extract_canonical`].
    pub fn extract_unconditioned(&self, resolution: usize) -> Result<Extraction> {
        self.canonical_surface(&self.condition().none(), resolution)
    }

    /// The colours (N), sRGB, of canonical points (N) on or near the surface, under no condition as those of [`FixedTopology`].
    ///
    /// # Errors
    /// Those of the fields: points that are not finite.
    pub fn colours(&self, points: &[Vec3]) -> Result<Vec<[u8; 3]>> {
        let shades = FieldEvaluator::new(&self.fields, &self.condition().none()).shades(&arrays(points))?;
        Ok(shades.into_iter().map(|shade| shade.colour).collect())
    }

    /// The surface in one pose; for several, keep an [`Animator`].
    ///
    /// # Errors
    /// As [`Animator::extract`].
    pub fn extract_posed(
        &self,
        body: &BodyModel,
        labels: &PartLabels,
        pose: &Pose,
        resolution: usize,
    ) -> Result<Extraction> {
        Animator::new(self, body, labels)?.extract(pose, resolution)
    }

    fn canonical_surface(&self, condition: &[f32], resolution: usize) -> Result<Extraction> {
        let evaluator = FieldEvaluator::new(&self.fields, condition);
        let evaluate = |points: &[Vec3], values: &mut [f32]| values.copy_from_slice(&evaluator.values(&arrays(points)));
        let (minimum, maximum) = self.subject.bounds;
        let surface = extract_ball(&evaluate, self.grid(minimum, maximum, resolution))?;
        let Component { mut mesh, others: dropped_components, .. } = surface;
        let shades = evaluator.shades(&arrays(&mesh.vertices))?;
        paint(&mut mesh, shades);
        turn_outward(&mut mesh);
        Ok(Extraction { mesh, dropped_components })
    }

    fn grid(&self, minimum: Vec3, maximum: Vec3, resolution: usize) -> ExtractionGrid {
        let inside_is = match self.fields.geometry.representation {
            Representation::Occupancy => Sign::Positive,
            Representation::SignedDistance => Sign::Negative,
        };
        ExtractionGrid { minimum, maximum, resolution, level: 0.0, inside_is }
    }
}

/// Sets the normals and colours of a mesh's vertices (V).
fn paint(mesh: &mut TriangleMesh, shades: Vec<Shade>) {
    mesh.normals = Some(shades.iter().map(|shade| shade.normal).collect());
    mesh.colouring = Colouring::Vertex(shades.into_iter().map(|shade| shade.colour).collect());
}

/// Gives vertices whose normal looks into the surface that of the faces around them: in folds thinner than a cell and where handles were
/// mended, the field's gradient belongs to another place, and the vertex would be drawn dark.
fn turn_outward(mesh: &mut TriangleMesh) {
    let of_faces = mesh.vertex_normals();
    for (normal, of_faces) in mesh.normals.iter_mut().flatten().zip(of_faces) {
        if normal.dot(of_faces) < 0.0 {
            *normal = of_faces;
        }
    }
}

fn arrays(points: &[Vec3]) -> Vec<[f32; 3]> {
    points.iter().map(Vec3::to_array).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_that_look_inward_are_those_of_the_faces() {
        let mut mesh = TriangleMesh {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            faces: vec![[0, 1, 2]],
            normals: Some(vec![Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, -0.8), Vec3::Z]),
            colouring: Colouring::None,
        };
        turn_outward(&mut mesh);
        assert_eq!(mesh.normals.unwrap(), [Vec3::new(0.6, 0.0, 0.8), Vec3::Z, Vec3::Z]);
    }
}
