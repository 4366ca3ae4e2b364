//! The surface that a depth picture shows, as points: back-projected, coloured, with normals, without flying pixels.
//!
//! Where a pixel straddles a depth edge, many cameras report a depth between the two surfaces: a point in the air. Such a pixel
//! has few neighbours at its own depth, so one is kept only if at least [`SUPPORT`] of the eight around it lie on the same
//! surface: no farther in depth than a surface inclined by [`STEEPEST`] would be. P points; world, metres.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::RgbdFrame;
use super::normals::normals_towards;
use xavatar_body::{Part, Registration};
use xavatar_formats::{Error, Result};
use xavatar_mesh::camera::{PinholeCamera, pixel_centre};
use xavatar_mesh::{Colouring, TriangleMesh};

/// Neighbouring pixels on the same surface that a pixel needs: a corner of the silhouette has three.
const SUPPORT: usize = 3;
/// Tangent of the angle between the ray and the normal up to which neighbouring pixels are one surface (80 degrees).
const STEEPEST: f32 = 5.67;

/// The points of one frame that show the subject's surface, in the order of their pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Positions (P), world, metres.
    pub points: Vec<Vec3>,
    /// Unit normals (P), towards the camera.
    pub normals: Vec<Vec3>,
    /// sRGB (P).
    pub colours: Vec<[u8; 3]>,
    /// The pixel of each point (P): row * width + column, ascending.
    pub pixels: Vec<u32>,
}

impl PointCloud {
    /// The surface points of a frame that passes [`RgbdFrame::check`].
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, if no pixel is supported by its neighbours, as in a picture of noise.
    pub fn of(frame: &RgbdFrame) -> Result<Self> {
        let camera = &frame.camera;
        let pixels: Vec<u32> = (0..camera.height)
            .into_par_iter()
            .flat_map_iter(|row| {
                (0..camera.width)
                    .filter(move |&column| is_supported(frame, column, row))
                    .map(move |column| row * camera.width + column)
            })
            .collect();
        let positions: Vec<Vec3> = pixels.iter().map(|&pixel| position(frame, pixel)).collect();
        let normals =
            normals_towards(&positions, camera.position()).map_err(|error| error.in_frame(frame.id.to_string()))?;
        let mut cloud = Self::default();
        for ((pixel, point), normal) in pixels.into_iter().zip(positions).zip(normals) {
            let Some(normal) = normal else { continue };
            cloud.points.push(point);
            cloud.normals.push(normal);
            cloud.colours.push(frame.colour.get_pixel(pixel % camera.width, pixel / camera.width).0);
            cloud.pixels.push(pixel);
        }
        if cloud.points.is_empty() {
            let found = "no surface: every pixel stands alone".into();
            let expected = "neighbouring pixels at similar depths".into();
            return Err(Error::Value { name: "depth picture".into(), found, expected }.in_frame(frame.id.to_string()));
        }
        Ok(cloud)
    }

    /// The part of the body that each point (P) belongs to: that of the nearest registered vertex.
    pub fn parts(&self, registration: &Registration) -> Vec<Part> {
        self.points.par_iter().with_min_len(256).map(|&point| registration.nearest(point).0).collect()
    }

    /// The cloud as a mesh without faces, to be written or looked at.
    pub fn to_mesh(&self) -> TriangleMesh {
        TriangleMesh {
            vertices: self.points.clone(),
            faces: Vec::new(),
            normals: Some(self.normals.clone()),
            colouring: Colouring::Vertex(self.colours.clone()),
        }
    }
}

fn position(frame: &RgbdFrame, pixel: u32) -> Vec3 {
    let width = frame.camera.width;
    frame.camera.back_project(pixel_centre(pixel % width, pixel / width), frame.depth[pixel as usize])
}

