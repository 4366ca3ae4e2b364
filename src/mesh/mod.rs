//! Triangle meshes: what scans, registrations and extracted avatars are made of.
//!
//! Metres, Y up; faces wind counter-clockwise seen from outside, so normals point outward.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::RgbImage;

/// An indexed triangle mesh. V vertices, F faces.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Positions (V), metres.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each face (F), counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Unit vertex normals (V), outward; absent when the file had none.
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
        /// Texture coordinates (V) in [0, 1]^2; (0, 0) is the centre of the image's row 0, column 0 corner.
        uvs: Vec<Vec2>,
        /// The image; row 0 is v = 0.
        image: Arc<RgbImage>,
    },
}
