//! Which face each sample of a picture sees: perspective projection, clipping, and a z-buffer over bands of rows.
//!
//! A pixel has N samples, one in each of N rows of 1/N pixel, at the columns of its [`Pattern`]. Edge functions are exact
//! integers on a grid of 1/512 pixel with the top-left rule, so that faces sharing an edge neither leave gaps nor overlap. Depth
//! is compared as 1 / z, which is linear over the picture; of equal depths the face that comes first in the mesh wins. Both sides
//! of a face are drawn. F faces; columns and rows count from the picture's upper left corner.

use std::ops::Range;

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use crate::camera::PinholeCamera;

/// What lies nearer to the camera is cut off, metres.
const NEAR: f32 = 0.01;
/// Subdivisions of a pixel that vertices snap to.
const SNAP: i64 = 512;
/// Faces that reach beyond this many half pictures from the centre are cut there, which bounds the integers.
const GUARD: f32 = 3.0;
/// Rows of pixels that one task draws.
const BAND_ROWS: u32 = 8;
/// Faces that one task projects.
const FACE_BLOCK: usize = 4096;

/// A sample that sees nothing.
pub(super) const EMPTY: u32 = u32::MAX;

/// The column of the sample in each N-th of a pixel's height, in units of 1/512 pixel. N divides 512.
pub(super) type Pattern<const N: usize> = [i64; N];

/// One sample, in the centre of the pixel.
pub(super) const CENTRE: Pattern<1> = [256];
/// Eight samples that share no row and no column: nearly upright and nearly level edges get nine levels of grey.
pub(super) const ROOKS: Pattern<8> = [480, 160, 288, 32, 416, 224, 96, 352];

/// Where a sample lies in its pixel, from its upper left corner, pixels.
pub(super) fn sample_place<const N: usize>(pattern: &Pattern<N>, sample: usize) -> Vec2 {
    Vec2::new(pattern[sample] as f32 / SNAP as f32, (sample as f32 + 0.5) / N as f32)
}

/// The faces of a mesh, projected and sorted into bands of rows.
pub(super) struct Rasterizer<const N: usize> {
    width: u32,
    height: u32,
    pattern: Pattern<N>,
    blocks: Vec<Block>,
}

/// The drawable triangles of some consecutive faces, and which of them touch each band.
struct Block {
    triangles: Vec<ScreenTriangle>,
    bands: Vec<Vec<u32>>,
}

/// A triangle on the snapped grid with positive area.
struct ScreenTriangle {
    face: u32,
    points: [[i64; 2]; 3],
    inverse_depths: [f32; 3],
}

/// The samples of a band of rows, after drawing.
pub(super) struct Band<const N: usize> {
    /// The first row of pixels.
    pub first_row: u32,
    /// Columns outside of which every sample is empty.
    pub columns: Range<usize>,
    width: usize,
    /// The face that each sample sees, or [`EMPTY`]: (rows, N, width).
    faces: Vec<u32>,
    /// 1 / z of each sample, likewise.
    inverse_depths: Vec<f32>,
}

impl<const N: usize> Band<N> {
    /// What the samples of a pixel see; `row` counts from the band's first.
    pub fn faces(&self, row: usize, column: usize) -> [u32; N] {
        std::array::from_fn(|sample| self.faces[(row * N + sample) * self.width + column])
    }

    /// 1 / z of a pixel's samples, 1 / metres; 0 where empty.
    pub fn inverse_depths(&self, row: usize, column: usize) -> [f32; N] {
        std::array::from_fn(|sample| self.inverse_depths[(row * N + sample) * self.width + column])
    }
}

impl<const N: usize> Rasterizer<N> {
    /// Projects the faces over `points` (camera space, within 1000 km, indices in range) onto the picture of a checked camera.
    pub fn new(points: &[Vec3], faces: &[[u32; 3]], camera: &PinholeCamera, pattern: Pattern<N>) -> Self {
        let PinholeCamera { width, height, .. } = *camera;
        let bands = height.div_ceil(BAND_ROWS) as usize;
        let corners = [Vec2::ZERO, Vec2::new(width as f32, height as f32)];
        let extent = corners.map(|corner| camera.ray(corner).truncate());
        let centre = (extent[0] + extent[1]) / 2.0;
        let guard = extent.map(|corner| centre + (corner - centre) * GUARD);
        let grid = Grid { camera, extent, guard, samples: N as i64 };
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
        Self { width, height, pattern, blocks }
    }

