//! The floor that a subject stands on: white, and seen only by the soft shadow on it.
//!
//! The openness to the sky of a grid of places at one height y, bilinear between them, 1 beyond. Metres.

use glam::{Vec2, Vec3};

use super::occlusion::Sky;
use xavatar_mesh::TriangleMesh;
use xavatar_mesh::camera::PinholeCamera;

/// Places along each side of the grid.
const SIDE: usize = 96;
/// How far the grid reaches beyond the mesh, in heights of the mesh.
const REACH: f32 = 0.45;
/// Times that a place takes the mean with its neighbours: the steps between the sky's directions go.
const SMOOTHINGS: usize = 6;
/// Share of the grid over which its shadow fades at the edge.
const FADE: f32 = 0.25;

/// The shadow on the floor.
pub(super) struct Floor {
    height: f32,
    low: Vec2,
    high: Vec2,
    /// (z, x).
    openness: Vec<f32>,
}

impl Floor {
    /// The floor below a mesh, at this height.
    pub fn below(mesh: &TriangleMesh, height: f32, sky: &Sky) -> Self {
        let low = mesh.vertices.iter().copied().fold(Vec3::MAX, Vec3::min);
        let high = mesh.vertices.iter().copied().fold(Vec3::MIN, Vec3::max);
        let reach = (high.y - low.y) * REACH;
        let (low, high) = (Vec2::new(low.x, low.z) - reach, Vec2::new(high.x, high.z) + reach);
        let places: Vec<Vec3> = (0..SIDE * SIDE)
            .map(|index| {
                let share = Vec2::new((index % SIDE) as f32, (index / SIDE) as f32) / (SIDE - 1) as f32;
                let place = low + (high - low) * share;
                Vec3::new(place.x, height, place.y)
            })
            .collect();
        let mut openness = sky.openness(&places, &vec![Vec3::Y; places.len()]);
        for _ in 0..SMOOTHINGS {
            openness = smoothed(&openness);
        }
        for (index, open) in openness.iter_mut().enumerate() {
            let from_edge =
                [index % SIDE, index / SIDE].map(|at| at.min(SIDE - 1 - at) as f32 / (SIDE - 1) as f32 / FADE);
            let fade = from_edge.map(|share| share.min(1.0)).into_iter().product::<f32>();
            *open = 1.0 - (1.0 - *open) * fade * fade * (3.0 - 2.0 * fade);
        }
        Self { height, low, high, openness }
    }

    /// The openness where the ray through a place of the picture meets the floor; 1 where it does not.
    pub fn openness(&self, camera: &PinholeCamera, pixel: Vec2) -> f32 {
        let position = camera.position();
        let ray = camera.rotation.transpose() * camera.ray(pixel);
        let along = (self.height - position.y) / ray.y;
        if !(along.is_finite() && along > 0.0) {
            return 1.0;
        }
        let meeting = position + ray * along;
        let share = (Vec2::new(meeting.x, meeting.z) - self.low) / (self.high - self.low);
        if !(share.cmpge(Vec2::ZERO).all() && share.cmplt(Vec2::ONE).all()) {
            return 1.0;
        }
        let place = share * (SIDE - 1) as f32;
        let (x, z) = (place.x as usize, place.y as usize);
        let part = place - place.floor();
        let at = |x: usize, z: usize| self.openness[z.min(SIDE - 1) * SIDE + x.min(SIDE - 1)];
        let row = |z: usize| at(x, z) * (1.0 - part.x) + at(x + 1, z) * part.x;
        row(z) * (1.0 - part.y) + row(z + 1) * part.y
    }
}

fn smoothed(values: &[f32]) -> Vec<f32> {
    let at = |x: usize, z: usize| values[z.min(SIDE - 1) * SIDE + x.min(SIDE - 1)];
    (0..SIDE * SIDE)
        .map(|index| {
            let (x, z) = (index % SIDE, index / SIDE);
            let around = at(x.saturating_sub(1), z) + at(x + 1, z) + at(x, z.saturating_sub(1)) + at(x, z + 1);
            (2.0 * at(x, z) + around) / 6.0
        })
        .collect()
}
