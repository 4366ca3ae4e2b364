//! A frame looked at closely: scan, avatar, and how far the avatar is from the scan, from the front and from behind.

use std::f32::consts::PI;

use glam::Vec3;
use image::RgbImage;
use rayon::prelude::*;

use crate::Result;
use crate::mesh::camera::{PinholeCamera, THREE_QUARTER};
use crate::mesh::{Colouring, SurfaceIndex, TriangleMesh};
use crate::render::{ColourMap, Tile, View, contact_sheet, render_mesh};

/// Distances from here on have the darkest colour, metres.
const FARTHEST: f32 = 0.01;
/// Columns and rows of one picture, pixels.
const SIZE: (u32, u32) = (300, 480);

/// Four pictures side by side: the scan, the avatar, and its distances from the scan seen from both sides.
///
/// # Errors
/// [`InputError::Value`](crate::InputError::Value) if a mesh is empty or has impossible coordinates.
pub fn closeup(scan: &TriangleMesh, avatar: &TriangleMesh) -> Result<RgbImage> {
    let corner = |fold: fn(Vec3, Vec3) -> Vec3| scan.vertices.iter().copied().reduce(fold).unwrap_or_default();
    let (low, high) = (corner(Vec3::min), corner(Vec3::max));
    let front = PinholeCamera::framing(low, high, THREE_QUARTER, SIZE.0, SIZE.1)?;
    let back = PinholeCamera::framing(low, high, THREE_QUARTER + PI, SIZE.0, SIZE.1)?;
    let error = coloured_by_distance(avatar, scan)?;
    Ok(contact_sheet(&[vec![
        Tile::new(render_mesh(scan, &front, View::Colour)?, "scan"),
        Tile::new(render_mesh(avatar, &front, View::Colour)?, "avatar"),
        Tile::new(render_mesh(&error, &front, View::Data)?, "error: light 0 mm"),
        Tile::new(render_mesh(&error, &back, View::Data)?, "to black 10 mm"),
    ]])?)
}

/// `mesh` in the colours of its vertices' distances to `scan`.
fn coloured_by_distance(mesh: &TriangleMesh, scan: &TriangleMesh) -> Result<TriangleMesh> {
    let index = SurfaceIndex::new(scan)?;
    let colour = |vertex: &Vec3| ColourMap::Heat.colour(index.closest(*vertex).distance / FARTHEST);
    let colours = mesh.vertices.par_iter().map(colour).collect();
    Ok(TriangleMesh { colouring: Colouring::Vertex(colours), ..mesh.clone() })
}
