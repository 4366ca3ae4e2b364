//! Faces on the picture's grid: perspective projection, clipping, and which bands of rows a triangle touches.
//!
//! A vertex (x, y, z) in camera space lies at (fx x / z + cx, fy y / z + cy), snapped to 1/512 pixel, so that faces sharing a
//! vertex share its snapped place. Faces that lie outside the picture are dropped, and those that reach too far or behind the
//! camera are cut. Pixels; metres.

use std::ops::Range;

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use xavatar_mesh::camera::PinholeCamera;

/// What lies nearer to the camera is cut off, metres.
const NEAR: f32 = 0.01;
/// Subdivisions of a pixel that vertices snap to.
pub(super) const SNAP: i32 = 512;
/// Faces that reach beyond this many half pictures from the centre are cut there, which bounds the integers: pictures are at
/// most 8192 pixels wide, so coordinates stay below 2^24.
const GUARD: f32 = 3.0;
/// Triangles up to this wide and high (48 pixels) are drawn with 32-bit integers: an edge function at a place up to two pixels
/// beyond the triangle is at most 2 SMALL (SMALL + 2 SNAP) < 2^31.
pub(super) const SMALL: i32 = 48 * SNAP;
/// Faces that one task projects.
const FACE_BLOCK: usize = 4096;

/// The drawable triangles of some consecutive faces, and which of them touch each band.
pub(super) struct Block {
    pub triangles: Vec<ScreenTriangle>,
    pub bands: Vec<BandList>,
}

/// The triangles of a block that touch a band.
#[derive(Clone)]
pub(super) struct BandList {
    /// Indices into the block's.
    pub triangles: Vec<u32>,
    /// The first column of pixels that they reach; [`usize::MAX`] if there are none.
    pub left: usize,
    /// The first column after those that they reach.
    pub right: usize,
}

/// A triangle on the snapped grid with positive area.
pub(super) struct ScreenTriangle {
    pub face: u32,
    pub points: [[i32; 2]; 3],
    pub inverse_depths: [f32; 3],
}

impl ScreenTriangle {
    /// Lowest and highest coordinate along `axis`.
    pub fn extent(&self, axis: usize) -> [i32; 2] {
        let [a, b, c] = self.points.map(|point| point[axis]);
        [a.min(b).min(c), a.max(b).max(c)]
    }

    /// Whether its edge functions fit into 32 bits.
    pub fn is_small(&self) -> bool {
        [0, 1].map(|axis| self.extent(axis)).iter().all(|[low, high]| high - low <= SMALL)
    }

    /// Twice the area; at least 1.
    pub fn area(&self) -> i64 {
        let [a, b, c] = self.points.map(|point| point.map(i64::from));
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }

    /// The pixels along `axis`, of `count`, in which the triangle may reach samples that lie at least `margin` within a pixel.
    pub fn pixels(&self, axis: usize, count: usize, margin: i32) -> Range<usize> {
        let [low, high] = self.extent(axis);
        let pixel = |place: i32| place.div_euclid(SNAP).clamp(0, count as i32) as usize;
        pixel(low + margin - 1)..pixel(high - margin + SNAP)
    }
}

/// Projects the faces over `points` (camera space, within 1000 km, indices in range) onto the picture of a checked camera that is
/// cut into bands of `band_rows` rows. Samples lie at least `margin` within their pixel.
pub(super) fn project(
    points: &[Vec3],
    faces: &[[u32; 3]],
    camera: &PinholeCamera,
    band_rows: usize,
    margin: i32,
) -> Vec<Block> {
    let corners = [Vec2::ZERO, Vec2::new(camera.width as f32, camera.height as f32)];
    let extent = corners.map(|corner| camera.ray(corner).truncate());
    let centre = (extent[0] + extent[1]) / 2.0;
    let guard = extent.map(|corner| centre + (corner - centre) * GUARD);
    let grid = Grid { camera, extent, guard, band_rows, margin };
    let vertices: Vec<Vertex> = points.par_iter().map(|&point| grid.vertex(point)).collect();
    let bands = (camera.height as usize).div_ceil(band_rows);
    faces
        .par_chunks(FACE_BLOCK)
        .enumerate()
        .map(|(block, faces)| {
            let list = BandList { triangles: Vec::new(), left: usize::MAX, right: 0 };
            let mut result = Block { triangles: Vec::with_capacity(faces.len()), bands: vec![list; bands] };
            for (offset, face) in faces.iter().enumerate() {
                let index = (block * FACE_BLOCK + offset) as u32;
                let corners = face.map(|vertex| &vertices[vertex as usize]);
                if corners.iter().fold(!0, |all, corner| all & corner.outside) & BEYOND_PICTURE != 0 {
                    continue;
                }
                if corners.iter().all(|corner| corner.outside & BEYOND_GUARD == 0) {
                    grid.add(index, corners, &mut result);
                } else {
                    grid.add_clipped(index, face.map(|vertex| points[vertex as usize]), &mut result);
                }
            }
            result
        })
        .collect()
}

