//! The camera of a film: one place for all of it, or, where the subject walks away, beside the subject.

use glam::Vec3;
use xavatar::render::{Camera, FRONT, THREE_QUARTER};

/// What clothes and hair add to the body, metres.
const CLOTHING: f32 = 0.06;
/// A subject that gets farther than this from where it began is followed, metres.
const FARTHEST_WITHOUT_FOLLOWING: f32 = 0.8;

/// Cameras for the pictures of a film.
pub struct FilmCameras {
    camera: Camera,
    /// What a turntable turns about.
    centre: Vec3,
    /// How far the camera has moved along with the subject in each picture.
    followed: Vec<Vec3>,
    /// Height of the floor, metres.
    pub floor: f32,
}

impl FilmCameras {
    /// For bodies, as vertices and pelvis, that are all in the picture; from all sides if `turns`.
    pub fn of(poses: &[(Vec<Vec3>, Vec3)], size: (u32, u32), turns: bool) -> xavatar::Result<Self> {
        let level = |offset: Vec3| Vec3::new(offset.x, 0.0, offset.z);
        let start = poses.first().map_or(Vec3::ZERO, |pose| pose.1);
        let farthest = poses.iter().map(|pose| level(pose.1 - start).length()).fold(0.0, f32::max);
        let follows = farthest > FARTHEST_WITHOUT_FOLLOWING;
        let followed: Vec<Vec3> =
            poses.iter().map(|pose| if follows { level(pose.1 - start) } else { Vec3::ZERO }).collect();
        let places =
            || poses.iter().zip(&followed).flat_map(|(pose, moved)| pose.0.iter().map(|place| *place - *moved));
        let low = places().fold(Vec3::MAX, Vec3::min) - Vec3::new(CLOTHING, 0.01, CLOTHING);
        let high = places().fold(Vec3::MIN, Vec3::max) + CLOTHING;
        let mut cameras = Self {
            camera: Camera::framing(low, high, THREE_QUARTER, size.0, size.1)?,
            centre: (low + high) / 2.0,
            followed: followed.clone(),
            floor: low.y,
        };
        if turns {
            // Whatever the side, within the same circle.
            let about = |place: Vec3| level(place - cameras.centre).length();
            let radius = places().map(about).fold(0.0, f32::max) + CLOTHING;
            let reach = Vec3::new(radius, 0.0, 0.0);
            let middle = Vec3::new(cameras.centre.x, 0.0, cameras.centre.z);
            let (low, high) = (middle - reach + Vec3::Y * low.y, middle + reach + Vec3::Y * high.y);
            cameras.camera = Camera::framing(low, high, FRONT, size.0, size.1)?;
            // Nearer than the middle by the radius, limbs look larger.
            let back = cameras.camera.rotation.transpose() * Vec3::NEG_Z * radius;
            cameras.camera.translation -= cameras.camera.rotation * back;
        }
        Ok(cameras)
    }

    /// For one body, seen from all sides.
    pub fn around(body: &[Vec3], size: (u32, u32)) -> xavatar::Result<Self> {
        Self::of(&[(body.to_vec(), Vec3::ZERO)], size, true)
    }

    /// The camera of picture `index`.
    pub fn at(&self, index: usize) -> Camera {
        let Camera { rotation, translation, .. } = self.camera;
        Camera { translation: translation - rotation * self.followed[index], ..self.camera }
    }

    /// The camera that has gone around the subject by `angle`, radians.
    pub fn turned(&self, angle: f32) -> Camera {
        self.camera.gone_around(self.centre, angle)
    }
}

/// The angle of step `index` of `count` around the subject, radians.
pub fn turn(index: usize, count: usize) -> f32 {
    std::f32::consts::TAU * index as f32 / count as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(offset: Vec3) -> (Vec<Vec3>, Vec3) {
        let vertices = [[-0.9, 0.0, 0.1], [0.9, 1.4, 0.0], [0.0, 1.8, -0.1], [0.1, 0.0, 0.3]];
        (vertices.map(|place| Vec3::from(place) + offset).to_vec(), Vec3::Y + offset)
    }

    #[test]
    fn every_pose_and_every_side_is_in_the_picture() {
        let inside = |camera: &Camera, places: &[Vec3]| {
            places.iter().all(|place| {
                let (pixel, _) = camera.project(*place);
                pixel.cmpgt(glam::Vec2::ZERO).all() && pixel.x < 300.0 && pixel.y < 400.0
            })
        };
        let near = [body(Vec3::ZERO), body(Vec3::X * 0.5)];
        let still = FilmCameras::of(&near, (300, 400), false).unwrap();
        assert_eq!(still.at(0), still.at(1), "a short way needs no other camera");
        assert!(near.iter().enumerate().all(|(index, pose)| inside(&still.at(index), &pose.0)));
        let walk: Vec<_> = (0..9).map(|step| body(Vec3::Z * step as f32)).collect();
        let moving = FilmCameras::of(&walk, (300, 400), false).unwrap();
        assert!(walk.iter().enumerate().all(|(index, pose)| inside(&moving.at(index), &pose.0)));
        let around = FilmCameras::around(&near[1].0, (300, 400)).unwrap();
        assert!((0..12).all(|side| inside(&around.turned(turn(side, 12)), &near[1].0)));
    }
}
