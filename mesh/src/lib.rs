//! Triangle meshes: what scans, registrations and extracted avatars are made of.
//!
//! Metres, Y up; faces wind counter-clockwise seen from outside, so normals point outward.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod atlas;
pub mod camera;
mod closest;
mod colours;
mod components;
mod decimate;
mod draft;
mod extract;
mod glb;
mod hierarchy;
mod notes;
mod obj;
mod ply;
mod read;
mod sampling;
mod surface;
mod surroundings;
#[cfg(test)]
mod testing;
mod text;
mod texture;
mod watertight;
mod winding;

use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::RgbImage;

pub use closest::{ClosestPoint, SurfaceIndex};
pub use components::{Component, Pocket, largest_component, largest_with_pockets};
pub use decimate::{Decimated, decimated};
pub use extract::{ExtractedSurface, ExtractionError, ExtractionGrid, FINEST_RESOLUTION, Sign, extract, extract_ball};
pub use notes::{Loss, Note};
pub use obj::write_obj;
pub use ply::write_ply;
pub use read::{MESH_EXTENSIONS, ReadMesh, parse_mesh, read_mesh};
pub use sampling::SurfaceSampler;
pub use surface::SurfacePoint;
pub use surroundings::{Surroundings, without_surroundings};
pub use texture::encode_png;
pub use watertight::Topology;
pub use winding::SolidIndex;

use xavatar_formats::{Error, Fault, Result};

/// Result of reading bytes, before it is known which file they came from.
type Parsed<T> = std::result::Result<T, Fault>;

/// An indexed triangle mesh. V vertices, F faces.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Positions (V), metres.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each face (F), counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Unit vertex normals (V), outward; absent when the file had none. Zero at vertices of no face.
    pub normals: Option<Vec<Vec3>>,
    /// Where colour comes from.
    pub colouring: Colouring,
}

/// The colour of a mesh's surface. Colours are sRGB, as stored in files.
#[derive(Clone, Debug, Default)]
pub enum Colouring {
    /// No colour known.
    #[default]
    None,
    /// One colour a vertex (V), interpolated over faces.
    Vertex(Vec<[u8; 3]>),
    /// An image looked up at interpolated coordinates, bilinearly.
    Texture {
        /// Texture coordinates (V), clamped to [0, 1]^2 on use; texel (column i, row j) of a W x H image is centred
        /// at ((i + 0.5) / W, (j + 0.5) / H).
        uvs: Vec<Vec2>,
        /// The image; row 0 is v = 0.
        image: Arc<RgbImage>,
    },
}

impl TriangleMesh {
    /// Checks what every algorithm here relies on: finite coordinates, indices below V, one attribute a vertex.
    ///
    /// # Errors
    /// [`Error::Value`] naming the first array and entry that is wrong.
    pub fn check(&self) -> Result<()> {
        let count = self.vertices.len();
        check_finite("vertex", &self.vertices, |v| v.is_finite())?;
        if let Some(normals) = &self.normals {
            check_length("normals", normals.len(), count)?;
            check_finite("normal", normals, |n| n.is_finite())?;
        }
        match &self.colouring {
            Colouring::None => {}
            Colouring::Vertex(colours) => check_length("vertex colours", colours.len(), count)?,
            Colouring::Texture { uvs, image } => {
                check_length("texture coordinates", uvs.len(), count)?;
                check_finite("texture coordinate", uvs, |uv| uv.is_finite())?;
                if image.width() == 0 || image.height() == 0 {
                    return Err(Error::Value {
                        name: "texture".into(),
                        found: format!("{} x {} pixels", image.width(), image.height()),
                        expected: "at least one pixel".into(),
                    });
                }
            }
        }
        match self.faces.iter().enumerate().find(|(_, face)| face.iter().any(|&v| v as usize >= count)) {
            None => Ok(()),
            Some((index, face)) => Err(Error::Value {
                name: format!("face {index}"),
                found: format!("{face:?}"),
                expected: format!("three indices below the {count} vertices"),
            }),
        }
    }

    /// The corner positions of a face.
    #[must_use]
    pub fn corners(&self, face: u32) -> [Vec3; 3] {
        self.faces[face as usize].map(|v| self.vertices[v as usize])
    }
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::Value {
        name: format!("number of {name}"),
        found: found.to_string(),
        expected: format!("{expected}, one a vertex"),
    })
}

fn check_finite<T: std::fmt::Debug>(name: &str, values: &[T], is_finite: impl Fn(&T) -> bool) -> Result<()> {
    match values.iter().enumerate().find(|(_, value)| !is_finite(value)) {
        None => Ok(()),
        Some((index, value)) => Err(Error::Value {
            name: format!("{name} {index}"),
            found: format!("{value:?}"),
            expected: "finite numbers".into(),
        }),
    }
}
