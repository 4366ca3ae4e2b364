//! A mesh that is pictured: from the faces that samples see to colours.
//!
//! Each pixel has eight samples and is shaded once for every face they see, at the centroid of that face's samples, with
//! perspective-correct attributes. What no camera changes is made once.

use std::borrow::Cow;

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rayon::prelude::*;

use super::camera_bounds::check_camera;
use super::colour_map::{ColourMap, linear_colour};
use super::floor::Floor;
use super::light::{Light, decode_srgb, encode_srgb, illumination, softly_open};
use super::occlusion::Sky;
use super::rasterize::{Band, EMPTY, Pixel, ROOKS, Rasterizer, sample_place};
use xavatar_formats::{Error, Result};
use xavatar_mesh::camera::PinholeCamera;
use xavatar_mesh::{SurfacePoint, TriangleMesh};

/// Samples in a pixel.
const SAMPLES: usize = ROOKS.len();
/// Coordinates beyond it are no picture's subject, and their squares would leave f32's range, metres.
const FARTHEST: f32 = 1e6;
/// What is seen where there is nothing.
const BACKGROUND: Rgb<u8> = Rgb([255; 3]);
/// The colour of a mesh without one: a warm plaster, linear.
const PLASTER: Vec3 = Vec3::new(0.64, 0.62, 0.59);
/// Share of a coloured surface's light that does not depend on direction: scans carry their own shading.
const UNLIT_SHARE: f32 = 0.55;
/// The same for colours that mean numbers: the shape shows, and a legend still holds.
const UNLIT_SHARE_OF_DATA: f32 = 0.8;

/// Share of a colour's unlit part that a place which sees nothing of the sky loses.
const COLOUR_OCCLUSION: f32 = 0.6;
/// Share of the floor's white that a place which sees nothing of the sky loses.
const FLOOR_SHADOW: f32 = 0.55;
/// Share of the picture's width, at either side, over which the floor's shadow fades.
const FLOOR_FADE: f32 = 0.25;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// The shape alone, in plain grey.
    Shaded,
    /// The mesh's own colours, gently lit; plain grey where it has none.
    Colour,
    /// The mesh's own colours, lit so little that they can be compared with a legend: they mean numbers or names.
    Data,
    /// Normals in camera space: red right, green up, blue towards the camera, each from -1 (0) to 1 (255).
    Normals,
    /// Depth z by the colours of [`ColourMap::Viridis`], the nearest brightest.
    Depth {
        /// The depth of the brightest colour, metres.
        near: f32,
        /// The depth of the darkest colour, metres.
        far: f32,
    },
}

/// A mesh made ready for pictures.
pub struct Scene<'a> {
    mesh: &'a TriangleMesh,
    normals: Cow<'a, [Vec3]>,
    /// How open each vertex is to the sky's light, 0 to 1; none: all of it reaches all of them.
    openness: Option<Vec<f32>>,
    floor: Option<Floor>,
    light: Light,
}

/// A picture of a mesh; for several of the same mesh, keep a [`Scene`].
///
/// # Errors
/// As [`Scene::new`] and [`Scene::render`].
pub fn render_mesh(mesh: &TriangleMesh, camera: &PinholeCamera, view: View) -> Result<RgbImage> {
    Scene::new(mesh)?.render(camera, view)
}

impl<'a> Scene<'a> {
    /// Checks the mesh. Its normals are used where present, else they are computed from its faces.
    ///
    /// # Errors
    /// [`Error::Value`] if the mesh fails [`TriangleMesh::check`] or reaches farther than 1000 km.
    pub fn new(mesh: &'a TriangleMesh) -> Result<Self> {
        check(mesh)?;
        let normals = match &mesh.normals {
            Some(normals) => Cow::Borrowed(normals.as_slice()),
            None => Cow::Owned(mesh.vertex_normals()),
        };
        Ok(Self { mesh, normals, openness: None, floor: None, light: Light::default() })
    }

