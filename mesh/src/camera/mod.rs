//! A calibrated pinhole camera: u = fx x / z + cx, v = fy y / z + cy for a point (x, y, z) in camera space.
//!
//! OpenCV's convention: camera space has x right, y down and z forward; the extrinsics map world to camera, x_c = R x_w + t.
//! Metres and pixels. Pixel (column, row) covers [column, column + 1) x [row, row + 1): its centre is at column + 0.5, half a
//! pixel more than in OpenCV's own coordinates, which readers of calibrations convert. No lens distortion.

mod framing;

pub use framing::{FRONT, THREE_QUARTER, framing_row};

use glam::{Mat3, Mat4, Quat, Vec2, Vec3};

use xavatar_formats::{Error, Result};

/// Longest side of a picture, pixels.
pub const LARGEST_SIDE: u32 = 8192;
/// How far an entry of R R^T may be from that of the identity: calibrations are written with few digits.
const ORTHOGONALITY: f32 = 0.02;

/// Intrinsics and pose of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PinholeCamera {
    /// Columns of the picture, pixels.
    pub width: u32,
    /// Rows of the picture, pixels.
    pub height: u32,
    /// Focal length along a row, pixels.
    pub fx: f32,
    /// Focal length along a column, pixels.
    pub fy: f32,
    /// The principal point's distance from the left edge, pixels.
    pub cx: f32,
    /// The principal point's distance from the upper edge, pixels.
    pub cy: f32,
    /// R: world to camera.
    pub rotation: Mat3,
    /// t: the world's origin in camera space, metres.
    pub translation: Vec3,
}

impl PinholeCamera {
    /// A camera at `position` that looks at `target`, upright, with square pixels and a centred principal point.
    ///
    /// # Errors
    /// [`Error::Value`] as [`check`](Self::check), or if the two points coincide or the field of view (radians) is not
    /// between 0.001 and 3.11.
    pub fn looking_at(
        position: Vec3,
        target: Vec3,
        vertical_field_of_view: f32,
        [width, height]: [u32; 2],
    ) -> Result<Self> {
        if !(0.001..=3.11).contains(&vertical_field_of_view) {
            return Err(wrong("vertical field of view", format!("{vertical_field_of_view} rad"), "0.001 to 3.11"));
        }
        let Some(forward) = (target - position).try_normalize() else {
            return Err(wrong("viewing direction", format!("from {position} to {target}"), "two different points"));
        };
        // Looking straight up or down, "upright" is what it tends to when the camera is tilted forward from facing -Z.
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let rotation = Mat3::from_cols(right, forward.cross(right), forward).transpose();
        let focal_length = height as f32 / 2.0 / (vertical_field_of_view / 2.0).tan();
        let camera = Self {
            width,
            height,
            fx: focal_length,
            fy: focal_length,
            cx: width as f32 / 2.0,
            cy: height as f32 / 2.0,
            rotation,
            translation: -(rotation * position),
        };
        camera.check()?;
        Ok(camera)
    }

    /// The camera posed by `extrinsic`, the 4 x 4 matrix that takes world to camera coordinates; R is made exactly orthogonal.
    ///
    /// # Errors
    /// [`Error::Value`] if the matrix is not a rotation and a translation: a scale, a mirror image, another last row.
    pub fn posed(mut self, extrinsic: Mat4) -> Result<Self> {
        let rotation = Mat3::from_mat4(extrinsic);
        if !extrinsic.row(3).abs_diff_eq(glam::Vec4::W, 1e-4) || !is_rotation(rotation) {
            return Err(wrong(
                "extrinsic matrix",
                extrinsic,
                "[R t; 0 0 0 1] with a rotation R, world to camera, metres",
            ));
        }
        self.rotation = Mat3::from_quat(Quat::from_mat3(&rotation).normalize());
        self.translation = extrinsic.w_axis.truncate();
        self.check()?;
        Ok(self)
    }