/// A vertex on the grid.
struct Vertex {
    place: [i32; 2],
    inverse_depth: f32,
    /// What it lies beyond: a bit for each half-space of [`BEYOND_PICTURE`], and [`BEYOND_GUARD`].
    outside: u8,
}

/// Too near, or right, left, below or above of what the picture sees.
const BEYOND_PICTURE: u8 = 0b1_1111;
/// Too near or outside of the guard: to be cut.
const BEYOND_GUARD: u8 = 0b10_0000;

/// The grid that triangles are projected to.
struct Grid<'a> {
    camera: &'a PinholeCamera,
    /// Lowest and highest x / z and y / z in the picture.
    extent: [Vec2; 2],
    /// The same where faces are cut.
    guard: [Vec2; 2],
    band_rows: usize,
    margin: i32,
}

impl Grid<'_> {
    fn vertex(&self, point: Vec3) -> Vertex {
        let PinholeCamera { fx, fy, cx, cy, .. } = *self.camera;
        let place = [fx * point.x / point.z + cx, fy * point.y / point.z + cy];
        let [low, high] = self.extent.map(|corner| corner * point.z);
        let beyond = [point.z < NEAR, point.x > high.x, point.x < low.x, point.y > high.y, point.y < low.y];
        let [low, high] = self.guard.map(|corner| corner * point.z);
        let across = point.truncate();
        let guarded = point.z >= NEAR && across.cmple(high).all() && across.cmpge(low).all();
        let sides = beyond.iter().rev().fold(0, |bits, &side| bits << 1 | u8::from(side));
        Vertex {
            place: place.map(|coordinate| (coordinate * SNAP as f32).round_ties_even() as i32),
            inverse_depth: 1.0 / point.z,
            outside: sides | if guarded { 0 } else { BEYOND_GUARD },
        }
    }

    /// Adds the fan of what is left of a face after cutting it.
    fn add_clipped(&self, face: u32, corners: [Vec3; 3], block: &mut Block) {
        // In f64: a corner may be so far away that rounding would put the cut behind the camera.
        let [low, high] = self.guard.map(Vec2::as_dvec2);
        let mut polygon = corners.map(Vec3::as_dvec3).to_vec();
        clip(&mut polygon, |p| p.z - f64::from(NEAR));
        clip(&mut polygon, |p| high.x * p.z - p.x);
        clip(&mut polygon, |p| p.x - low.x * p.z);
        clip(&mut polygon, |p| high.y * p.z - p.y);
        clip(&mut polygon, |p| p.y - low.y * p.z);
        let vertices: Vec<Vertex> = polygon.iter().map(|point| self.vertex(point.as_vec3())).collect();
        for pair in vertices.windows(2).skip(1) {
            self.add(face, [&vertices[0], &pair[0], &pair[1]], block);
        }
    }

    fn add(&self, face: u32, corners: [&Vertex; 3], block: &mut Block) {
        let mut triangle = ScreenTriangle {
            face,
            points: corners.map(|corner| corner.place),
            inverse_depths: corners.map(|corner| corner.inverse_depth),
        };
        match triangle.area() {
            0 => return,
            ..0 => {
                triangle.points.swap(1, 2);
                triangle.inverse_depths.swap(1, 2);
            }
            _ => {}
        }
        let columns = triangle.pixels(0, self.camera.width as usize, self.margin);
        let rows = triangle.pixels(1, self.camera.height as usize, self.margin);
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let index = block.triangles.len() as u32;
        for band in &mut block.bands[rows.start / self.band_rows..=(rows.end - 1) / self.band_rows] {
            band.triangles.push(index);
            band.left = band.left.min(columns.start);
            band.right = band.right.max(columns.end);
        }
        block.triangles.push(triangle);
    }
}

/// Keeps the part of a convex polygon where `distance`, a linear function, is not negative.
fn clip(polygon: &mut Vec<DVec3>, distance: impl Fn(DVec3) -> f64) {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, &to) in polygon.iter().enumerate() {
        let from = polygon[(index + polygon.len() - 1) % polygon.len()];
        let (before, after) = (distance(from), distance(to));
        if (before < 0.0) != (after < 0.0) {
            kept.push(from.lerp(to, before / (before - after)));
        }
        if after >= 0.0 {
            kept.push(to);
        }
    }
    *polygon = kept;
}
