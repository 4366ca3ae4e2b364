//! What a depth camera would see: for each pixel's centre the depth z of the surface there, metres, and its own colour, unlit.
//!
//! Neither noise nor anti-aliasing: every pixel is one ray, so depth and colour belong to the same point. The depth is exact for
//! the face that the ray meets (1e-6 of it), not the z-buffer's.

use glam::Vec2;
use image::RgbImage;

use super::camera_bounds::check_camera;
use super::rasterize::{CENTRE, EMPTY, Rasterizer, sample_place};
use super::scene::{check, meeting_point, to_camera};
use xavatar_formats::Result;
use xavatar_mesh::camera::PinholeCamera;
use xavatar_mesh::{SurfacePoint, TriangleMesh};

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
/// [`Error::Value`](xavatar_formats::Error::Value) if the camera is impossible, or the mesh fails [`TriangleMesh::check`] or reaches farther
/// than 1000 km.
pub fn render_rgbd(mesh: &TriangleMesh, camera: &PinholeCamera) -> Result<RgbdImage> {
    let pixels = visible(mesh, camera, (f32::INFINITY, [0; 3]), |depth, point| {
        let colour = mesh.colour_at(&point).unwrap_or_default() * 255.0;
        (depth, colour.round().to_array().map(|channel| channel as u8))
    })?;
    let mut colour = RgbImage::new(camera.width, camera.height);
    for (channels, (_, pixel)) in colour.chunks_exact_mut(3).zip(&pixels) {
        channels.copy_from_slice(pixel);
    }
    Ok(RgbdImage { depth: pixels.iter().map(|(depth, _)| *depth).collect(), colour })
}

/// The depth z of the surface at each pixel's centre, row by row (height x width), metres; infinite where there is none.
///
/// # Errors
/// As [`render_rgbd`].
pub fn render_depth(mesh: &TriangleMesh, camera: &PinholeCamera) -> Result<Vec<f32>> {
    visible(mesh, camera, f32::INFINITY, |depth, _| depth)
}

/// What the centre of a pixel sees of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPoint {
    /// Where on the mesh.
    pub place: SurfacePoint,
    /// Its depth z, metres.
    pub depth: f32,
}

/// The point of the mesh that each pixel's centre sees, row by row (height x width); none where there is nothing.
///
/// # Errors
/// As [`render_rgbd`].
pub fn render_points(mesh: &TriangleMesh, camera: &PinholeCamera) -> Result<Vec<Option<SeenPoint>>> {
    visible(mesh, camera, None, |depth, place| Some(SeenPoint { place, depth }))
}

/// For each pixel the `value` of the depth and the point where the ray through its centre meets the mesh; `nothing` where there is
/// none.
fn visible<T: Copy + Send>(
    mesh: &TriangleMesh,
    camera: &PinholeCamera,
    nothing: T,
    value: impl Fn(f32, SurfacePoint) -> T + Sync,
) -> Result<Vec<T>> {
    check_camera(camera)?;
    check(mesh)?;
    let points = to_camera(mesh, camera);
    let width = camera.width as usize;
    let mut pixels = vec![nothing; width * camera.height as usize];
    Rasterizer::new(&points, &mesh.faces, camera, CENTRE).draw(&mut pixels, 1, |band, pixels| {
        for (row, pixels) in pixels.chunks_exact_mut(width).enumerate() {
            for (column, sample) in band.columns.clone().zip(band.row(row)) {
                let ([face], [inverse]) = (sample.faces, sample.inverse_depths);
                if face == EMPTY {
                    continue;
                }
                let corner = Vec2::new(column as f32, (band.first_row + row) as f32);
                let ray = camera.ray(corner + sample_place(&CENTRE, 0));
                let corners = mesh.faces[face as usize].map(|vertex| points[vertex as usize]);
                let point = meeting_point(face, corners, ray);
                let exact: f32 = corners.iter().zip(point.barycentric).map(|(corner, share)| corner.z * share).sum();
                // A face seen edge-on has no one depth at its pixel: the z-buffer's is one of them.
                let depth = if (exact * inverse - 1.0).abs() < EDGE_ON { exact } else { 1.0 / inverse };
                pixels[column] = value(depth, point);
            }
        }
    });
    Ok(pixels)
}
