//! What an RGB-D camera saw of one frame, made ready to draw from: points of the surface, and where its rays were free.
//!
//! Around the observed points the signed distance is known to both sides: before a point along its normal it is positive where the
//! camera looks through, close behind it negative. What is farther behind, or beside what was seen, is unknown, and nothing is
//! said about it. V vertices of the registered body; the body's frame, metres.

mod draw;
mod observed;

use glam::Vec3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use self::observed::{ObservedPoints, Region, regions};
use super::{BYTES_A_FACE, CanonicalVertices, RegisteredBody, Supervision, Surface};
use crate::body::{Part, Registration, Role};
use crate::config::{Config, RgbdSettings};
use crate::data::{RgbdCapture, RgbdFrame};
use crate::mesh::camera::PinholeCamera;
use crate::train::drawn::PosedSamples;
use crate::{Error, InputError, Result};

/// How far a point's nearest observed one may lie aside for the distance to its plane to be that to the surface, metres:
/// beyond, the point is past the rim of what was seen. Pixels are 2 to 3 mm apart at 6 m.
const ASIDE: f32 = 0.006;
/// A point this much nearer than what the camera sees around it is in the air, metres.
const CLEARANCE: f32 = 0.004;
/// So near before an observed point nothing else fits between it and the camera, metres.
const CONTACT: f32 = 0.006;
/// A registered vertex is seen if the camera sees a surface no farther before it than clothes reach, or behind, metres.
const CLOTHING: f32 = 0.08;
const FIT: f32 = 0.03;
/// Cosine of the angle between ray and normal below which a vertex is seen too flatly.
const FLATTEST: f32 = 0.2;
/// What an observed point takes with its tree, bytes.
const BYTES_A_POINT: usize = 64;

/// One picture of an RGB-D camera.
pub(super) struct CameraView<'a> {
    observed: ObservedPoints,
    body: Surface,
    canonical: CanonicalVertices,
    regions: Vec<Region>,
    registration: Registration<'a>,
    /// Posed in the body's frame.
    camera: PinholeCamera,
    frame: RgbdFrame,
    settings: RgbdSettings,
    truncation: f32,
    /// Which of the skeleton's parts are thin.
    is_thin: Vec<bool>,
    /// The body's vertices (V) whose surface, or what covers it, the camera sees.
    seen: Vec<bool>,
}

impl Supervision for CameraView<'_> {
    fn draw(&self, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples {
        draw::draw(self, config, random)
    }

    fn add_seen_vertices(&self, seen: &mut [bool]) {
        seen.iter_mut().zip(&self.seen).for_each(|(all, own)| *all |= own);
    }

    fn size(&self) -> usize {
        let pixels = self.frame.depth.len() * (size_of::<f32>() + 3);
        pixels + BYTES_A_POINT * self.observed.points.len() + BYTES_A_FACE * self.body.mesh.faces.len()
    }
}

impl<'a> CameraView<'a> {
    pub fn new(capture: RgbdCapture, body: RegisteredBody<'a>, config: &Config) -> Result<Self> {
        let RgbdCapture { frame, cloud } = capture;
        let RegisteredBody { mesh, canonical, skeleton, labels, registration } = body;
        let Some(settings) = config.rgbd.clone() else {
            return Err(Error::from(InputError::Value {
                name: "preset".into(),
                found: format!("`{}`, which is for scans", config.preset),
                expected: "one for RGB-D frames".into(),
            }));
        };
        let transl = frame.parameters.translation();
        let points: Vec<Vec3> = cloud.points.iter().map(|point| *point - transl).collect();
        let nearest: Vec<usize> = points.par_iter().map(|point| registration.nearest_vertex(*point)).collect();
        let colours = cloud.colours.iter().map(|colour| Vec3::from(colour.map(f32::from)) / 255.0).collect();
        let parts = nearest.iter().map(|vertex| labels.parts[*vertex]).collect();
        let observed = ObservedPoints::new(points, cloud.normals, colours, parts)?;
        let camera = frame.camera;
        let camera = PinholeCamera { translation: camera.translation + camera.rotation * transl, ..camera };
        let mut view = Self {
            regions: regions(&observed, &nearest, &mesh, skeleton, labels, &config.sampling, &settings)?,
            seen: vec![false; mesh.vertices.len()],
            is_thin: skeleton.parts.iter().map(|part| part.role == Role::Hands).collect(),
            body: Surface::new(mesh)?,
            canonical,
            truncation: config.losses.truncation as f32,
            observed,
            registration,
            camera,
            frame,
            settings,
        };
        let seen: Vec<bool> = (0..view.seen.len()).into_par_iter().map(|vertex| view.shows_vertex(vertex)).collect();
        view.seen = seen;
        nearest.iter().for_each(|vertex| view.seen[*vertex] = true);
        Ok(view)
    }