/// Whether a pixel shows the subject, and enough of its neighbours the same surface.
fn is_supported(frame: &RgbdFrame, column: u32, row: u32) -> bool {
    let PinholeCamera { width, height, fx, fy, .. } = frame.camera;
    let at = |column: u32, row: u32| frame.surface_depth(row as usize * width as usize + column as usize);
    let Some(depth) = at(column, row) else { return false };
    let mut support = 0;
    for neighbour_row in row.saturating_sub(1)..=(row + 1).min(height - 1) {
        for neighbour_column in column.saturating_sub(1)..=(column + 1).min(width - 1) {
            if (neighbour_column, neighbour_row) == (column, row) {
                continue;
            }
            let Some(other) = at(neighbour_column, neighbour_row) else { continue };
            let steps =
                Vec2::new(neighbour_column.abs_diff(column) as f32 / fx, neighbour_row.abs_diff(row) as f32 / fy);
            let apart = steps.length() * depth.min(other);
            support += usize::from((other - depth).abs() <= STEEPEST * apart);
        }
    }
    support >= SUPPORT
}

#[cfg(test)]
mod tests {
    use image::{Rgb, RgbImage};

    use super::super::frame::{BACKGROUND, NO_MEASUREMENT};
    use super::*;
    use crate::FrameId;
    use xavatar_body::smplx;

    const CENTRE: Vec3 = Vec3::new(0.1, 1.2, -0.2);

    /// A frame whose depth is `depth` of each pixel's centre.
    fn frame(camera: PinholeCamera, depth: impl Fn(Vec2) -> f32) -> RgbdFrame {
        let (width, height) = (camera.width, camera.height);
        let pixels = (0..height).flat_map(|row| (0..width).map(move |column| pixel_centre(column, row)));
        RgbdFrame {
            id: FrameId { split: "train".into(), sequence: "Take1".into(), number: 1 },
            camera,
            colour: RgbImage::from_fn(width, height, |column, row| Rgb([column as u8, row as u8, 7])),
            depth: pixels.map(depth).collect(),
            mask: None,
            parameters: smplx::Parameters::default().into(),
        }
    }

    fn camera(distance: f32, size: u32) -> PinholeCamera {
        let position = CENTRE + Vec3::new(0.5, 0.3, 0.8).normalize() * distance;
        PinholeCamera::looking_at(position, CENTRE, 0.2, [size, size]).unwrap()
    }

    /// Depth of a sphere about [`CENTRE`] along the ray through `pixel`, exactly.
    fn sphere_depth(camera: &PinholeCamera, radius: f32, pixel: Vec2) -> f32 {
        let (ray, centre) = (camera.ray(pixel), camera.to_camera(CENTRE));
        let (a, b) = (ray.length_squared(), ray.dot(centre));
        let discriminant = b * b - a * (centre.length_squared() - radius * radius);
        if discriminant < 0.0 { BACKGROUND } else { (b - discriminant.sqrt()) / a }
    }

    #[test]
    fn points_of_a_sphere_lie_on_it_with_its_normals() {
        for (radius, size) in [(0.12, 200), (0.25, 400)] {
            let camera = camera(3.0, size);
            let cloud = PointCloud::of(&frame(camera, |pixel| sphere_depth(&camera, radius, pixel))).unwrap();
            let mut inside = 0;
            for (point, normal) in cloud.points.iter().zip(&cloud.normals) {
                let outward = (*point - CENTRE) / radius;
                assert!((outward.length() - 1.0).abs() < 1e-4);
                let towards_camera = (camera.position() - *point).normalize();
                assert!(normal.dot(towards_camera) >= 0.0);
                // Nearer to the silhouette all neighbours are on one side.
                if outward.dot(towards_camera) > 0.2 {
                    let degrees = normal.dot(outward.normalize()).min(1.0).acos().to_degrees();
                    assert!(degrees < 3.0, "{degrees} degrees at {outward}");
                    inside += 1;
                }
            }
            assert!(inside > 4000, "{inside}");
        }
    }

