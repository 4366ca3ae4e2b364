//! What chance decides of a picture: who, where the camera stands, the light.
//!
//! The camera sees all of the person, from any side and from 15 degrees below to 40 above; it turns a little about its axis. The person takes
//! from 45 to 95 % of the picture, anywhere in it.

use std::f32::consts::TAU;
use std::ops::Range;

use glam::{Mat3, Vec2, Vec3};
use rand::Rng;

use crate::Result;
use crate::mesh::camera::PinholeCamera;
use crate::render::Light;

/// Of the camera above the level of the person, radians.
const ELEVATION: Range<f32> = -0.26..0.70;
/// Of the camera about its own axis, radians.
const ROLL: Range<f32> = -0.12..0.12;
/// Between the upper and the lower edge, radians: from a telephoto lens to a phone's.
const FIELD_OF_VIEW: Range<f32> = 0.35..1.05;
/// Of the person's longer side, of the picture's.
const FILLED: Range<f32> = 0.45..0.95;
/// Of the key light.
const STRENGTH: Range<f32> = 0.55..1.15;
/// Of ambient light, of the studio's.
const AMBIENT: Range<f32> = 0.5..1.8;
/// How much warmer or colder than white light may be.
const TINT: Range<f32> = -0.08..0.08;

/// A camera that has all of these points in its picture.
///
/// # Errors
/// If there are no points, or they are in one place.
pub(super) fn camera(points: &[Vec3], size: [u32; 2], random: &mut impl Rng) -> Result<PinholeCamera> {
    let bounds = points.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), place| (low.min(*place), high.max(*place)));
    let (centre, radius) = ((bounds.0 + bounds.1) / 2.0, bounds.0.distance(bounds.1) / 2.0);
    let (azimuth, elevation) = (random.random_range(0.0..TAU), random.random_range(ELEVATION));
    let field_of_view = random.random_range(FIELD_OF_VIEW);
    let (roll, filled) = (random.random_range(ROLL), random.random_range(FILLED));
    let shift = Vec2::new(random.random_range(-1.0..1.0), random.random_range(-1.0..1.0));
    let towards = Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
    // Far enough that no limb is behind the camera; how large the person is, is the focal length's.
    let distance = (radius / (field_of_view / 2.0).tan()).max(1.5 * radius);
    let mut camera = PinholeCamera::looking_at(centre + towards * distance, centre, field_of_view, size)?;
    let turn = Mat3::from_rotation_z(roll);
    (camera.rotation, camera.translation) = (turn * camera.rotation, turn * camera.translation);
    let (low, high) = seen(&camera, points);
    let room = Vec2::new(camera.width as f32, camera.height as f32);
    let scale = filled / ((high - low) / room).max_element();
    (camera.fx, camera.fy) = (camera.fx * scale, camera.fy * scale);
    let (low, high) = seen(&camera, points);
    let free = (room - (high - low)) / 2.0;
    let moved = room / 2.0 - (low + high) / 2.0 + shift * free;
    (camera.cx, camera.cy) = (camera.cx + moved.x, camera.cy + moved.y);
    camera.check()?;
    Ok(camera)
}

/// A light from the camera's side of the person.
pub(super) fn light(random: &mut impl Rng) -> Light {
    let (azimuth, elevation) = (random.random_range(-1.4..1.4_f32), random.random_range(-0.2..1.2_f32));
    let warmth: f32 = random.random_range(TINT);
    Light {
        towards: Vec3::new(azimuth.sin() * elevation.cos(), -elevation.sin(), -azimuth.cos() * elevation.cos()),
        strength: random.random_range(STRENGTH),
        ambient: random.random_range(AMBIENT),
        tint: Vec3::new(1.0 + warmth, 1.0, 1.0 - warmth),
    }
}

/// The corners of the box around points in the picture.
fn seen(camera: &PinholeCamera, points: &[Vec3]) -> (Vec2, Vec2) {
    points.iter().fold((Vec2::MAX, Vec2::MIN), |(low, high), point| {
        let (place, _) = camera.project(*point);
        (low.min(place), high.max(place))
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_whole_person_is_in_every_picture_and_fills_it_as_said() {
        let corner = |index: usize| {
            let side = |axis: usize, reach: f32| if index >> axis & 1 == 0 { -reach } else { reach };
            Vec3::new(5.0 + side(0, 0.9), side(1, 0.9), side(2, 0.25))
        };
        let points: Vec<Vec3> = (0..8).map(corner).collect();
        let (mut nearest, mut farthest) = (f32::MAX, 0.0_f32);
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let camera = camera(&points, [300, 200], &mut random).unwrap();
            assert!(points.iter().all(|point| camera.to_camera(*point).z > 0.0));
            let (low, high) = seen(&camera, &points);
            let room = Vec2::new(300.0, 200.0);
            assert!(low.cmpge(Vec2::ZERO).all() && high.cmple(room).all(), "{seed}: {low} {high}");
            let filled = ((high - low) / room).max_element();
            (nearest, farthest) = (nearest.min(filled), farthest.max(filled));
        }
        assert!(nearest > 0.44 && nearest < 0.55 && farthest > 0.85 && farthest < 0.96, "{nearest} {farthest}");
        assert!(camera(&[], [300, 200], &mut ChaCha8Rng::seed_from_u64(0)).is_err());
    }
}
