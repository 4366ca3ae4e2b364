//! Which face each sample of a picture sees: a z-buffer over bands of rows.
//!
//! A pixel has N samples, one in each of N rows of 1/N pixel, at the columns of its [`Pattern`]. Edge functions are exact
//! integers on a grid of 1/512 pixel with the top-left rule, so that faces sharing an edge neither leave gaps nor overlap. Depth
//! is compared as 1 / z, which is linear over the picture; of equal depths the face that comes first in the mesh wins. Both sides
//! of a face are drawn. Columns and rows count from the picture's upper left corner.

use std::ops::{Add, BitOr, Mul, Range, Sub};

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use xavatar_vector::vectorised;

use super::projection::{Block, SNAP, ScreenTriangle, project};
use xavatar_mesh::camera::PinholeCamera;

/// Rows of pixels that one task draws.
const BAND_ROWS: usize = 8;

/// A sample that sees nothing.
pub(super) const EMPTY: u32 = u32::MAX;

/// The column of the sample in each N-th of a pixel's height, in units of 1/512 pixel, none in the outer 1/2N of the pixel. N
/// divides 512.
pub(super) type Pattern<const N: usize> = [i32; N];

/// One sample, in the centre of the pixel.
pub(super) const CENTRE: Pattern<1> = [256];
/// Eight samples that share no row and no column: nearly upright and nearly level edges get nine levels of grey.
pub(super) const ROOKS: Pattern<8> = [480, 160, 288, 32, 416, 224, 96, 352];

/// Where a sample lies in its pixel, from its upper left corner, units of 1/512 pixel.
#[inline(always)]
fn place_in_pixel<const N: usize>(pattern: &Pattern<N>, sample: usize) -> [i32; 2] {
    let height = SNAP / N as i32;
    [pattern[sample], sample as i32 * height + height / 2]
}

/// Where a sample lies in its pixel, from its upper left corner, pixels.
pub(super) fn sample_place<const N: usize>(pattern: &Pattern<N>, sample: usize) -> Vec2 {
    Vec2::from(place_in_pixel(pattern, sample).map(|place| place as f32 / SNAP as f32))
}

/// The faces of a mesh, projected and sorted into bands of rows.
pub(super) struct Rasterizer<const N: usize> {
    width: usize,
    height: usize,
    pattern: Pattern<N>,
    blocks: Vec<Block>,
}

/// What the samples of a pixel see.
#[derive(Clone, Copy)]
pub(super) struct Pixel<const N: usize> {
    /// The faces, or [`EMPTY`].
    pub faces: [u32; N],
    /// 1 / z, 1 / metres; 0 where empty.
    pub inverse_depths: [f32; N],
}

impl<const N: usize> Pixel<N> {
    /// A pixel that sees nothing.
    const EMPTY: Self = Self { faces: [EMPTY; N], inverse_depths: [0.0; N] };
}

/// A band of rows, after drawing.
pub(super) struct Band<const N: usize> {
    /// The first row of pixels.
    pub first_row: usize,
    /// Columns outside of which every sample is empty.
    pub columns: Range<usize>,
    width: usize,
    /// (rows, width); only those in `columns` are of this band.
    pixels: Vec<Pixel<N>>,
}

impl<const N: usize> Band<N> {
    /// The pixels of a row in the band's columns; `row` counts from the band's first.
    pub fn row(&self, row: usize) -> &[Pixel<N>] {
        &self.pixels[row * self.width..][self.columns.clone()]
    }
}

impl<const N: usize> Rasterizer<N> {
    /// How far samples are from their pixel's edges, at least.
    const MARGIN: i32 = SNAP / (2 * N as i32);

    /// Projects the faces over `points` (camera space, within 1000 km, indices in range) onto the picture of a checked camera.
    pub fn new(points: &[Vec3], faces: &[[u32; 3]], camera: &PinholeCamera, pattern: Pattern<N>) -> Self {
        let blocks = project(points, faces, camera, BAND_ROWS, Self::MARGIN);
        Self { width: camera.width as usize, height: camera.height as usize, pattern, blocks }
    }

    /// Draws every band and hands it to `finish` with its rows of `picture`, `channels` elements a pixel.
    pub fn draw<T: Send>(&self, picture: &mut [T], channels: usize, finish: impl Fn(&Band<N>, &mut [T]) + Sync) {
        let rows = picture.par_chunks_mut(self.width * channels * BAND_ROWS).enumerate();
        rows.for_each_init(
            || Band {
                first_row: 0,
                columns: 0..0,
                width: self.width,
                pixels: vec![Pixel::EMPTY; BAND_ROWS * self.width],
            },
            |band, (index, pixels)| {
                self.draw_band(index, band);
                finish(band, pixels);
            },
        );
    }

