//! The field's colours as an image: each texel has the colour of the field at the place on the surface that it shows.
//!
//! A texel whose centre is just outside every chart shows the plane of the nearest face, so that bilinear look-ups at a seam
//! mix colours of the surface only; the rest of the image repeats the nearest of those, so that mipmaps bleed nothing. S points.

use std::fmt::{self, Display, Formatter};

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::rig::RiggedMesh;
use super::unwrap::Unwrapped;
use crate::Result;
use crate::avatar::Avatar;
use crate::mesh::{SurfaceSampler, TriangleMesh};

/// Between charts there is twice this, texels: mipmaps down to an eighth of the size stay apart.
const PADDING: u32 = 4;
/// Points at which colours are compared.
const SAMPLES: usize = 100_000;
/// Texels that are asked of the field at a time.
const BATCH: usize = 1 << 17;
/// How far outside a face a texel's centre counts as inside, in barycentric coordinates.
const ROUNDING: f32 = 1e-5;
/// No face.
const NONE: u32 = u32::MAX;

/// How well a texture shows the field's colours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TextureReport {
    /// Columns of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
    /// Charts that the surface was cut into.
    pub charts: u32,
    /// Share of the image that shows surface.
    pub coverage: f64,
    /// Texels along a metre of the surface.
    pub texels_per_metre: f32,
    /// Peak signal-to-noise ratio of the texture against the field at random points of the surface, dB.
    pub psnr: f64,
    /// The same of the vertex colours that it replaces, dB.
    pub vertex_psnr: f64,
}

impl Display for TextureReport {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self { width, height, charts, coverage, texels_per_metre, psnr, vertex_psnr } = self;
        let covered = 100.0 * coverage;
        write!(
            formatter,
            "texture {width} x {height}, {charts} charts, {covered:.0} % covered, {texels_per_metre:.0} texels a metre; "
        )?;
        write!(formatter, "PSNR against the field {psnr:.1} dB ({vertex_psnr:.1} dB with vertex colours)")
    }
}

impl RiggedMesh {
    /// The rig with a texture of at most `size` x `size` texels baked from the avatar it was made of, instead of vertex
    /// colours. `progress` hears of texels done and their number.
    ///
    /// # Errors
    /// [`InputError::Value`](crate::InputError::Value) if the charts do not fit the size; as [`Avatar::colours`].
    pub fn with_texture(
        self,
        avatar: &Avatar,
        size: u32,
        progress: impl FnMut(usize, usize),
    ) -> Result<(Self, TextureReport)> {
        let Baked { mesh, sources, report } = bake_texture(avatar, &self.mesh, size, progress)?;
        Ok((self.on_vertices(mesh, &sources), report))
    }
}

/// A mesh that got a texture.
#[derive(Clone, Debug)]
pub struct Baked {
    /// The same faces in the same order; vertices on seams have become several.
    pub mesh: TriangleMesh,
    /// Which vertex of the mesh each of its vertices was (V).
    pub sources: Vec<u32>,
    /// How good the texture is.
    pub report: TextureReport,
}

/// Bakes a texture of at most `size` x `size` texels for `mesh`, a canonical surface of `avatar`. `progress` hears of texels
/// done and their number.
///
/// # Errors
/// As [`RiggedMesh::with_texture`].
pub fn bake_texture(
    avatar: &Avatar,
    mesh: &TriangleMesh,
    size: u32,
    mut progress: impl FnMut(usize, usize),
) -> Result<Baked> {
    let charts = Charts::new(mesh, size)?;
    let textured = charts.painted(mesh, |points| avatar.colours(points), &mut progress)?;
    let Charts { unwrapped, inside, .. } = charts;
    let (psnr, vertex_psnr) = (fidelity(avatar, &textured)?, fidelity(avatar, mesh)?);
    let report = TextureReport {
        width: unwrapped.width,
        height: unwrapped.height,
        charts: unwrapped.charts,
        coverage: inside as f64 / (f64::from(unwrapped.width) * f64::from(unwrapped.height)),
        texels_per_metre: unwrapped.texels_per_metre,
        psnr,
        vertex_psnr,
    };
    Ok(Baked { mesh: textured, sources: unwrapped.sources, report })
}

/// The charts of a surface and the face that each texel shows: made once for all of the surface's poses.
#[derive(Clone, Debug)]
pub struct Charts {
    unwrapped: Unwrapped,
    /// Row by row; [`NONE`] where there is no surface.
    faces: Vec<u32>,
    /// Texels whose centre is on the surface.
    inside: usize,
}

impl Charts {
    /// Cuts `mesh` into charts on an image of at most `size` x `size` texels.
    ///
    /// # Errors
    /// [`InputError::Value`](crate::InputError::Value) if they do not fit.
    pub fn new(mesh: &TriangleMesh, size: u32) -> Result<Self> {
        let unwrapped = Unwrapped::new(mesh, size, PADDING)?;
        let (width, height) = (unwrapped.width as usize, unwrapped.height as usize);
        let mut texels = Self { unwrapped, faces: vec![NONE; width * height], inside: 0 };
        for face in 0..mesh.faces.len() as u32 {
            let corners = texels.corners(face);
            let low = corners[0].min(corners[1]).min(corners[2]).max(Vec2::ZERO);
            let high = corners[0].max(corners[1]).max(corners[2]);
            for row in low.y as usize..(high.y as usize + 1).min(height) {
                for column in low.x as usize..(high.x as usize + 1).min(width) {
                    let shares = barycentric(corners, centre(column, row));
                    if shares.is_some_and(|shares| shares.min_element() >= -ROUNDING) {
                        texels.faces[row * width + column] = face;
                    }
                }
            }
        }
        texels.inside = texels.faces.iter().filter(|face| **face != NONE).count();
        texels.widen();
        Ok(texels)
    }

