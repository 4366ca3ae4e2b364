//! Which face each sample of a picture sees: perspective projection, clipping, and a z-buffer over bands of rows.
//!
//! Edge functions are exact integers on a grid of 1/256 sample with the top-left rule, so that faces sharing an edge neither
//! leave gaps nor overlap. Depth is compared as 1 / z, which is linear over the picture; of equal depths the face that comes
//! first in the mesh wins. Both sides of a face are drawn. F faces, n x n samples a pixel.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::camera::Projection;

/// What lies nearer to the camera is cut off, metres.
const NEAR: f32 = 0.01;
/// Subdivisions of a sample that vertices snap to.
const SNAP: i64 = 256;
/// Faces that reach beyond this many half pictures from the centre are cut there, which bounds the integers.
const GUARD: f32 = 3.0;
/// Rows of pixels that one task draws.
const BAND_ROWS: u32 = 8;
/// Faces that one task projects.
const FACE_BLOCK: usize = 4096;

/// A sample that sees nothing.
pub(super) const EMPTY: u32 = u32::MAX;

/// The faces of a mesh, projected and sorted into bands of rows.
pub(super) struct Rasterizer {
    width: u32,
    height: u32,
    /// n: samples along each side of a pixel.
    samples: u32,
    blocks: Vec<Block>,
}

/// The drawable triangles of some consecutive faces, and which of them touch each band.
struct Block {
    triangles: Vec<ScreenTriangle>,
    bands: Vec<Vec<u32>>,
}

/// A triangle on the snapped sample grid with positive area.
struct ScreenTriangle {
    face: u32,
    points: [[i64; 2]; 3],
    inverse_depths: [f32; 3],
}

/// The samples of a band of rows, after drawing.
pub(super) struct Band {
    /// The first row of pixels.
    pub first_row: u32,
    /// Samples in a row.
    pub stride: usize,
    /// The face that each sample sees, or [`EMPTY`].
    pub faces: Vec<u32>,
    /// 1 / z of each sample, 1 / metres; 0 where empty.
    pub inverse_depths: Vec<f32>,
}

impl Rasterizer {
    /// Projects the faces over `points` (camera space, within 1000 km, indices in range) onto a picture of `width` x `height` pixels.
    pub fn new(
        points: &[Vec3],
        faces: &[[u32; 3]],
        projection: &Projection,
        [width, height]: [u32; 2],
        samples: u32,
    ) -> Self {
        let bands = height.div_ceil(BAND_ROWS) as usize;
        let grid = Grid { projection, samples, columns: i64::from(width * samples), rows: i64::from(height * samples) };
        let blocks = faces
            .par_chunks(FACE_BLOCK)
            .enumerate()
            .map(|(block, faces)| {
                let mut result = Block { triangles: Vec::with_capacity(faces.len()), bands: vec![Vec::new(); bands] };
                for (offset, face) in faces.iter().enumerate() {
                    let corners = face.map(|vertex| points[vertex as usize]);
                    grid.project((block * FACE_BLOCK + offset) as u32, corners, &mut result);
                }
                result
            })
            .collect();
        Self { width, height, samples, blocks }
    }

    /// Draws every band and hands it to `finish` with its rows of `picture`, `channels` elements a pixel.
    pub fn draw<T: Send>(&self, picture: &mut [T], channels: usize, finish: impl Fn(&Band, &mut [T]) + Sync) {
        let row = self.width as usize * channels;
        picture.par_chunks_mut(row * BAND_ROWS as usize).enumerate().for_each(|(band, pixels)| {
            let first_row = band as u32 * BAND_ROWS;
            let stride = (self.width * self.samples) as usize;
            let count = stride * (self.samples * BAND_ROWS.min(self.height - first_row)) as usize;
            let mut samples = Band { first_row, stride, faces: vec![EMPTY; count], inverse_depths: vec![0.0; count] };
            let top = i64::from(first_row * self.samples);
            for block in &self.blocks {
                for &triangle in &block.bands[band] {
                    block.triangles[triangle as usize].draw(&mut samples, top);
                }
            }
            finish(&samples, pixels);
        });
    }
}

/// The sample grid that triangles are projected to.
struct Grid<'a> {
    projection: &'a Projection,
    samples: u32,
    columns: i64,
    rows: i64,
}

