//! Texture coordinates for a mesh that has none: charts, flattened and packed into one square (crate `uvunwrap`).
//!
//! Every face keeps its place and order; a vertex on a seam becomes one for each chart. V vertices.

use std::sync::Arc;

use glam::Vec2;
use uvunwrap::{Atlas, Density, MeshInput, Options, generate};

use super::rig::RiggedMesh;
use crate::mesh::{Colouring, TriangleMesh};
use crate::{Error, InputError, Result};

/// Largest angle between a face and its chart's mean, degrees: as flat as keeps charts few.
const CHART_ANGLE: f32 = 60.0;

/// A mesh's charts.
#[derive(Clone, Debug)]
pub(super) struct Unwrapped {
    /// Which of the mesh's vertices each new one is (V').
    pub(super) sources: Vec<u32>,
    /// Coordinates in [0, 1]^2 (V'), v along the rows of the image.
    pub(super) uvs: Vec<Vec2>,
    /// Indices into the new vertices, the mesh's faces in their order.
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) charts: u32,
    /// Texels along a metre of the surface.
    pub(super) texels_per_metre: f32,
}

impl Unwrapped {
    /// The charts of `mesh` on an image of at most `size` x `size` texels, at least twice `padding` texels apart.
    pub(super) fn new(mesh: &TriangleMesh, size: u32, padding: u32) -> Result<Self> {
        let refused = |found: String| {
            Error::from(InputError::Value {
                name: "the texture".into(),
                found,
                expected: format!(
                    "charts that fit {size} x {size} texels: choose a larger texture or a lower resolution"
                ),
            })
        };
        let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(glam::Vec3::to_array).collect();
        let options = Options {
            density: Density::Auto { page_size: size },
            max_chart_angle: CHART_ANGLE,
            padding,
            ..Options::default()
        };
        let input = MeshInput::new(&positions, mesh.faces.as_flattened());
        let Atlas { width, height, page_count, texels_per_unit, chart_count, mut meshes, .. } =
            generate(&[input], &options).map_err(|error| refused(error.to_string()))?;
        let Some(unwrapped) = meshes.pop().filter(|_| page_count == 1) else {
            return Err(refused(format!("{chart_count} charts on {page_count} images")));
        };
        Ok(Self {
            sources: unwrapped.vertices.iter().map(|vertex| vertex.xref).collect(),
            uvs: unwrapped.vertices.iter().map(|vertex| Vec2::from_array(vertex.uv)).collect(),
            faces: unwrapped.indices.as_chunks().0.to_vec(),
            width,
            height,
            charts: chart_count,
            texels_per_metre: texels_per_unit,
        })
    }

    /// The mesh on these vertices, coloured by `image`.
    pub(super) fn textured(&self, mesh: &TriangleMesh, image: image::RgbImage) -> TriangleMesh {
        TriangleMesh {
            vertices: pick(&mesh.vertices, &self.sources),
            faces: self.faces.clone(),
            normals: mesh.normals.as_ref().map(|normals| pick(normals, &self.sources)),
            colouring: Colouring::Texture { uvs: self.uvs.clone(), image: Arc::new(image) },
        }
    }
}

impl RiggedMesh {
    /// The rig of the same surface on other vertices: `mesh`, whose vertex i was vertex `sources[i]` of this one.
    pub(super) fn on_vertices(self, mesh: TriangleMesh, sources: &[u32]) -> Self {
        let mut morphs = self.morphs;
        morphs.iter_mut().for_each(|morph| morph.offsets = pick(&morph.offsets, sources));
        Self {
            mesh,
            skin_joints: pick_rows(&self.skin_joints, sources, self.influences),
            skin_weights: pick_rows(&self.skin_weights, sources, self.influences),
            morphs,
            joints: self.joints,
            parts: self.parts,
            influences: self.influences,
            animation: self.animation,
            root: self.root,
        }
    }
}

fn pick<T: Copy>(values: &[T], sources: &[u32]) -> Vec<T> {
    sources.iter().map(|source| values[*source as usize]).collect()
}

fn pick_rows<T: Copy>(values: &[T], sources: &[u32], width: usize) -> Vec<T> {
    sources.iter().flat_map(|source| &values[*source as usize * width..][..width]).copied().collect()
}