    /// The part that a point belongs to.
    fn part(&self, point: Vec3) -> Part {
        self.registration.nearest(point).0
    }

    /// A point's signed distance to the surface, as far as the picture tells it.
    fn distance(&self, point: Vec3) -> Option<f32> {
        let nearest = self.observed.nearest(point);
        let offset = point - self.observed.points[nearest];
        let height = offset.dot(self.observed.normals[nearest]);
        if (offset.length_squared() - height * height).max(0.0).sqrt() >= ASIDE {
            return None;
        }
        let is_thin = self.is_thin[self.observed.parts[nearest].index()];
        let depth = if is_thin { self.settings.hand_depth } else { self.truncation };
        let is_near = (-depth.min(CONTACT)..CONTACT).contains(&height);
        let is_believed = is_near || if self.is_air(point) { height > 0.0 } else { (-depth..0.0).contains(&height) };
        is_believed.then_some(height)
    }

    /// Whether the camera looks through a point, and past it on all sides.
    fn is_air(&self, point: Vec3) -> bool {
        let (place, depth) = self.camera.project(point);
        let PinholeCamera { width, height, .. } = self.camera;
        let (column, row) = (place.x.floor(), place.y.floor());
        let inside = column >= 1.0 && row >= 1.0 && column + 1.0 < width as f32 && row + 1.0 < height as f32;
        let is_past = |column: u32, row: u32| {
            let free = self.frame.free_until((row * width + column) as usize);
            free.is_some_and(|free| depth + CLEARANCE < free)
        };
        depth > 0.0
            && inside
            && (row as u32 - 1..=row as u32 + 1)
                .all(|row| (column as u32 - 1..=column as u32 + 1).all(|column| is_past(column, row)))
    }

    /// The depth of the subject at a pixel (column, row) that shows it, metres.
    fn surface_depth(&self, [column, row]: [u32; 2]) -> Option<f32> {
        self.frame.surface_depth((row * self.camera.width + column) as usize)
    }

    fn shows_vertex(&self, vertex: usize) -> bool {
        let position = self.body.mesh.vertices[vertex];
        let normal = self.body.mesh.normals.as_ref().map_or(Vec3::ZERO, |normals| normals[vertex]);
        let (place, depth) = self.camera.project(position);
        let PinholeCamera { width, height, .. } = self.camera;
        let (inside_row, inside_column) =
            ((0.0..height as f32).contains(&place.y), (0.0..width as f32).contains(&place.x));
        depth > 0.0
            && inside_row
            && inside_column
            && (self.camera.position() - position).normalize_or_zero().dot(normal) > FLATTEST
            && self
                .surface_depth([place.x as u32, place.y as u32])
                .is_some_and(|seen| (-CLOTHING..FIT).contains(&(seen - depth)))
    }
}

#[cfg(test)]
mod tests {
    use image::RgbImage;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::body::{PartLabelSource, PartLabels, smplx};
    use crate::data::{BACKGROUND, FrameId};
    use crate::mesh::camera::pixel_centre;
    use crate::mesh::{ExtractionGrid, Sign, extract};

    const RADIUS: f32 = 0.3;
    const TRANSL: Vec3 = Vec3::new(0.4, 1.0, -0.2);