    /// Checks what projection relies on: a size within [`LARGEST_SIDE`], finite numbers, positive focal lengths, a rotation.
    ///
    /// # Errors
    /// [`Error::Value`] naming the first number that is wrong.
    pub fn check(&self) -> Result<()> {
        for (name, size) in [("picture width", self.width), ("picture height", self.height)] {
            if !(1..=LARGEST_SIDE).contains(&size) {
                return Err(wrong(name, format!("{size} pixels"), format!("1 to {LARGEST_SIDE}")));
            }
        }
        for (name, length) in [("fx", self.fx), ("fy", self.fy)] {
            if !(length.is_finite() && length > 0.0) {
                return Err(wrong(name, format!("{length} pixels"), "a positive focal length"));
            }
        }
        for (name, place) in [("cx", self.cx), ("cy", self.cy)] {
            if !place.is_finite() {
                return Err(wrong(name, format!("{place} pixels"), "a finite principal point"));
            }
        }
        if !is_rotation(self.rotation) {
            return Err(wrong("camera rotation", self.rotation, "an orthogonal matrix of determinant 1"));
        }
        if !self.translation.is_finite() {
            return Err(wrong("camera translation", self.translation, "finite metres"));
        }
        Ok(())
    }

    /// The 4 x 4 matrix that takes world to camera coordinates.
    pub fn extrinsic(&self) -> Mat4 {
        Mat4::from_mat3_translation(self.rotation, self.translation)
    }

    /// Where the camera stands, world, metres.
    pub fn position(&self) -> Vec3 {
        -(self.rotation.transpose() * self.translation)
    }

    /// The angle between the rays through the upper and the lower edge, radians.
    pub fn vertical_field_of_view(&self) -> f32 {
        (self.cy / self.fy).atan() + ((self.height as f32 - self.cy) / self.fy).atan()
    }

    /// A point of the world in camera space, metres.
    pub fn to_camera(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// A point of camera space in the world, metres.
    pub fn to_world(&self, point: Vec3) -> Vec3 {
        self.rotation.transpose() * (point - self.translation)
    }

    /// The picture coordinates (u, v), pixels, and depth z, metres, of a point of the world; meaningful where z > 0.
    pub fn project(&self, point: Vec3) -> (Vec2, f32) {
        let Vec3 { x, y, z } = self.to_camera(point);
        (Vec2::new(self.fx * x / z + self.cx, self.fy * y / z + self.cy), z)
    }

    /// The ray through a point (u, v) of the picture, in camera space, with z = 1.
    pub fn ray(&self, pixel: Vec2) -> Vec3 {
        Vec3::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy, 1.0)
    }

    /// The point of the world seen at (u, v) of the picture at depth z, metres: the inverse of [`project`](Self::project).
    pub fn back_project(&self, pixel: Vec2, depth: f32) -> Vec3 {
        self.to_world(self.ray(pixel) * depth)
    }
}

/// The centre of a pixel in picture coordinates.
pub fn pixel_centre(column: u32, row: u32) -> Vec2 {
    Vec2::new(column as f32 + 0.5, row as f32 + 0.5)
}

fn is_rotation(matrix: Mat3) -> bool {
    matrix.is_finite()
        && (matrix * matrix.transpose()).abs_diff_eq(Mat3::IDENTITY, ORTHOGONALITY)
        && matrix.determinant() > 0.0
}