    fn draw_band(&self, index: usize, band: &mut Band<N>) {
        band.first_row = index * BAND_ROWS;
        let rows = BAND_ROWS.min(self.height - band.first_row);
        let lists = || self.blocks.iter().map(|block| &block.bands[index]);
        let left = lists().map(|list| list.left).min().unwrap_or(usize::MAX);
        let right = lists().map(|list| list.right).max().unwrap_or(0);
        band.columns = if left < right { left..right } else { 0..0 };
        for row in band.pixels.chunks_exact_mut(self.width) {
            row[band.columns.clone()].fill(Pixel::EMPTY);
        }
        let lists = self.blocks.iter().map(|block| (&block.bands[index].triangles, &block.triangles));
        let triangles = lists.flat_map(|(list, triangles)| list.iter().map(|&triangle| &triangles[triangle as usize]));
        vectorised(
            #[inline(always)]
            || {
                for triangle in triangles {
                    let drawn = triangle.pixels(1, self.height, Self::MARGIN);
                    let rows = drawn.start.max(band.first_row)..drawn.end.min(band.first_row + rows);
                    let columns = triangle.pixels(0, self.width, Self::MARGIN);
                    if triangle.is_small() {
                        draw_triangle::<i32, N>(triangle, columns, rows, &self.pattern, band);
                    } else {
                        draw_triangle::<i64, N>(triangle, columns, rows, &self.pattern, band);
                    }
                }
            },
        );
    }
}

/// Integers that hold the values of a triangle's edge functions.
trait Integer:
    Copy + PartialOrd + From<i32> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + BitOr<Output = Self>
{
}
impl Integer for i32 {}
impl Integer for i64 {}

/// Draws the part of a triangle in these columns and rows of pixels, the rows in `band`.
#[inline(always)]
fn draw_triangle<T: Integer, const N: usize>(
    triangle: &ScreenTriangle,
    columns: Range<usize>,
    rows: Range<usize>,
    pattern: &Pattern<N>,
    band: &mut Band<N>,
) {
    // Places count from the first pixel's corner.
    let origin = [columns.start as i32 * SNAP, rows.start as i32 * SNAP];
    let points = triangle.points.map(
        #[inline(always)]
        |[x, y]| [x - origin[0], y - origin[1]],
    );
    let [a, b, c] = points;
    let edges = [Edge::<T, N>::new(b, c, pattern), Edge::new(c, a, pattern), Edge::new(a, b, pattern)];
    let plane = DepthPlane::through(triangle, points);
    let mut rises = [0.0; N];
    for (sample, rise) in rises.iter_mut().enumerate() {
        *rise = plane.rise(place_in_pixel(pattern, sample));
    }
    let (zero, face) = (T::from(0), triangle.face);
    let mut first_values = [edges[0].first, edges[1].first, edges[2].first];
    for row in rows {
        let mut values = first_values;
        let start = (row - band.first_row) * band.width;
        let mut corner = [0, row as i32 * SNAP - origin[1]];
        for pixel in &mut band.pixels[start + columns.start..start + columns.end] {
            let mut covered = [zero; N];
            for (sample, covered) in covered.iter_mut().enumerate() {
                *covered = (values[0] + edges[0].offsets[sample])
                    | (values[1] + edges[1].offsets[sample])
                    | (values[2] + edges[2].offsets[sample]);
            }
            let mut any = false;
            for sample in covered {
                any |= sample >= zero;
            }
            if any {
                let inverse_depth = plane.origin + plane.rise(corner);
                // Whole pixels are read and written: eight samples are one vector.
                let mut seen = *pixel;
                for sample in 0..N {
                    let inverse_depth = plane.within(inverse_depth + rises[sample]);
                    if (covered[sample] >= zero) & (inverse_depth > seen.inverse_depths[sample]) {
                        seen.inverse_depths[sample] = inverse_depth;
                        seen.faces[sample] = face;
                    }
                }
                *pixel = seen;
            }
            for edge in 0..3 {
                values[edge] = values[edge] + edges[edge].right;
            }
            corner[0] += SNAP;
        }
        for edge in 0..3 {
            first_values[edge] = first_values[edge] + edges[edge].down;
        }
    }
}

/// Twice the signed area of (from, to, place), an affine function of the place; lowered by one where samples on the edge are not
/// ours.
struct Edge<T, const N: usize> {
    /// At the corner of the first pixel.
    first: T,
    /// From a pixel to the next.
    right: T,
    down: T,
    /// From a pixel's corner to its samples.
    offsets: [T; N],
}

impl<T: Integer, const N: usize> Edge<T, N> {
    #[inline(always)]
    fn new(from: [i32; 2], to: [i32; 2], pattern: &Pattern<N>) -> Self {
        // The top-left rule: of two triangles that share an edge through a sample, exactly one draws it.
        let ours = to[1] < from[1] || (to[1] == from[1] && to[0] > from[0]);
        let (x, y) = (T::from(from[1] - to[1]), T::from(to[0] - from[0]));
        let mut offsets = [T::from(0); N];
        for (sample, offset) in offsets.iter_mut().enumerate() {
            let place = place_in_pixel(pattern, sample);
            *offset = x * T::from(place[0]) + y * T::from(place[1]);
        }
        let first = T::from(-i32::from(!ours)) - x * T::from(from[0]) - y * T::from(from[1]);
        Self { first, right: x * T::from(SNAP), down: y * T::from(SNAP), offsets }
    }
}