impl Grid<'_> {
    /// Adds the visible part of a face to `block`: nothing, one triangle, or the fan of a clipped polygon.
    fn project(&self, face: u32, corners: [Vec3; 3], block: &mut Block) {
        let half = self.projection.half_extent();
        let outside = |limit: f32| {
            let beyond = |test: &dyn Fn(Vec3) -> bool| corners.iter().all(|&corner| test(corner));
            beyond(&|p| p.z < NEAR)
                || beyond(&|p| p.x > limit * half.x * p.z)
                || beyond(&|p| -p.x > limit * half.x * p.z)
                || beyond(&|p| p.y > limit * half.y * p.z)
                || beyond(&|p| -p.y > limit * half.y * p.z)
        };
        if outside(1.0) {
            return;
        }
        let guard = half * GUARD;
        let inside = |p: &Vec3| p.z >= NEAR && p.x.abs() <= guard.x * p.z && p.y.abs() <= guard.y * p.z;
        if corners.iter().all(inside) {
            self.add(face, corners, block);
            return;
        }
        // In f64: a corner may be so far away that rounding would put the cut behind the camera.
        let guard = guard.as_dvec2();
        let mut polygon = corners.map(Vec3::as_dvec3).to_vec();
        clip(&mut polygon, |p| p.z - f64::from(NEAR));
        clip(&mut polygon, |p| guard.x * p.z - p.x);
        clip(&mut polygon, |p| guard.x * p.z + p.x);
        clip(&mut polygon, |p| guard.y * p.z - p.y);
        clip(&mut polygon, |p| guard.y * p.z + p.y);
        for pair in polygon.windows(2).skip(1) {
            self.add(face, [polygon[0], pair[0], pair[1]].map(DVec3::as_vec3), block);
        }
    }

    fn add(&self, face: u32, corners: [Vec3; 3], block: &mut Block) {
        let scale = self.samples as f32 * SNAP as f32;
        let mut points = corners.map(|corner| {
            let Vec2 { x, y } = self.projection.project(corner) * scale;
            [x.round() as i64, y.round() as i64]
        });
        let mut inverse_depths = corners.map(|corner| 1.0 / corner.z);
        let area = edge(points[0], points[1], points[2]);
        if area == 0 {
            return;
        }
        if area < 0 {
            points.swap(1, 2);
            inverse_depths.swap(1, 2);
        }
        let triangle = ScreenTriangle { face, points, inverse_depths };
        let ([left, right], [top, bottom]) = (triangle.span(0, self.columns), triangle.span(1, self.rows));
        if left > right || top > bottom {
            return;
        }
        let index = block.triangles.len() as u32;
        let band_samples = i64::from(BAND_ROWS * self.samples);
        for band in &mut block.bands[(top / band_samples) as usize..=(bottom / band_samples) as usize] {
            band.push(index);
        }
        block.triangles.push(triangle);
    }
}

impl ScreenTriangle {
    /// The first and last sample, below `count`, whose centres lie in the triangle's extent along `axis`.
    fn span(&self, axis: usize, count: i64) -> [i64; 2] {
        let [a, b, c] = self.points.map(|point| point[axis]);
        let first = (a.min(b).min(c) + SNAP / 2 - 1).div_euclid(SNAP);
        let last = (a.max(b).max(c) - SNAP / 2).div_euclid(SNAP);
        [first.max(0), last.min(count - 1)]
    }

    fn draw(&self, band: &mut Band, band_top: i64) {
        let rows = (band.faces.len() / band.stride) as i64;
        let [left, right] = self.span(0, band.stride as i64);
        let [top, bottom] = self.span(1, band_top + rows);
        let [a, b, c] = self.points;
        let edges = [[b, c], [c, a], [a, b]];
        let inverse_area = 1.0 / edge(a, b, c) as f32;
        let weights = self.inverse_depths.map(|inverse_depth| inverse_depth * inverse_area);
        let steps = edges.map(|[from, to]| (from[1] - to[1]) * SNAP);
        for row in top.max(band_top)..=bottom {
            let centre = [left * SNAP + SNAP / 2, row * SNAP + SNAP / 2];
            let mut values = edges.map(|[from, to]| edge(from, to, centre) - i64::from(!owns_its_samples(from, to)));
            let start = (row - band_top) as usize * band.stride;
            for sample in start + left as usize..=start + right as usize {
                if (values[0] | values[1] | values[2]) >= 0 {
                    let inverse_depth =
                        values[0] as f32 * weights[0] + values[1] as f32 * weights[1] + values[2] as f32 * weights[2];
                    if inverse_depth > band.inverse_depths[sample] {
                        band.inverse_depths[sample] = inverse_depth;
                        band.faces[sample] = self.face;
                    }
                }
                for (value, step) in values.iter_mut().zip(steps) {
                    *value += step;
                }
            }
        }
    }
}

/// Twice the signed area of (from, to, point); positive on the inner side of a triangle's edges.
fn edge(from: [i64; 2], to: [i64; 2], point: [i64; 2]) -> i64 {
    (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0])
}

/// The top-left rule: of two triangles that share an edge through a sample, exactly one draws it.
fn owns_its_samples(from: [i64; 2], to: [i64; 2]) -> bool {
    to[1] < from[1] || (to[1] == from[1] && to[0] > from[0])
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
