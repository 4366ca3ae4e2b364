//! The pinhole camera: x_c = R (x - position), pixel (u, v) = f (x_c, y_c) / z_c + (width, height) / 2.
//!
//! Camera space has x right, y down and z forward (OpenCV), metres; u runs right and v down, in pixels, f is in pixels too.
//! No lens distortion; the image plane is upright, the principal point its centre.

use glam::{Mat3, Vec2, Vec3};

use crate::{Error, Result};

/// Azimuth of a picture from the front: the subject faces +Z. Radians.
pub const FRONT: f32 = 0.0;
/// Azimuth of a picture that shows the front and the subject's left side. Radians (35 degrees).
pub const THREE_QUARTER: f32 = 0.61;

/// Longest side of a picture, pixels: 8192^2 samples of a quarter pixel still count in 32 bits.
const LARGEST_SIDE: u32 = 8192;
/// A portrait lens: bodies keep their proportions. Radians (20 degrees).
const FRAMING_FIELD_OF_VIEW: f32 = 0.35;
/// Room between the subject and the edges of a picture, as a factor on its extent.
const FRAMING_MARGIN: f32 = 1.06;

/// A pinhole camera that looks at a point, upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands, metres.
    pub position: Vec3,
    /// What stands in the centre of the picture, metres.
    pub target: Vec3,
    /// The angle between the rays through the top and the bottom edge, radians, below pi.
    pub vertical_field_of_view: f32,
    /// Columns of the picture, pixels.
    pub width: u32,
    /// Rows of the picture, pixels.
    pub height: u32,
}

impl Camera {
    /// A camera that sees the whole box (`minimum`, `maximum`), level with its centre, from the direction `azimuth` about +Y
    /// ([`FRONT`] is +Z, positive turns towards +X, the subject's left).
    ///
    /// # Errors
    /// [`Error::Value`] if the box is empty or not finite (a mesh without vertices has no bounds).
    pub fn framing(minimum: Vec3, maximum: Vec3, azimuth: f32, width: u32, height: u32) -> Result<Self> {
        let extent = maximum - minimum;
        if !(extent.min_element() >= 0.0 && extent.max_element() > 0.0 && extent.is_finite() && azimuth.is_finite()) {
            return Err(Error::Value {
                name: "box to be framed".into(),
                found: format!("{minimum} to {maximum}, seen from azimuth {azimuth}"),
                expected: "a finite box with an extent".into(),
            });
        }
        let target = (minimum + maximum) / 2.0;
        let direction = Vec3::new(azimuth.sin(), 0.0, azimuth.cos());
        let right = Vec3::new(direction.z, 0.0, -direction.x);
        let vertical = (FRAMING_FIELD_OF_VIEW / 2.0).tan();
        let horizontal = vertical * width as f32 / height.max(1) as f32;
        let distance = (0..8)
            .map(|corner| {
                let side = |bit: u32| if corner >> bit & 1 == 0 { -0.5 } else { 0.5 };
                let offset = extent * Vec3::new(side(0), side(1), side(2)) * FRAMING_MARGIN;
                let opening = (offset.dot(right).abs() / horizontal).max(offset.y.abs() / vertical);
                opening + offset.dot(direction)
            })
            .fold(0.0, f32::max);
        let camera = Self {
            position: target + direction * distance,
            target,
            vertical_field_of_view: FRAMING_FIELD_OF_VIEW,
            width,
            height,
        };
        camera.projection().map(|_| camera)
    }

    /// The focal length f, pixels.
    pub fn focal_length(&self) -> f32 {
        self.height as f32 / 2.0 / (self.vertical_field_of_view / 2.0).tan()
    }

    /// The camera as the map from world to picture.
    ///
    /// # Errors
    /// [`Error::Value`] if the size, the field of view or the viewing direction cannot be used.
    pub(super) fn projection(&self) -> Result<Projection> {
        for (name, size) in [("picture width", self.width), ("picture height", self.height)] {
            if !(1..=LARGEST_SIDE).contains(&size) {
                return Err(Error::Value {
                    name: name.into(),
                    found: format!("{size} pixels"),
                    expected: format!("1 to {LARGEST_SIDE}"),
                });
            }
        }
        // Wider than 0.99 pi the focal length of a picture falls below a hundredth of its height.
        if !(0.001..=0.99 * std::f32::consts::PI).contains(&self.vertical_field_of_view) {
            return Err(Error::Value {
                name: "vertical field of view".into(),
                found: format!("{} rad", self.vertical_field_of_view),
                expected: "0.001 to 3.11".into(),
            });
        }
        let Some(forward) = (self.target - self.position).try_normalize() else {
            return Err(Error::Value {
                name: "viewing direction".into(),
                found: format!("from {} to {}", self.position, self.target),
                expected: "two different, finite points".into(),
            });
        };
        // Looking straight up or down, "upright" is what it tends to when the camera is tilted forward from facing -Z.
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let down = forward.cross(right);
        Ok(Projection {
            position: self.position,
            rotation: Mat3::from_cols(right, down, forward).transpose(),
            focal_length: self.focal_length(),
            centre: Vec2::new(self.width as f32, self.height as f32) / 2.0,
        })
    }
}

