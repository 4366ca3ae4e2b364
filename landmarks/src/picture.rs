//! Virtual cameras: a scan can be looked at from anywhere, so each network gets the picture that it was trained on. The person's part in
//! question fills it and stands upright. Of a picture that is there, a square is cut likewise.

use glam::{DVec3, Mat3, Vec2, Vec3};
use image::RgbImage;
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

/// A square of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    /// What is in its middle, pixels of the picture.
    pub middle: Vec2,
    /// What of the picture points up in it, of length 1.
    pub up: Vec2,
    /// How much of the picture it shows, pixels.
    pub side: f32,
    /// Its own rows and columns.
    pub pixels: u32,
}

impl Crop {
    /// Where a place of the square is in the picture.
    pub fn in_picture(&self, place: Vec2) -> Vec2 {
        let [right, down] = (place / self.pixels as f32 - 0.5).to_array();
        self.middle + self.side * (right * self.up.perp() - down * self.up)
    }

    /// The square as networks take it, as [`taken`]; black beyond the picture.
    pub fn taken(&self, picture: &RgbImage) -> Vec<f32> {
        // As many samples a pixel as the picture has pixels there.
        let samples = (self.side / self.pixels as f32).ceil().clamp(1.0, 8.0) as u32;
        let along = |index: u32, sample: u32| index as f32 + (sample as f32 + 0.5) / samples as f32;
        let mut values = Vec::with_capacity(3 * (self.pixels * self.pixels) as usize);
        for row in 0..self.pixels {
            for column in 0..self.pixels {
                let places = (0..samples).flat_map(|down| (0..samples).map(move |right| (right, down)));
                let sum: Vec3 = places
                    .map(|(right, down)| self.in_picture(Vec2::new(along(column, right), along(row, down))))
                    .map(|place| between_pixels(picture, place))
                    .sum();
                values.extend((sum / (samples * samples) as f32 / 255.0).to_array());
            }
        }
        values
    }
}

/// The colour at a place, linear between the middles of pixels.
fn between_pixels(picture: &RgbImage, place: Vec2) -> Vec3 {
    let colour = |column: i64, row: i64| {
        let inside = u32::try_from(column).ok().zip(u32::try_from(row).ok());
        let pixel = inside.and_then(|(column, row)| picture.get_pixel_checked(column, row));
        pixel.map_or(Vec3::ZERO, |pixel| Vec3::from_array(pixel.0.map(f32::from)))
    };
    let corner = (place - 0.5).floor();
    let share = place - 0.5 - corner;
    let (column, row) = (corner.x as i64, corner.y as i64);
    let of_row = |row: i64| colour(column, row).lerp(colour(column + 1, row), share.x);
    of_row(row).lerp(of_row(row + 1), share.y)
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
    fn a_square_of_a_picture_is_turned_so_that_up_is_up() {
        let picture = RgbImage::from_fn(60, 40, |column, row| image::Rgb([4 * column as u8, 6 * row as u8, 0]));
        let crop = Crop { middle: Vec2::new(20.0, 22.0), up: Vec2::X, side: 10.0, pixels: 20 };
        // Up in the square is right in the picture, so right in the square is down.
        assert!(crop.in_picture(Vec2::new(10.0, 0.0)).distance(Vec2::new(25.0, 22.0)) < 1e-5);
        assert!(crop.in_picture(Vec2::new(20.0, 10.0)).distance(Vec2::new(20.0, 27.0)) < 1e-5);
        let taken = crop.taken(&picture);
        let place = crop.in_picture(Vec2::new(13.5, 4.5));
        let expected = [4.0 * (place.x - 0.5) / 255.0, 6.0 * (place.y - 0.5) / 255.0, 0.0];
        for (found, expected) in taken[3 * (4 * 20 + 13)..].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        let beside = Crop { middle: Vec2::new(-50.0, 0.0), ..crop };
        assert!(beside.taken(&picture).iter().all(|value| *value == 0.0));
    }

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