    /// Draws every band and hands it to `finish` with its rows of `picture`, `channels` elements a pixel.
    pub fn draw<T: Send>(&self, picture: &mut [T], channels: usize, finish: impl Fn(&Band<N>, &mut [T]) + Sync) {
        let width = self.width as usize;
        let rows = picture.par_chunks_mut(width * channels * BAND_ROWS as usize).enumerate();
        rows.for_each_init(
            || Band { first_row: 0, columns: 0..0, width, faces: Vec::new(), inverse_depths: Vec::new() },
            |band, (index, pixels)| {
                self.draw_band(index, band);
                finish(band, pixels);
            },
        );
    }

    fn draw_band(&self, index: usize, band: &mut Band<N>) {
        band.first_row = index as u32 * BAND_ROWS;
        let rows = BAND_ROWS.min(self.height - band.first_row) as usize * N;
        let triangles =
            || self.blocks.iter().flat_map(|block| block.bands[index].iter().map(|&i| &block.triangles[i as usize]));
        let reach = triangles().fold(None, |reach: Option<[i64; 2]>, triangle| {
            let [left, right] = triangle.extent(0);
            Some(reach.map_or([left, right], |[low, high]| [low.min(left), high.max(right)]))
        });
        let column = |place: i64| (place.div_euclid(SNAP)).clamp(0, self.width as i64) as usize;
        band.columns = reach.map_or(0..0, |[left, right]| column(left)..column(right + SNAP));
        band.faces.resize(rows * band.width, EMPTY);
        band.inverse_depths.resize(rows * band.width, 0.0);
        for row in 0..rows {
            let samples = row * band.width + band.columns.start..row * band.width + band.columns.end;
            band.faces[samples.clone()].fill(EMPTY);
            band.inverse_depths[samples].fill(0.0);
        }
        let first = i64::from(band.first_row) * N as i64;
        for triangle in triangles() {
            triangle.draw(band, first..first + rows as i64, &self.pattern);
        }
    }
}

/// The grid that triangles are projected to.
struct Grid<'a> {
    camera: &'a PinholeCamera,
    /// Lowest and highest x / z and y / z in the picture.
    extent: [Vec2; 2],
    /// The same where faces are cut.
    guard: [Vec2; 2],
    /// N: rows of samples in a row of pixels.
    samples: i64,
}

impl Grid<'_> {
    /// Adds the visible part of a face to `block`: nothing, one triangle, or the fan of a clipped polygon.
    fn project(&self, face: u32, corners: [Vec3; 3], block: &mut Block) {
        let [low, high] = self.extent;
        let beyond = |test: &dyn Fn(Vec3) -> bool| corners.iter().all(|&corner| test(corner));
        if beyond(&|p| p.z < NEAR)
            || beyond(&|p| p.x > high.x * p.z)
            || beyond(&|p| p.x < low.x * p.z)
            || beyond(&|p| p.y > high.y * p.z)
            || beyond(&|p| p.y < low.y * p.z)
        {
            return;
        }
        let [low, high] = self.guard;
        let inside = |p: &Vec3| {
            let place = p.truncate();
            p.z >= NEAR && place.cmple(high * p.z).all() && place.cmpge(low * p.z).all()
        };
        if corners.iter().all(inside) {
            self.add(face, corners, block);
            return;
        }
        // In f64: a corner may be so far away that rounding would put the cut behind the camera.
        let (low, high) = (low.as_dvec2(), high.as_dvec2());
        let mut polygon = corners.map(Vec3::as_dvec3).to_vec();
        clip(&mut polygon, |p| p.z - f64::from(NEAR));
        clip(&mut polygon, |p| high.x * p.z - p.x);
        clip(&mut polygon, |p| p.x - low.x * p.z);
        clip(&mut polygon, |p| high.y * p.z - p.y);
        clip(&mut polygon, |p| p.y - low.y * p.z);
        for pair in polygon.windows(2).skip(1) {
            self.add(face, [polygon[0], pair[0], pair[1]].map(DVec3::as_vec3), block);
        }
    }

    fn add(&self, face: u32, corners: [Vec3; 3], block: &mut Block) {
        let mut points = corners.map(|corner| {
            let PinholeCamera { fx, fy, cx, cy, .. } = *self.camera;
            let place = [fx * corner.x / corner.z + cx, fy * corner.y / corner.z + cy];
            place.map(|coordinate| (coordinate * SNAP as f32).round() as i64)
        });
        let mut inverse_depths = corners.map(|corner| 1.0 / corner.z);
        let [a, b, c] = points;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0 {
            return;
        }
        if area < 0 {
            points.swap(1, 2);
            inverse_depths.swap(1, 2);
        }
        let triangle = ScreenTriangle { face, points, inverse_depths };
        let ([left, right], rows) = (triangle.extent(0), triangle.rows(self.samples));
        let band_rows = self.samples * i64::from(BAND_ROWS);
        let (top, bottom) = (rows.start.max(0) / band_rows, rows.end.min(band_rows * block.bands.len() as i64));
        if right < 0 || left > i64::from(self.camera.width) * SNAP || rows.start >= bottom || bottom <= 0 {
            return;
        }
        let index = block.triangles.len() as u32;
        for band in &mut block.bands[top as usize..=((bottom - 1) / band_rows) as usize] {
            band.push(index);
        }
        block.triangles.push(triangle);
    }
}