fn wrong(name: &str, found: impl ToString, expected: impl Into<String>) -> Error {
    Error::Value { name: name.into(), found: found.to_string(), expected: expected.into() }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn thesis_camera() -> PinholeCamera {
        PinholeCamera::looking_at(Vec3::new(3.0, 1.2, 5.2), Vec3::Y, 30.0_f32.to_radians(), [800, 1200]).unwrap()
    }

    #[test]
    fn back_projection_inverts_projection() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let looking = thesis_camera();
        let uneven = PinholeCamera { fx: 1100.0, fy: 1305.0, cx: 390.2, cy: 641.8, ..looking };
        for camera in [looking, uneven] {
            for _ in 0..10_000 {
                let point = Vec3::from(random.random::<[f32; 3]>()) * 2.0 - Vec3::new(1.0, 0.0, 1.0);
                let (pixel, depth) = camera.project(point);
                let back = camera.back_project(pixel, depth);
                assert!(back.abs_diff_eq(point, 1e-5), "{point} is {back} again");
                let (again, same_depth) = camera.project(back);
                assert!((again - pixel).length() < 1e-5 * pixel.length() && (same_depth - depth).abs() < 1e-5);
            }
        }
    }

    // A world with y down and z forward is its own camera space.
    #[test]
    fn opencv_axes_run_right_down_and_forward() {
        let camera = PinholeCamera { rotation: Mat3::IDENTITY, translation: Vec3::ZERO, ..thesis_camera() };
        let (centre, depth) = camera.project(Vec3::Z * 2.0);
        assert_eq!((centre, depth), (Vec2::new(400.0, 600.0), 2.0));
        assert!(camera.project(Vec3::new(0.1, 0.0, 2.0)).0.x > centre.x);
        assert!(camera.project(Vec3::new(0.0, 0.1, 2.0)).0.y > centre.y);
    }

    #[test]
    fn a_camera_looks_where_it_is_told_upright() {
        let camera = thesis_camera();
        assert!(camera.position().abs_diff_eq(Vec3::new(3.0, 1.2, 5.2), 1e-5));
        let (centre, depth) = camera.project(Vec3::Y);
        assert!(centre.abs_diff_eq(Vec2::new(400.0, 600.0), 1e-2));
        assert!((depth - Vec3::new(3.0, 0.2, 5.2).length()).abs() < 1e-5);
        assert!(camera.project(Vec3::Y * 1.5).0.y < centre.y, "up is up");
        assert!((camera.vertical_field_of_view() - 30.0_f32.to_radians()).abs() < 1e-6);
    }

    #[test]
    fn extrinsics_survive_and_are_made_orthogonal() {
        let camera = thesis_camera();
        let again = camera.posed(camera.extrinsic()).unwrap();
        assert!(again.extrinsic().abs_diff_eq(camera.extrinsic(), 1e-6));
        let rounded = Mat4::from_cols_array(&camera.extrinsic().to_cols_array().map(|x| (x * 1e3).round() / 1e3));
        let rotation = camera.posed(rounded).unwrap().rotation;
        assert!((rotation * rotation.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-6));
    }

    #[test]
    fn what_is_no_camera_is_an_error() {
        let camera = thesis_camera();
        let extrinsic = camera.extrinsic();
        for broken in [
            extrinsic * 1000.0,
            extrinsic.transpose(),
            extrinsic * Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0)),
            Mat4::ZERO,
            Mat4::NAN,
        ] {
            assert!(camera.posed(broken).unwrap_err().to_string().contains("extrinsic"), "{broken}");
        }
        for broken in [
            PinholeCamera { width: 0, ..camera },
            PinholeCamera { height: 1 << 20, ..camera },
            PinholeCamera { fx: -1.0, ..camera },
            PinholeCamera { fy: f32::INFINITY, ..camera },
            PinholeCamera { cx: f32::NAN, ..camera },
            PinholeCamera { translation: Vec3::NAN, ..camera },
        ] {
            assert!(broken.check().is_err(), "{broken:?}");
        }
        assert!(PinholeCamera::looking_at(Vec3::X, Vec3::X, 0.5, [8, 8]).is_err());
        assert!(PinholeCamera::looking_at(Vec3::X, Vec3::Y, 0.0, [8, 8]).is_err());
        assert!(PinholeCamera::looking_at(Vec3::Y, Vec3::ZERO, 0.5, [8, 8]).is_ok(), "straight down");
    }
}
