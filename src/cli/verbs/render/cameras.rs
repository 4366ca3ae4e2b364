//! The camera of a film: one place for all of it, or, where the subject walks away, beside the subject.

use glam::{Mat3, Vec3};
use xavatar::mesh::camera::{FRONT, PinholeCamera, THREE_QUARTER};

/// What clothes and hair add to the body, metres.
const CLOTHING: f32 = 0.06;
/// What soles add, metres.
const SOLE: f32 = 0.01;
/// A subject that gets farther than this from where it began is followed, metres.
const FARTHEST_WITHOUT_FOLLOWING: f32 = 0.8;

/// Cameras for the pictures of a film.
pub struct FilmCameras {
    camera: PinholeCamera,
    /// What a turntable turns about.
    centre: Vec3,
    /// How far the camera has moved along with the subject in each picture.
    followed: Vec<Vec3>,
    /// Height of the floor, metres.
    pub floor: f32,
}

/// Where the body is in a frame of a film.
pub struct Stance {
    /// The corners of a box around it and what it wears, level and aligned with the camera.
    corners: [Vec3; 8],
    pelvis: Vec3,
}

impl Stance {
    /// Of a body's vertices.
    pub fn new(body: &[Vec3], pelvis: Vec3) -> Self {
        let turn = Mat3::from_rotation_y(-THREE_QUARTER);
        let places = || body.iter().map(|place| turn * *place);
        let low = places().fold(Vec3::MAX, Vec3::min) - Vec3::new(CLOTHING, SOLE, CLOTHING);
        let high = places().fold(Vec3::MIN, Vec3::max) + CLOTHING;
        let side = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let corner = |corner| turn.transpose() * Vec3::from_array([0, 1, 2].map(|axis| side(corner, axis)));
        Self { corners: std::array::from_fn(corner), pelvis }
    }
}

impl FilmCameras {
    /// For bodies that are all in the picture.
    pub fn of(stances: &[Stance], size: (u32, u32)) -> xavatar::Result<Self> {
        let start = stances.first().map_or(Vec3::ZERO, |stance| stance.pelvis);
        let ways: Vec<Vec3> = stances.iter().map(|stance| level(stance.pelvis - start)).collect();
        let follows = ways.iter().any(|way| way.length() > FARTHEST_WITHOUT_FOLLOWING);
        let followed = if follows { ways } else { vec![Vec3::ZERO; stances.len()] };
        let moved = |(stance, way): (&Stance, &Vec3)| stance.corners.map(|corner| corner - *way);
        let places: Vec<Vec3> = stances.iter().zip(&followed).flat_map(moved).collect();
        let (low, high) = bounds(&places);
        Ok(Self {
            camera: PinholeCamera::framing_points(&places, THREE_QUARTER, size.0, size.1)?,
            centre: (low + high) / 2.0,
            followed,
            floor: low.y,
        })
    }

    /// For one body, seen from all sides.
    pub fn around(body: &[Vec3], size: (u32, u32)) -> xavatar::Result<Self> {
        let (low, high) = bounds(body);
        let (low, high) = (low - Vec3::Y * SOLE, high + Vec3::Y * CLOTHING);
        let centre = (low + high) / 2.0;
        // Whatever the side, within the same circle.
        let radius = body.iter().map(|place| level(*place - centre).length()).fold(0.0, f32::max) + CLOTHING;
        let reach = Vec3::new(radius, 0.0, 0.0);
        let middle = level(centre);
        let mut camera = PinholeCamera::framing(
            middle - reach + Vec3::Y * low.y,
            middle + reach + Vec3::Y * high.y,
            FRONT,
            size.0,
            size.1,
        )?;
        // Nearer than the middle by the radius, limbs look larger.
        camera.translation.z += radius;
        Ok(Self { camera, centre, followed: vec![Vec3::ZERO], floor: low.y })
    }

    /// The camera of picture `index`.
    pub fn at(&self, index: usize) -> PinholeCamera {
        let PinholeCamera { rotation, translation, .. } = self.camera;
        PinholeCamera { translation: translation - rotation * self.followed[index], ..self.camera }
    }

    /// The camera that has gone around the subject by `angle`, radians.
    pub fn turned(&self, angle: f32) -> PinholeCamera {
        self.camera.gone_around(self.centre, angle)
    }
}

fn level(offset: Vec3) -> Vec3 {
    Vec3::new(offset.x, 0.0, offset.z)
}

fn bounds(places: &[Vec3]) -> (Vec3, Vec3) {
    places.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), place| (low.min(*place), high.max(*place)))
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
        let inside = |camera: &PinholeCamera, places: &[Vec3]| {
            places.iter().all(|place| {
                let (pixel, _) = camera.project(*place);
                pixel.cmpgt(glam::Vec2::ZERO).all() && pixel.x < 300.0 && pixel.y < 400.0
            })
        };
        let stances =
            |bodies: &[(Vec<Vec3>, Vec3)]| bodies.iter().map(|body| Stance::new(&body.0, body.1)).collect::<Vec<_>>();
        let near = [body(Vec3::ZERO), body(Vec3::X * 0.5)];
        let still = FilmCameras::of(&stances(&near), (300, 400)).unwrap();
        assert_eq!(still.at(0), still.at(1), "a short way needs no other camera");
        assert!(near.iter().enumerate().all(|(index, pose)| inside(&still.at(index), &pose.0)));
        let walk: Vec<_> = (0..9).map(|step| body(Vec3::Z * step as f32)).collect();
        let moving = FilmCameras::of(&stances(&walk), (300, 400)).unwrap();
        assert!(walk.iter().enumerate().all(|(index, pose)| inside(&moving.at(index), &pose.0)));
        let around = FilmCameras::around(&near[1].0, (300, 400)).unwrap();
        assert!((0..12).all(|side| inside(&around.turned(turn(side, 12)), &near[1].0)));
    }
}