    /// Darkens creases and what is close to other parts, and puts a soft shadow on a floor at the height y = `floor` (metres), in
    /// [`View::Shaded`] and [`View::Colour`]. It costs as much as several pictures, once.
    ///
    /// # Errors
    /// [`Error::Value`] if the mesh is too large for depth images of it.
    pub fn with_ambient_occlusion(mut self, floor: Option<f32>) -> Result<Self> {
        let sky = Sky::over(self.mesh)?;
        self.openness = Some(sky.of_vertices(self.mesh, &self.normals));
        self.floor =
            floor.filter(|_| !self.mesh.vertices.is_empty()).map(|height| Floor::below(self.mesh, height, &sky));
        Ok(self)
    }

    /// The same scene in another light.
    #[must_use]
    pub fn lit_by(self, light: Light) -> Self {
        Self { light, ..self }
    }

    /// An anti-aliased picture, on white.
    ///
    /// # Errors
    /// [`Error::Value`] if the camera is impossible.
    pub fn render(&self, camera: &PinholeCamera, view: View) -> Result<RgbImage> {
        self.render_before(camera, view, &RgbImage::from_pixel(camera.width, camera.height, BACKGROUND))
    }

    /// An anti-aliased picture before a backdrop, which is of the camera's size and shows where there is neither mesh nor floor.
    ///
    /// # Errors
    /// [`Error::Value`] if the camera is impossible or the backdrop of another size.
    pub fn render_before(&self, camera: &PinholeCamera, view: View, backdrop: &RgbImage) -> Result<RgbImage> {
        check_camera(camera)?;
        if backdrop.dimensions() != (camera.width, camera.height) {
            let (found, expected) = (backdrop.dimensions(), (camera.width, camera.height));
            return Err(Error::Value {
                name: "backdrop".into(),
                found: format!("{} x {} pixels", found.0, found.1),
                expected: format!("the camera's {} x {}", expected.0, expected.1),
            });
        }
        let points = to_camera(self.mesh, camera);
        let floor = self.floor.as_ref().filter(|_| matches!(view, View::Shaded | View::Colour));
        let shader = Shader { scene: self, points: &points, camera, view, floor, backdrop, centroids: centroids() };
        let mut picture = backdrop.clone();
        Rasterizer::new(&points, &self.mesh.faces, camera, ROOKS)
            .draw(&mut picture, 3, |band, pixels| shader.shade(band, pixels));
        Ok(picture)
    }
}

/// The vertices in camera space.
pub(super) fn to_camera(mesh: &TriangleMesh, camera: &PinholeCamera) -> Vec<Vec3> {
    mesh.vertices.par_iter().map(|&vertex| camera.to_camera(vertex)).collect()
}

pub(super) fn check(mesh: &TriangleMesh) -> Result<()> {
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

/// A scene before a camera.
struct Shader<'a> {
    scene: &'a Scene<'a>,
    /// Vertices in camera space.
    points: &'a [Vec3],
    camera: &'a PinholeCamera,
    view: View,
    floor: Option<&'a Floor>,
    backdrop: &'a RgbImage,
    /// The centroid of a pixel's samples whose bits are set in the index, from the pixel's upper left corner.
    centroids: Vec<Vec2>,
}

/// The mean place of each choice of a pixel's samples; of none, the value has no meaning.
fn centroids() -> Vec<Vec2> {
    (0..1_u32 << SAMPLES)
        .map(|chosen| {
            let places =
                (0..SAMPLES).filter(|sample| chosen >> sample & 1 == 1).map(|sample| sample_place(&ROOKS, sample));
            places.sum::<Vec2>() / chosen.count_ones() as f32
        })
        .collect()
}