    /// `mesh`, the surface in any pose, with a texture of the `colours` of its places. `progress` hears of texels done and their number.
    ///
    /// # Errors
    /// Those of `colours`.
    pub fn painted(
        &self,
        mesh: &TriangleMesh,
        colours: impl Fn(&[Vec3]) -> Result<Vec<[u8; 3]>>,
        mut progress: impl FnMut(usize, usize),
    ) -> Result<TriangleMesh> {
        let Unwrapped { width, height, .. } = self.unwrapped;
        let places: Vec<(usize, Vec3)> = self.places(mesh);
        let mut image = RgbImage::new(width, height);
        let mut done = 0;
        for batch in places.chunks(BATCH) {
            let points: Vec<Vec3> = batch.iter().map(|(_, point)| *point).collect();
            for ((texel, _), colour) in batch.iter().zip(colours(&points)?) {
                image.put_pixel(*texel as u32 % width, *texel as u32 / width, Rgb(colour));
            }
            done += batch.len();
            progress(done, places.len());
        }
        spread(&mut image, places.iter().map(|(texel, _)| *texel));
        Ok(self.unwrapped.textured(mesh, image))
    }

    /// Texels beside the surface show the face of a neighbour.
    fn widen(&mut self) {
        let (width, height) = (self.unwrapped.width as usize, self.unwrapped.height as usize);
        let inside = self.faces.clone();
        for (texel, face) in self.faces.iter_mut().enumerate().filter(|(_, face)| **face == NONE) {
            let shown = neighbours(texel, width, height).map(|neighbour| inside[neighbour]).find(|face| *face != NONE);
            *face = shown.unwrap_or(NONE);
        }
    }

    /// The texels that show surface, and the places on `mesh` that they show.
    fn places(&self, mesh: &TriangleMesh) -> Vec<(usize, Vec3)> {
        let width = self.unwrapped.width as usize;
        let place = |(texel, face): (usize, &u32)| {
            let shares = barycentric(self.corners(*face), centre(texel % width, texel / width))?;
            let [a, b, c] = mesh.corners(*face);
            Some((texel, a * shares.x + b * shares.y + c * shares.z))
        };
        self.faces.iter().enumerate().filter(|(_, face)| **face != NONE).filter_map(place).collect()
    }

    /// A face's corners, texels.
    fn corners(&self, face: u32) -> [Vec2; 3] {
        let size = Vec2::new(self.unwrapped.width as f32, self.unwrapped.height as f32);
        self.unwrapped.faces[face as usize].map(|vertex| self.unwrapped.uvs[vertex as usize] * size)
    }
}

fn centre(column: usize, row: usize) -> Vec2 {
    Vec2::new(column as f32 + 0.5, row as f32 + 0.5)
}

/// The weights of the corners that make up a point of their plane; none for a triangle without area.
fn barycentric([a, b, c]: [Vec2; 3], point: Vec2) -> Option<Vec3> {
    let area = (b - a).perp_dot(c - a);
    let (v, w) = ((point - a).perp_dot(c - a) / area, (b - a).perp_dot(point - a) / area);
    let shares = Vec3::new(1.0 - v - w, v, w);
    (area != 0.0 && shares.is_finite()).then_some(shares)
}

/// The up to eight texels around one.
fn neighbours(texel: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (column, row) = (texel % width, texel / width);
    let rows = row.saturating_sub(1)..(row + 2).min(height);
    let around =
        rows.flat_map(move |row| (column.saturating_sub(1)..(column + 2).min(width)).map(move |c| row * width + c));
    around.filter(move |other| *other != texel)
}

/// Gives every other texel the colour of the nearest `painted` one.
fn spread(image: &mut RgbImage, painted: impl Iterator<Item = usize>) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let mut is_painted = vec![false; width * height];
    let mut front: Vec<usize> = painted.collect();
    front.iter().for_each(|texel| is_painted[*texel] = true);
    while !front.is_empty() {
        let mut next = Vec::new();
        for texel in front {
            let colour = *image.get_pixel((texel % width) as u32, (texel / width) as u32);
            for neighbour in neighbours(texel, width, height) {
                if !is_painted[neighbour] {
                    is_painted[neighbour] = true;
                    image.put_pixel((neighbour % width) as u32, (neighbour / width) as u32, colour);
                    next.push(neighbour);
                }
            }
        }
        front = next;
    }
}

/// How well a canonical mesh shows the field's colours at random points: 10 log10(1 / mean squared difference), dB.
fn fidelity(avatar: &Avatar, mesh: &TriangleMesh) -> Result<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let sampler = SurfaceSampler::new(mesh, None)?;
    let samples: Vec<_> = (0..SAMPLES).map(|_| sampler.sample(&mut random)).collect();
    let points: Vec<Vec3> = samples.iter().map(|sample| mesh.position_at(sample)).collect();
    let field = avatar.colours(&points)?;
    let difference = |(sample, colour): (_, [u8; 3])| {
        let shown = mesh.colour_at(sample).unwrap_or_default();
        f64::from((shown - Vec3::from(colour.map(f32::from)) / 255.0).length_squared()) / 3.0
    };
    let mean = samples.iter().zip(field).map(difference).sum::<f64>() / SAMPLES as f64;
    Ok(-10.0 * mean.max(f64::MIN_POSITIVE).log10())
}