    #[test]
    fn points_keep_their_pixels_and_colours() {
        let camera = camera(3.0, 200);
        let frame = frame(camera, |pixel| sphere_depth(&camera, 0.2, pixel));
        let cloud = PointCloud::of(&frame).unwrap();
        assert!(cloud.pixels.is_sorted());
        for ((point, &pixel), colour) in cloud.points.iter().zip(&cloud.pixels).zip(&cloud.colours) {
            let (column, row) = (pixel % 200, pixel / 200);
            assert_eq!(*colour, [column as u8, row as u8, 7]);
            assert!(camera.project(*point).0.abs_diff_eq(pixel_centre(column, row), 1e-2));
        }
    }

    // A sphere in front of a wall, each pixel on its rim a mixture of both, as many sensors report.
    #[test]
    fn pixels_between_two_surfaces_are_removed() {
        let camera = camera(3.0, 300);
        let depth = |pixel: Vec2| {
            let corners = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)].map(|(u, v)| pixel + Vec2::new(u, v));
            let hits = corners.iter().filter(|&&corner| sphere_depth(&camera, 0.2, corner).is_finite()).count();
            let (near, wall) = (sphere_depth(&camera, 0.2, pixel).min(3.0), 4.0);
            let share = hits as f32 / 4.0;
            near * share + wall * (1.0 - share)
        };
        let filmed = frame(camera, depth);
        let is_flying = |depth: f32| (3.02..3.98).contains(&depth);
        assert!(filmed.depth.iter().filter(|depth| is_flying(**depth)).count() > 300);
        let cloud = PointCloud::of(&filmed).unwrap();
        assert!(cloud.pixels.iter().all(|&pixel| !is_flying(filmed.depth[pixel as usize])));
        let kept = |limit: f32| cloud.pixels.iter().filter(|&&pixel| filmed.depth[pixel as usize] < limit).count();
        let there = filmed.depth.iter().filter(|depth| **depth < 3.0).count();
        assert!(kept(3.0) > there * 97 / 100, "of {there} pixels of the sphere {} are kept", kept(3.0));
    }

    #[test]
    fn only_what_the_mask_shows_is_the_subject() {
        let camera = camera(3.0, 100);
        let mut frame = frame(camera, |_| 3.0);
        frame.mask = Some((0..10_000).map(|pixel| pixel % 100 < 50).collect());
        let cloud = PointCloud::of(&frame).unwrap();
        assert_eq!(cloud.points.len(), 5000);
        assert_eq!((frame.surface_depth(49), frame.surface_depth(50)), (Some(3.0), None));
        assert_eq!(frame.free_until(50), Some(3.0), "what hides the subject is not beyond its own depth");
    }

    #[test]
    fn noise_is_not_a_surface() {
        let camera = camera(3.0, 60);
        let noise = frame(camera, |pixel| 1.0 + (pixel.x * 37.0 + pixel.y * 61.0) % 7.0);
        let error = PointCloud::of(&noise).unwrap_err().to_string();
        assert!(error.contains("train/Take1/f00001") && error.contains("stands alone"), "{error}");
    }

    #[test]
    fn frames_that_contradict_themselves_are_named() {
        let camera = camera(3.0, 20);
        let good = frame(camera, |_| 2.0);
        good.check().unwrap();
        let nothing = |pixel: Vec2| if pixel.x < 10.0 { BACKGROUND } else { NO_MEASUREMENT };
        for (broken, word) in [
            (RgbdFrame { colour: RgbImage::new(20, 21), ..good.clone() }, "20 x 21"),
            (RgbdFrame { depth: vec![1.0; 399], ..good.clone() }, "399"),
            (RgbdFrame { mask: Some(vec![true; 7]), ..good.clone() }, "mask"),
            (RgbdFrame { mask: Some(vec![false; 400]), ..good.clone() }, "no pixel of the subject (400 of 400"),
            (frame(camera, nothing), "no pixel of the subject"),
            (frame(camera, |_| f32::NAN), "(0, 0)"),
            (frame(camera, |pixel| if pixel == pixel_centre(3, 2) { 11.0 } else { 1.0 }), "(3, 2) is 11 m"),
            (RgbdFrame { camera: PinholeCamera { fx: 0.0, ..camera }, ..good.clone() }, "fx"),
        ] {
            let error = broken.check().unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("train/Take1/f00001"), "{error}");
        }
    }
}
