//! What a depth camera would see: for each pixel's centre the depth z of the surface there, metres, and its own colour, unlit.
//!
//! Neither noise nor anti-aliasing: every pixel is one ray, so depth and colour belong to the same point. The depth is exact for
//! the face that the ray meets (1e-6 of it), not the z-buffer's.

use glam::Vec2;
use image::RgbImage;
use rayon::prelude::*;

use super::framing::check_camera;
use super::rasterize::{CENTRE, EMPTY, Rasterizer, sample_place};
use super::scene::{check, meeting_point, to_camera};
use crate::Result;
use crate::camera::PinholeCamera;
use crate::mesh::TriangleMesh;

/// Relative difference between a face's depth at a pixel's centre and the z-buffer's that only faces seen edge-on have.
const EDGE_ON: f32 = 0.01;

/// A depth image with colours, row by row.
#[derive(Clone, Debug)]
pub struct RgbdImage {
    /// z of the surface at the pixels' centres (height x width), metres; infinite where there is none.
    pub depth: Vec<f32>,
    /// The mesh's own colour there (sRGB); black where there is none.
    pub colour: RgbImage,
}

/// The mesh as a depth camera at `camera` sees it, both sides of its faces.
///
/// # Errors
/// [`Error::Value`](crate::Error::Value) if the camera is impossible, or the mesh fails [`TriangleMesh::check`] or reaches farther
/// than 1000 km.
pub fn render_rgbd(mesh: &TriangleMesh, camera: &PinholeCamera) -> Result<RgbdImage> {
    let pixels = visible(mesh, camera)?;
    let mut colour = RgbImage::new(camera.width, camera.height);
    colour.par_chunks_mut(3).zip(pixels.par_iter()).for_each(|(channels, pixel)| {
        if let Some(colour) = pixel.and_then(|(_, point)| mesh.colour_at(&point)) {
            channels.copy_from_slice(&(colour * 255.0).round().to_array().map(|channel| channel as u8));
        }
    });
    Ok(RgbdImage { depth: depths(&pixels), colour })
}

/// The depth z of the surface at each pixel's centre, row by row (height x width), metres; infinite where there is none.
///
/// # Errors
/// As [`render_rgbd`].
pub fn render_depth(mesh: &TriangleMesh, camera: &PinholeCamera) -> Result<Vec<f32>> {
    visible(mesh, camera).map(|pixels| depths(&pixels))
}

/// Where the ray through a pixel's centre meets the mesh, and at which depth.
type Pixel = Option<(f32, crate::mesh::SurfacePoint)>;

fn visible(mesh: &TriangleMesh, camera: &PinholeCamera) -> Result<Vec<Pixel>> {
    check_camera(camera)?;
    check(mesh)?;
    let points = to_camera(mesh, camera);
    let width = camera.width as usize;
    let mut pixels = vec![None; width * camera.height as usize];
    Rasterizer::new(&points, &mesh.faces, camera, CENTRE).draw(&mut pixels, 1, |band, pixels| {
        for (row, pixels) in pixels.chunks_exact_mut(width).enumerate() {
            for column in band.columns.clone() {
                let [face] = band.faces(row, column);
                if face == EMPTY {
                    continue;
                }
                let corner = Vec2::new(column as f32, (band.first_row + row as u32) as f32);
                let ray = camera.ray(corner + sample_place(&CENTRE, 0));
                let corners = mesh.faces[face as usize].map(|vertex| points[vertex as usize]);
                let point = meeting_point(face, corners, ray);
                let exact: f32 = corners.iter().zip(point.barycentric).map(|(corner, share)| corner.z * share).sum();
                // A face seen edge-on has no one depth at its pixel: the z-buffer's is one of them.
                let inverse = band.inverse_depths(row, column)[0];
                let depth = if (exact * inverse - 1.0).abs() < EDGE_ON { exact } else { 1.0 / inverse };
                pixels[column] = Some((depth, point));
            }
        }
    });
    Ok(pixels)
}

fn depths(pixels: &[Pixel]) -> Vec<f32> {
    pixels.iter().map(|pixel| pixel.map_or(f32::INFINITY, |(depth, _)| depth)).collect()
}
