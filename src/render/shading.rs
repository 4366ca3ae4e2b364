//! From visible faces to colours: a key light, a fill light and a soft ambient, on a near-white background.
//!
//! Each pixel has 2 x 2 samples and is shaded once for every face they see, at the centroid of that face's samples. Lights are
//! fixed to the camera, so a turntable keeps its look. Light adds up linearly; pictures and colours are sRGB.

use std::borrow::Cow;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use image::RgbImage;
use rayon::prelude::*;

use super::camera::{Camera, Projection};
use super::rasterize::{Band, EMPTY, Rasterizer};
use crate::mesh::{SurfacePoint, TriangleMesh};
use crate::{Error, Result};

/// n of the n x n samples in a pixel of a picture.
const SAMPLES: u32 = 2;
/// Coordinates beyond it are no picture's subject, and their squares would leave f32's range, metres.
const FARTHEST: f32 = 1e6;
/// The colour of a mesh without one: a warm plaster, linear.
const PLASTER: Vec3 = Vec3::new(0.64, 0.62, 0.59);
/// Background at the top and at the bottom of a picture, linear.
const BACKGROUND: [f32; 2] = [1.0, 0.83];

/// Towards the key light (from the upper left, in front of the subject), camera space, and its strength.
const KEY: (Vec3, f32) = (Vec3::new(-0.56, -0.62, -0.55), 0.92);
/// Towards the fill light (from the right), and its strength.
const FILL: (Vec3, f32) = (Vec3::new(0.86, -0.05, -0.51), 0.16);
/// How far lamps reach around a limb: 0 is Lambert's point light, 0.5 leaves only the opposite point dark.
const WRAP: f32 = 0.25;
/// Ambient light from below and from above.
const AMBIENT: [f32; 2] = [0.08, 0.24];
/// Share of a coloured surface's light that does not depend on direction: scans carry their own shading.
const UNLIT_SHARE: f32 = 0.55;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// The shape alone, in plain grey.
    Shaded,
    /// The mesh's own colours, gently lit; plain grey where it has none.
    Colour,
    /// Normals in camera space: red right, green up, blue towards the camera, each from -1 (0) to 1 (255).
    Normals,
}

/// A picture of a mesh, 2 x 2 supersampled. The mesh's normals are used where present, else they are computed from its faces.
///
/// # Errors
/// [`Error::Value`] if the camera is impossible, or the mesh fails [`TriangleMesh::check`] or reaches farther than 1000 km.
pub fn render_mesh(mesh: &TriangleMesh, camera: &Camera, view: View) -> Result<RgbImage> {
    let projection = camera.projection()?;
    check(mesh)?;
    let points = to_camera(mesh, &projection);
    let normals = match &mesh.normals {
        Some(normals) => Cow::Borrowed(normals.as_slice()),
        None => Cow::Owned(mesh.vertex_normals()),
    };
    let surface = Surface { mesh, points: &points, normals: &normals, projection, view };
    let mut picture = RgbImage::new(camera.width, camera.height);
    Rasterizer::new(&points, &mesh.faces, &projection, [camera.width, camera.height], SAMPLES).draw(
        &mut picture,
        3,
        |band, pixels| surface.shade(band, pixels, camera),
    );
    Ok(picture)
}

/// The depth z of the surface at each pixel's centre, row by row (height x width), metres; infinite where there is none.
///
/// # Errors
/// As [`render_mesh`].
pub fn render_depth(mesh: &TriangleMesh, camera: &Camera) -> Result<Vec<f32>> {
    let projection = camera.projection()?;
    check(mesh)?;
    let points = to_camera(mesh, &projection);
    let mut depths = vec![f32::INFINITY; camera.width as usize * camera.height as usize];
    Rasterizer::new(&points, &mesh.faces, &projection, [camera.width, camera.height], 1).draw(
        &mut depths,
        1,
        |band, depths| {
            for (depth, inverse) in depths.iter_mut().zip(&band.inverse_depths) {
                *depth = 1.0 / inverse;
            }
        },
    );
    Ok(depths)
}

fn to_camera(mesh: &TriangleMesh, projection: &Projection) -> Vec<Vec3> {
    mesh.vertices.par_iter().map(|&vertex| projection.to_camera(vertex)).collect()
}

fn check(mesh: &TriangleMesh) -> Result<()> {
    mesh.check()?;
    match mesh.vertices.iter().position(|vertex| vertex.abs().max_element() > FARTHEST) {
        None => Ok(()),
        Some(index) => Err(Error::Value {
            name: format!("vertex {index}"),
            found: mesh.vertices[index].to_string(),
            expected: format!("coordinates up to {FARTHEST} m"),
        }),
    }
}

/// A mesh before a camera.
struct Surface<'a> {
    mesh: &'a TriangleMesh,
    /// Vertices in camera space.
    points: &'a [Vec3],
    /// Vertex normals in the world.
    normals: &'a [Vec3],
    projection: Projection,
    view: View,
}