    /// A sphere at the registration's translation, and its like as the body, seen from the front.
    fn view(labels: &PartLabels, mesh: crate::mesh::TriangleMesh) -> CameraView<'_> {
        let camera = PinholeCamera::looking_at(TRANSL + Vec3::Z * 3.0, TRANSL, 0.3, [500, 500]).unwrap();
        let depth = (0..500 * 500).map(|pixel| {
            let (ray, centre) = (camera.ray(pixel_centre(pixel % 500, pixel / 500)), camera.to_camera(TRANSL));
            let (a, b) = (ray.length_squared(), ray.dot(centre));
            let discriminant = b * b - a * (centre.length_squared() - RADIUS * RADIUS);
            if discriminant < 0.0 { BACKGROUND } else { (b - discriminant.sqrt()) / a }
        });
        let frame = RgbdFrame {
            id: FrameId { split: "train".into(), sequence: "Take1".into(), number: 1 },
            camera,
            colour: RgbImage::from_pixel(500, 500, image::Rgb([10, 20, 30])),
            depth: depth.collect(),
            mask: None,
            parameters: smplx::Parameters { transl: TRANSL, ..Default::default() }.into(),
        };
        let registration = Registration::new(&mesh.vertices, labels).unwrap();
        let body = RegisteredBody {
            canonical: CanonicalVertices(mesh.vertices.clone()),
            mesh,
            skeleton: smplx::skeleton(),
            labels,
            registration,
        };
        let config = Config::preset("fast-rgbd").unwrap();
        CameraView::new(RgbdCapture::of(frame).unwrap(), body, &config).unwrap()
    }

    fn sphere() -> crate::mesh::TriangleMesh {
        let field = |points: &[Vec3], values: &mut [f32]| {
            points.iter().zip(values).for_each(|(point, value)| *value = point.length() - RADIUS);
        };
        let (minimum, maximum) = (Vec3::splat(-0.4), Vec3::splat(0.4));
        let grid = ExtractionGrid { minimum, maximum, resolution: 32, level: 0.0, inside_is: Sign::Negative };
        let mut mesh = extract(&field, grid).unwrap().mesh;
        mesh.normals = Some(mesh.vertex_normals());
        mesh
    }

    fn labels(count: usize) -> PartLabels {
        let source = PartLabelSource::SkinningWeights;
        PartLabels { parts: vec![Part(0); count], detail: vec![false; count], source }
    }

    // Every distance is the sphere's, and distances are known to both sides all over the visible half.
    #[test]
    fn what_is_known_of_a_sphere_is_true() {
        let mesh = sphere();
        let labels = labels(mesh.vertices.len());
        let view = view(&labels, mesh);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let (mut before, mut behind, mut unknown) = (0, 0, 0);
        for _ in 0..20_000 {
            let direction = Vec3::from(std::array::from_fn(|_| random.random_range(-1.0..1.0))).normalize();
            let distance = random.random_range(-0.1..0.15);
            let point = direction * (RADIUS + distance);
            match view.distance(point) {
                Some(found) => {
                    assert!((found - distance).abs() < 0.002, "{point}: {found} not {distance}");
                    *(if found > 0.0 { &mut before } else { &mut behind }) += 1;
                }
                None => unknown += 1,
            }
            // Seen from the front, near the surface or a little before it, nothing is unknown.
            let is_plain =
                direction.z > 0.8 && ((-0.005..0.005).contains(&distance) || (0.03..0.1).contains(&distance));
            assert!(!is_plain || view.distance(point).is_some(), "{point}: nothing, but {distance}");
            assert!(distance > -view.truncation - 0.001 || view.distance(point).is_none(), "{point} is too deep");
        }
        assert!(before > 2000 && behind > 500 && unknown > 2000, "{before} {behind} {unknown}");
    }

    #[test]
    fn the_side_towards_the_camera_is_seen() {
        let mesh = sphere();
        let labels = labels(mesh.vertices.len());
        let view = view(&labels, mesh);
        let mut seen = vec![false; view.body.mesh.vertices.len()];
        view.add_seen_vertices(&mut seen);
        for (vertex, seen) in view.body.mesh.vertices.iter().zip(seen) {
            if vertex.z.abs() > 0.35 * RADIUS {
                assert_eq!(seen, vertex.z > 0.0, "{vertex}");
            }
        }
    }

    #[test]
    fn parts_that_are_not_seen_have_no_region() {
        let mesh = sphere();
        let labels = labels(mesh.vertices.len());
        let view = view(&labels, mesh);
        assert_eq!(view.regions.iter().map(|region| region.part).collect::<Vec<_>>(), [Part(0)]);
    }
}
