//! Virtual cameras: a scan can be looked at from anywhere, so each network gets the picture that it was trained on. The person's part in
//! question fills it and stands upright.

use glam::{DVec3, Mat3, Vec2, Vec3};
use xavatar_formats::Result;
use xavatar_mesh::camera::PinholeCamera;
use xavatar_render::{Scene, View};

use crate::rays::Ray;

/// A square picture of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// What is in the middle, metres.
    pub middle: Vec3,
    /// From the middle to the camera, of length 1.
    pub towards_camera: Vec3,
    /// What points up in the picture, as well as it can.
    pub up: Vec3,
    /// How far the camera is from the middle, metres.
    pub distance: f32,
    /// How much of the plane through the middle the picture shows, metres.
    pub side: f32,
    /// Rows and columns.
    pub pixels: u32,
}

impl Square {
    /// The camera that takes it.
    pub fn camera(&self) -> PinholeCamera {
        let forward = -self.towards_camera;
        let down =
            -(self.up - forward * self.up.dot(forward)).try_normalize().unwrap_or(forward.any_orthonormal_vector());
        let rotation = Mat3::from_cols(down.cross(forward), down, forward).transpose();
        let focal = self.pixels as f32 * self.distance / self.side;
        let centre = self.pixels as f32 / 2.0;
        PinholeCamera {
            width: self.pixels,
            height: self.pixels,
            fx: focal,
            fy: focal,
            cx: centre,
            cy: centre,
            rotation,
            translation: rotation * (forward * self.distance - self.middle),
        }
    }
}

/// A picture as networks take it: rows x columns x red, green, blue, 0 to 1.
///
/// # Errors
/// As [`Scene::render`].
pub fn taken(scene: &Scene<'_>, camera: &PinholeCamera) -> Result<Vec<f32>> {
    let picture = scene.render(camera, View::Colour)?;
    Ok(picture.as_raw().iter().map(|value| f32::from(*value) / 255.0).collect())
}

/// The ray through a place of a picture, in pixels.
pub fn ray(camera: &PinholeCamera, place: Vec2, weight: f64) -> Ray {
    let direction = camera.rotation.transpose() * camera.ray(place);
    Ray { origin: camera.position().as_dvec3(), direction: direction.as_dvec3().normalize(), weight }
}

/// `count` directions, evenly over the sphere (a Fibonacci lattice).
pub fn directions(count: usize) -> Vec<DVec3> {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let direction = |index: usize| {
        let height = 1.0 - 2.0 * (index as f64 + 0.5) / count as f64;
        let (sin, cos) = (std::f64::consts::TAU * index as f64 / golden).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        DVec3::new(radius * cos, height, radius * sin)
    };
    (0..count).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_in_the_middle_and_up_is_up() {
        let square = Square {
            middle: Vec3::new(0.3, 1.2, -0.4),
            towards_camera: Vec3::new(0.6, 0.0, 0.8),
            up: Vec3::new(0.8, 0.1, -0.6),
            distance: 2.0,
            side: 0.5,
            pixels: 100,
        };
        let camera = square.camera();
        camera.check().unwrap();
        let (middle, depth) = camera.project(square.middle);
        assert!(middle.distance(Vec2::splat(50.0)) < 1e-3 && (depth - 2.0).abs() < 1e-5);
        let (above, _) = camera.project(square.middle + square.up.normalize() * 0.25);
        assert!(above.distance(Vec2::new(50.0, 0.0)) < 0.5, "{above}");
        let back = ray(&camera, above, 1.0);
        assert!(back.distance((square.middle + square.up.normalize() * 0.25).as_dvec3()) < 1e-4);
    }
}