impl Surface<'_> {
    fn shade(&self, band: &Band, pixels: &mut [u8], camera: &Camera) {
        for (index, line) in pixels.chunks_exact_mut(3 * camera.width as usize).enumerate() {
            let row = band.first_row + index as u32;
            let background = self.background((row as f32 + 0.5) / camera.height as f32);
            let empty = background.to_array().map(encode_srgb);
            let first = index * SAMPLES as usize * band.stride;
            for (column, pixel) in line.chunks_exact_mut(3).enumerate() {
                let place = first + column * SAMPLES as usize;
                let faces = [place, place + 1, place + band.stride, place + band.stride + 1].map(|i| band.faces[i]);
                if faces == [EMPTY; 4] {
                    pixel.copy_from_slice(&empty);
                } else {
                    let light = self.mean_light(faces, Vec2::new(column as f32, row as f32), background);
                    pixel.copy_from_slice(&light.to_array().map(encode_srgb));
                }
            }
        }
    }

    /// The mean over the faces that the samples of the pixel with this upper left corner see.
    fn mean_light(&self, faces: [u32; 4], corner: Vec2, background: Vec3) -> Vec3 {
        let offset = |sample: usize| Vec2::new((sample % 2) as f32 + 0.5, (sample / 2) as f32 + 0.5) / SAMPLES as f32;
        let mut light = Vec3::ZERO;
        for sample in 0..faces.len() {
            if faces[..sample].contains(&faces[sample]) {
                continue;
            }
            let alike = (sample..faces.len()).filter(|&other| faces[other] == faces[sample]);
            let (centroid, count) = alike.fold((Vec2::ZERO, 0.0), |(sum, n), other| (sum + offset(other), n + 1.0));
            light += count
                * match faces[sample] {
                    EMPTY => background,
                    face => self.colour(face, corner + centroid / count),
                };
        }
        light / faces.len() as f32
    }

    fn background(&self, height: f32) -> Vec3 {
        match self.view {
            View::Normals => Vec3::ONE,
            View::Shaded | View::Colour => Vec3::splat(BACKGROUND[0] + height * (BACKGROUND[1] - BACKGROUND[0])),
        }
    }

    /// The linear colour of a face at a point of the picture.
    fn colour(&self, face: u32, pixel: Vec2) -> Vec3 {
        let vertices = self.mesh.faces[face as usize].map(|vertex| vertex as usize);
        let corners = vertices.map(|vertex| self.points[vertex]);
        let ray = self.projection.ray(pixel);
        let barycentric = barycentric(corners, ray);
        let outward = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let smooth: Vec3 = vertices.iter().zip(barycentric).map(|(&vertex, share)| self.normals[vertex] * share).sum();
        let normal = self.projection.direction_to_camera(smooth).try_normalize().unwrap_or(outward.normalize_or_zero());
        if self.view == View::Normals {
            return (Vec3::new(normal.x, -normal.y, -normal.z) * 0.5 + 0.5).map(decode_srgb);
        }
        // Open scans show their inner side too: light it as if it were an outer one.
        let lit = illumination(if outward.dot(corners[0]) > 0.0 { -normal } else { normal });
        let point = SurfacePoint { face, barycentric };
        match self.mesh.colour_at(&point).filter(|_| self.view == View::Colour) {
            Some(colour) => colour.map(decode_srgb) * (UNLIT_SHARE + (1.0 - UNLIT_SHARE) * lit),
            None => PLASTER * lit,
        }
    }
}

/// Where a ray meets the plane of a triangle, as shares of its corners (non-negative, sum 1). Camera space.
fn barycentric(corners: [Vec3; 3], ray: Vec3) -> [f32; 3] {
    let (first, second) = (corners[1] - corners[0], corners[2] - corners[0]);
    // Moeller-Trumbore from the ray's point at the first corner's depth: differences stay small, so nothing cancels.
    let start = ray * corners[0].z - corners[0];
    let across = ray.cross(second);
    let determinant = first.dot(across);
    let b = start.dot(across) / determinant;
    let c = ray.dot(start.cross(first)) / determinant;
    let shares = [1.0 - b - c, b, c].map(|share| share.max(0.0));
    let sum: f32 = shares.iter().sum();
    // A face seen edge-on has no unique point: take its middle.
    if sum.is_finite() && sum > 0.0 { shares.map(|share| share / sum) } else { [1.0 / 3.0; 3] }
}

/// Light that a white surface with this unit normal (camera space) sends to the camera.
fn illumination(normal: Vec3) -> f32 {
    let sky = 0.5 - 0.5 * normal.y;
    let ambient = AMBIENT[0] + sky * (AMBIENT[1] - AMBIENT[0]);
    // Lambert's law softened: a large lamp still lights what is turned away from its centre.
    let lamp = |(direction, strength): (Vec3, f32)| {
        let facing = (WRAP + (1.0 - WRAP) * normal.dot(direction)).max(0.0);
        strength * facing * facing.sqrt()
    };
    ambient + lamp(KEY) + lamp(FILL)
}

/// The linear intensity of an sRGB value, both in [0, 1].
fn decode_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB byte of a linear intensity; brighter than white is white.
fn encode_srgb(intensity: f32) -> u8 {
    /// Steps of the table over the square root of the intensity, in which sRGB is nearly linear.
    const STEPS: f32 = 4095.0;
    static TABLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
        (0..=STEPS as u32)
            .map(|step| {
                let value = (step as f32 / STEPS).powi(2);
                let encoded = if value <= 0.0031308 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
                (encoded * 255.0).round() as u8
            })
            .collect()
    });
    TABLE[(intensity.clamp(0.0, 1.0).sqrt() * STEPS + 0.5) as usize]
}