/// A camera's map from the world to its picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    position: Vec3,
    rotation: Mat3,
    focal_length: f32,
    centre: Vec2,
}

impl Projection {
    /// A point of the world in camera space, metres.
    pub fn to_camera(self, point: Vec3) -> Vec3 {
        self.rotation * (point - self.position)
    }

    /// A direction of the world in camera space.
    pub fn direction_to_camera(self, direction: Vec3) -> Vec3 {
        self.rotation * direction
    }

    /// The picture coordinates (u, v) of a point in camera space with z > 0, pixels.
    pub fn project(self, point: Vec3) -> Vec2 {
        point.truncate() * (self.focal_length / point.z) + self.centre
    }

    /// The ray through a point of the picture, in camera space, with z = 1.
    pub fn ray(self, pixel: Vec2) -> Vec3 {
        ((pixel - self.centre) / self.focal_length).extend(1.0)
    }

    /// Tangents of half the horizontal and vertical field of view.
    pub fn half_extent(self) -> Vec2 {
        self.centre / self.focal_length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn world_axes_appear_upright() {
        let camera = Camera {
            position: Vec3::new(0.0, 1.0, 5.0),
            target: Vec3::Y,
            vertical_field_of_view: 0.5,
            width: 300,
            height: 200,
        };
        let projection = camera.projection().unwrap();
        let pixel = |point| projection.project(projection.to_camera(point));
        assert!((pixel(Vec3::Y) - Vec2::new(150.0, 100.0)).length() < 1e-3);
        assert!(pixel(Vec3::new(0.3, 1.0, 0.0)).x > 150.0, "+X is on the right of a front view");
        assert!(pixel(Vec3::new(0.0, 1.3, 0.0)).y < 100.0, "+Y is up");
        assert!(
            (pixel(Vec3::new(0.0, 1.0 + 5.0 * 0.25_f32.tan(), 0.0)).y).abs() < 1e-3,
            "the field of view is vertical"
        );
    }

    #[test]
    fn ray_inverts_projection() {
        let camera =
            Camera { position: Vec3::ONE, target: Vec3::ZERO, vertical_field_of_view: 1.0, width: 64, height: 48 };
        let projection = camera.projection().unwrap();
        let pixel = Vec2::new(10.5, 40.25);
        assert!((projection.project(projection.ray(pixel) * 3.0) - pixel).length() < 1e-4);
    }

    #[test]
    fn framing_keeps_every_corner_inside_and_fills_the_picture() {
        let (minimum, maximum) = (Vec3::new(-0.9, -1.2, -0.2), Vec3::new(0.8, 0.6, 0.3));
        for azimuth in [FRONT, THREE_QUARTER, 2.0, -1.3] {
            let camera = Camera::framing(minimum, maximum, azimuth, 300, 500).unwrap();
            let projection = camera.projection().unwrap();
            let mut fill = 0.0_f32;
            for corner in 0..8 {
                let pick = |bit: u32, axis: usize| if corner >> bit & 1 == 0 { minimum[axis] } else { maximum[axis] };
                let pixel = projection.project(projection.to_camera(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2))));
                let relative = (pixel / Vec2::new(150.0, 250.0) - Vec2::ONE).abs();
                fill = fill.max(relative.max_element());
            }
            assert!((0.85..1.0).contains(&fill), "azimuth {azimuth}: corners reach {fill} of the half picture");
        }
    }

    #[test]
    fn impossible_cameras_are_errors() {
        let good = Camera { position: Vec3::Z, target: Vec3::ZERO, vertical_field_of_view: 0.5, width: 8, height: 8 };
        assert!(good.projection().is_ok());
        assert!(Camera { width: 0, ..good }.projection().is_err());
        assert!(Camera { height: 1 << 20, ..good }.projection().is_err());
        assert!(Camera { position: good.target, ..good }.projection().is_err());
        assert!(Camera { position: Vec3::NAN, ..good }.projection().is_err());
        assert!(Camera { vertical_field_of_view: f32::NAN, ..good }.projection().is_err());
        assert!(Camera { target: Vec3::new(0.0, -5.0, 1.0), ..good }.projection().is_ok(), "straight down");
        assert!(Camera::framing(Vec3::MAX, Vec3::MIN, FRONT, 8, 8).is_err(), "bounds of nothing");
    }
}