impl Shader<'_> {
    fn shade(&self, band: &Band<SAMPLES>, pixels: &mut [u8]) {
        let width = self.camera.width as usize;
        for (index, line) in pixels.chunks_exact_mut(3 * width).enumerate() {
            let row = (band.first_row + index) as f32;
            let mut put = |column: usize, light: Vec3| {
                line[3 * column..3 * column + 3].copy_from_slice(&light.to_array().map(encode_srgb));
            };
            if self.floor.is_some() {
                for column in (0..band.columns.start).chain(band.columns.end..width) {
                    put(column, self.background(Vec2::new(column as f32, row) + 0.5));
                }
            }
            for (column, pixel) in band.columns.clone().zip(band.row(index)) {
                put(column, self.mean_light(pixel, Vec2::new(column as f32, row)));
            }
        }
    }

    /// The mean over the faces that the samples of the pixel with this upper left corner see.
    fn mean_light(&self, pixel: &Pixel<SAMPLES>, corner: Vec2) -> Vec3 {
        let mut light = Vec3::ZERO;
        // Samples are bits.
        let mut left = (1_u32 << SAMPLES) - 1;
        while left != 0 {
            let face = pixel.faces[left.trailing_zeros() as usize];
            let alike = (0..SAMPLES).fold(0, |bits, sample| bits | u32::from(pixel.faces[sample] == face) << sample);
            let place = corner + self.centroids[alike as usize];
            let colour = if face == EMPTY { self.background(place) } else { self.colour(face, place) };
            light += alike.count_ones() as f32 * colour;
            left &= !alike;
        }
        light / SAMPLES as f32
    }

    fn background(&self, place: Vec2) -> Vec3 {
        let pixel = self.backdrop.get_pixel(place.x as u32, place.y as u32).0;
        let behind = Vec3::from(pixel.map(|channel| decode_srgb(f32::from(channel) / 255.0)));
        let Some(floor) = self.floor else { return behind };
        // Without an edge of shadow where the picture ends.
        let width = self.camera.width as f32;
        let inward = (place.x.min(width - place.x) / (width * FLOOR_FADE)).clamp(0.0, 1.0);
        let fade = inward * inward * (3.0 - 2.0 * inward);
        behind * softly_open(floor.openness(self.camera, place), FLOOR_SHADOW * fade)
    }

    /// The linear colour of a face at a place of the picture.
    fn colour(&self, face: u32, place: Vec2) -> Vec3 {
        let mesh = self.scene.mesh;
        let vertices = mesh.faces[face as usize].map(|vertex| vertex as usize);
        let corners = vertices.map(|vertex| self.points[vertex]);
        let point = meeting_point(face, corners, self.camera.ray(place));
        let [of_a, of_b, of_c] = point.barycentric;
        let mean = |[a, b, c]: [Vec3; 3]| a * of_a + b * of_b + c * of_c;
        if let View::Depth { near, far } = self.view {
            return linear_colour(ColourMap::Viridis, (far - mean(corners).z) / (far - near));
        }
        let outward = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let smooth = self.camera.rotation * mean(vertices.map(|v| self.scene.normals[v]));
        let normal = smooth.try_normalize().unwrap_or(outward.normalize_or_zero());
        if self.view == View::Normals {
            return (Vec3::new(normal.x, -normal.y, -normal.z) * 0.5 + 0.5).map(decode_srgb);
        }
        // Open scans show their inner side too: light it as if it were an outer one.
        let facing = if outward.dot(corners[0]) > 0.0 { -normal } else { normal };
        let open = match &self.scene.openness {
            Some(openness) => {
                let [a, b, c] = vertices.map(|vertex| openness[vertex]);
                a * of_a + b * of_b + c * of_c
            }
            None => 1.0,
        };
        let light = &self.scene.light;
        let lit = illumination(light, facing, open);
        let unlit_share = if self.view == View::Data { UNLIT_SHARE_OF_DATA } else { UNLIT_SHARE };
        light.tint
            * match mesh.colour_at(&point).filter(|_| self.view != View::Shaded) {
                Some(colour) => {
                    colour.map(decode_srgb)
                        * (unlit_share * softly_open(open, COLOUR_OCCLUSION) + (1.0 - unlit_share) * lit)
                }
                None => PLASTER * lit,
            }
    }
}

