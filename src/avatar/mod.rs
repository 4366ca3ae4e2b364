//! The product of training: fields and skeleton, to query, extract and pose.
//!
//! [`Avatar::save`] makes it one self-contained file.

mod animator;
mod file;
mod fixed_topology;
mod official;
mod query;
mod shading;
mod subject;

use glam::Vec3;
use xavatar_network::{Representation, Trace};

pub use self::animator::Animator;
pub use self::fixed_topology::FixedTopology;
pub use self::official::OfficialMeta;
pub use self::query::Sample;
pub use self::subject::Subject;

use self::shading::{Posing, shade};
use crate::Result;
use crate::body::{BodyModel, PartLabels, Pose};
use crate::config::Config;
use crate::fields::{Condition, Fields};
use crate::mesh::{Colouring, Component, ExtractionGrid, Sign, TriangleMesh, extract, largest_component};

/// Rows a thread evaluates at a time.
const BLOCK_ROWS: usize = 256;

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

    /// The canonical surface under the condition of a pose, with `resolution` cells along the longest side.
    ///
    /// # Errors
    /// [`Error::NoSurface`](crate::Error::NoSurface) with the range of values seen; [`Error::Value`](crate::Error::Value) for a
    /// resolution out of range.
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
        let embedded = self.fields.geometry.mlp.embed(&self.condition().none());
        let mut mesh = TriangleMesh { vertices: points.to_vec(), ..TriangleMesh::default() };
        shade(&self.fields, &embedded, &Posing::Canonical, &arrays(points), &mut mesh)?;
        match mesh.colouring {
            Colouring::Vertex(colours) => Ok(colours),
            Colouring::None | Colouring::Texture { .. } => Ok(Vec::new()),
        }
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
        let embedded = self.fields.geometry.mlp.embed(condition);
        let network = &self.fields.geometry.mlp;
        let evaluate = |points: &[Vec3], values: &mut [f32]| {
            let mut trace = Trace::default();
            for (values, points) in values.chunks_mut(BLOCK_ROWS).zip(points.chunks(BLOCK_ROWS)) {
                network.evaluate(&mut trace, arrays(points).as_flattened(), &embedded, &[]);
                values.copy_from_slice(trace.output());
            }
        };
        let (minimum, maximum) = self.subject.bounds;
        let mesh = extract(&evaluate, self.grid(minimum, maximum, resolution))?.mesh;
        let Component { mut mesh, others: dropped_components, .. } = largest_component(&mesh);
        let canonical = arrays(&mesh.vertices);
        shade(&self.fields, &embedded, &Posing::Canonical, &canonical, &mut mesh)?;
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

fn arrays(points: &[Vec3]) -> Vec<[f32; 3]> {
    points.iter().map(Vec3::to_array).collect()
}