/// 1 / z over a triangle, 1 / metres; places in units of 1/512 pixel.
struct DepthPlane {
    /// At the place (0, 0).
    origin: f32,
    gradient: [f32; 2],
    farthest: f32,
    nearest: f32,
}

impl DepthPlane {
    /// Of a triangle whose corners lie at `points`.
    #[inline(always)]
    fn through(triangle: &ScreenTriangle, points: [[i32; 2]; 3]) -> Self {
        let [depth, of_b, of_c] = triangle.inverse_depths;
        let [a, b, c] = points;
        let area = triangle.area() as f32;
        let (rise_b, rise_c) = ((of_b - depth) / area, (of_c - depth) / area);
        let difference = |from: i32, to: i32| (to - from) as f32;
        let gradient = [
            difference(a[1], c[1]) * rise_b - difference(a[1], b[1]) * rise_c,
            difference(a[0], b[0]) * rise_c - difference(a[0], c[0]) * rise_b,
        ];
        let origin = depth - gradient[0] * a[0] as f32 - gradient[1] * a[1] as f32;
        let (farthest, nearest) = (depth.min(of_b).min(of_c), depth.max(of_b).max(of_c));
        Self { origin, gradient, farthest, nearest }
    }

    /// How much more it is at a place than at (0, 0).
    #[inline(always)]
    fn rise(&self, place: [i32; 2]) -> f32 {
        self.gradient[0] * place[0] as f32 + self.gradient[1] * place[1] as f32
    }

    /// A sliver's gradient is steep, and rounding must not carry its depth out of the triangle.
    #[inline(always)]
    fn within(&self, inverse_depth: f32) -> f32 {
        // Comparisons, because `max` and `min` cost more for the sake of NaNs, which there are none of.
        let inverse_depth = if inverse_depth > self.farthest { inverse_depth } else { self.farthest };
        if inverse_depth < self.nearest { inverse_depth } else { self.nearest }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::projection::SMALL;
    use super::*;

    const SIDE: usize = 64;

    fn drawn(triangle: &ScreenTriangle, draw: impl Fn(&ScreenTriangle, [Range<usize>; 2], &mut Band<8>)) -> Band<8> {
        let pixels = vec![Pixel::EMPTY; SIDE * SIDE];
        let mut band = Band { first_row: 0, columns: 0..SIDE, width: SIDE, pixels };
        draw(triangle, [0, 1].map(|axis| triangle.pixels(axis, SIDE, Rasterizer::<8>::MARGIN)), &mut band);
        band
    }

    proptest! {
        // An edge function written out: a sample is covered where it lies to the left of all edges, or on one of ours.
        #[test]
        fn samples_covered_by_narrow_and_by_wide_integers_are_those_within_the_triangle(
            corners in proptest::array::uniform3(proptest::array::uniform2(0..SMALL)),
            shift in -SMALL..SMALL,
        ) {
            let points = corners.map(|[x, y]| [x + shift, y]);
            let mut triangle = ScreenTriangle { face: 7, points, inverse_depths: [1.0, 0.5, 0.25] };
            if triangle.area() < 0 {
                triangle.points.swap(1, 2);
            }
            prop_assume!(triangle.area() != 0 && triangle.is_small());
            let narrow = drawn(&triangle, |triangle, [columns, rows], band| {
                draw_triangle::<i32, 8>(triangle, columns, rows, &ROOKS, band);
            });
            let wide = drawn(&triangle, |triangle, [columns, rows], band| {
                draw_triangle::<i64, 8>(triangle, columns, rows, &ROOKS, band);
            });
            let [a, b, c] = triangle.points;
            for (index, (pixel, other)) in narrow.pixels.iter().zip(&wide.pixels).enumerate() {
                prop_assert_eq!((pixel.faces, pixel.inverse_depths), (other.faces, other.inverse_depths));
                for sample in 0..8 {
                    let [x, y] = place_in_pixel(&ROOKS, sample);
                    let place = [(index % SIDE) as i32 * SNAP + x, (index / SIDE) as i32 * SNAP + y];
                    let within = [[a, b], [b, c], [c, a]].iter().all(|&[from, to]| {
                        match (ScreenTriangle { face: 0, points: [from, to, place], inverse_depths: [1.0; 3] }).area() {
                            0 => to[1] < from[1] || (to[1] == from[1] && to[0] > from[0]),
                            area => area > 0,
                        }
                    });
                    prop_assert_eq!(pixel.faces[sample] == 7, within);
                }
            }
        }
    }
}