/// Where a ray from the camera meets the plane of a face, drawn back onto the face. Camera space.
pub(super) fn meeting_point(face: u32, corners: [Vec3; 3], ray: Vec3) -> SurfacePoint {
    let (first, second) = (corners[1] - corners[0], corners[2] - corners[0]);
    // Moeller-Trumbore from the ray's point at the first corner's depth: differences stay small, so nothing cancels.
    let start = ray * corners[0].z - corners[0];
    let across = ray.cross(second);
    let determinant = first.dot(across);
    let b = start.dot(across) / determinant;
    let c = ray.dot(start.cross(first)) / determinant;
    let shares = [(1.0 - b - c).max(0.0), b.max(0.0), c.max(0.0)];
    let sum = shares[0] + shares[1] + shares[2];
    // A face seen edge-on has no unique point: take its middle.
    let barycentric = if sum.is_finite() && sum > 0.0 { shares.map(|share| share / sum) } else { [1.0 / 3.0; 3] };
    SurfacePoint { face, barycentric }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xavatar_mesh::Colouring;

    /// A small white triangle in the middle, and the camera before it.
    fn triangle() -> (TriangleMesh, PinholeCamera) {
        let vertices = vec![Vec3::new(-0.2, -0.2, 0.0), Vec3::new(0.2, -0.2, 0.0), Vec3::new(0.0, 0.2, 0.0)];
        let colouring = Colouring::Vertex(vec![[255; 3]; 3]);
        let mesh = TriangleMesh { vertices, faces: vec![[0, 1, 2]], colouring, ..TriangleMesh::default() };
        (mesh, PinholeCamera::looking_at(2.0 * Vec3::Z, Vec3::ZERO, 0.6, [40, 40]).unwrap())
    }

    #[test]
    fn the_backdrop_shows_beside_the_mesh_and_mixes_at_its_edge() {
        let (mesh, camera) = triangle();
        let backdrop = RgbImage::from_fn(40, 40, |x, y| Rgb([6 * x as u8, 6 * y as u8, 0]));
        let scene = Scene::new(&mesh).unwrap();
        let picture = scene.render_before(&camera, View::Colour, &backdrop).unwrap();
        let unlike: Vec<_> = picture.enumerate_pixels().filter(|(x, y, p)| *p != backdrop.get_pixel(*x, *y)).collect();
        let whole = unlike.iter().filter(|(.., pixel)| pixel.0[2] > 150).count();
        assert!(whole > 50 && unlike.len() > whole && unlike.len() < 400, "{whole} of {}", unlike.len());
        assert_eq!(picture.get_pixel(2, 30), backdrop.get_pixel(2, 30));
        let error = scene.render_before(&camera, View::Colour, &RgbImage::new(40, 39)).unwrap_err().to_string();
        assert!(error.contains("40 x 39") && error.contains("40 x 40"), "{error}");
    }

    #[test]
    fn light_has_a_side_and_a_colour() {
        let (mesh, camera) = triangle();
        let lit = |light: Light| {
            let scene = Scene::new(&mesh).unwrap().lit_by(light);
            scene.render(&camera, View::Colour).unwrap().get_pixel(20, 22).0
        };
        let studio = lit(Light::default());
        assert_eq!(studio, render_mesh(&mesh, &camera, View::Colour).unwrap().get_pixel(20, 22).0);
        let behind = lit(Light { towards: Vec3::Z, ..Light::default() });
        assert!(behind[0] < studio[0], "{behind:?} {studio:?}");
        let warm = lit(Light { tint: Vec3::new(1.0, 1.0, 0.5), ..Light::default() });
        assert!(warm[2] < studio[2] && warm[0] == studio[0], "{warm:?}");
    }
}