impl ScreenTriangle {
    /// Lowest and highest coordinate along `axis`.
    fn extent(&self, axis: usize) -> [i64; 2] {
        let [a, b, c] = self.points.map(|point| point[axis]);
        [a.min(b).min(c), a.max(b).max(c)]
    }

    /// The rows of samples, `samples` in a pixel, whose centres lie within the triangle's height.
    fn rows(&self, samples: i64) -> Range<i64> {
        let [top, bottom] = self.extent(1);
        let height = SNAP / samples;
        // Rows lie at height * (row + 1/2).
        (top + height / 2 - 1).div_euclid(height)..(bottom - height / 2).div_euclid(height) + 1
    }

    /// Draws the part in `rows` of samples, which are those of `band`.
    fn draw<const N: usize>(&self, band: &mut Band<N>, rows: Range<i64>, pattern: &Pattern<N>) {
        let [a, b, c] = self.points;
        // Twice the signed area of (from, to, point) as an affine function, lowered where samples on the edge are not ours.
        let edges = [[b, c], [c, a], [a, b]].map(|[from, to]| {
            let (x, y) = (from[1] - to[1], to[0] - from[0]);
            (x, y, -x * from[0] - y * from[1] - i64::from(!owns_its_samples(from, to)))
        });
        let area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) as f32;
        let [depth, of_b, of_c] = self.inverse_depths;
        let (rise_b, rise_c) = ((of_b - depth) / area, (of_c - depth) / area);
        let gradient = [0, 1].map(|axis| {
            let slope = |edge: (i64, i64, i64)| [edge.0, edge.1][axis] as f32;
            slope(edges[1]) * rise_b + slope(edges[2]) * rise_c
        });
        let (farthest, nearest) = (depth.min(of_b).min(of_c), depth.max(of_b).max(of_c));
        let [left, right] = self.extent(0);
        let steps = edges.map(|edge| edge.0 * SNAP);
        let height = SNAP / N as i64;
        let drawn = self.rows(N as i64);
        for row in drawn.start.max(rows.start)..drawn.end.min(rows.end) {
            let offset = pattern[row as usize % N];
            let first = (left - offset + SNAP - 1).div_euclid(SNAP).max(0);
            let last = (right - offset).div_euclid(SNAP).min(band.width as i64 - 1);
            if first > last {
                continue;
            }
            let (x, y) = (first * SNAP + offset, row * height + height / 2);
            let mut values = edges.map(|edge| edge.0 * x + edge.1 * y + edge.2);
            let mut inverse_depth = depth + gradient[0] * (x - a[0]) as f32 + gradient[1] * (y - a[1]) as f32;
            let start = (row - rows.start) as usize * band.width;
            let samples = start + first as usize..=start + last as usize;
            let places = band.faces[samples.clone()].iter_mut().zip(&mut band.inverse_depths[samples]);
            for (face, nearest_yet) in places {
                if (values[0] | values[1] | values[2]) >= 0 {
                    // A sliver's gradient is steep, and rounding must not carry its depth out of the triangle.
                    let inverse_depth = inverse_depth.max(farthest).min(nearest);
                    if inverse_depth > *nearest_yet {
                        (*nearest_yet, *face) = (inverse_depth, self.face);
                    }
                }
                for (value, step) in values.iter_mut().zip(steps) {
                    *value += step;
                }
                inverse_depth += gradient[0] * SNAP as f32;
            }
        }
    }
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
