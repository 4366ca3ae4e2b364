//! Joints of the body, by BlazePose (Bazarevsky et al. 2020), from around the person.
//!
//! The network wants the hips in the middle, the torso upright and all of the person in the picture. A first round of pictures, framed by
//! the silhouette, says where hips and shoulders are; the second is framed by these, so that it sees people who lean or lie as it
//! sees those who stand.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;
use xavatar_mesh::camera::PinholeCamera;
use xavatar_render::Scene;

use crate::models::Models;
use crate::network::{Network, Workspace};
use crate::picture::{Square, ray, taken};
use crate::rays::{Meeting, Ray, meeting};

/// Points that the network finds; those besides the joints are not used here.
const POINTS: usize = 33;
/// Numbers of each: x, y, z, visibility, presence.
const NUMBERS: usize = 5;
/// Pictures of the first round, level.
const FIRST: usize = 12;
/// Pictures of the second round: how many, and how far above the horizon the camera is, radians.
const SECOND: [(usize, f32); 2] = [(24, 0.0), (12, 0.436)];
/// How far cameras are from the person, metres.
const DISTANCE: f32 = 4.0;
/// Side of a picture, of what has to be in it.
pub const MARGIN: f32 = 1.25;
/// Its rows and columns.
pub const PIXELS: u32 = 256;
/// Pictures in which the network is less sure that there is a person say nothing.
const PERSON: f32 = 0.5;
/// Points that are less surely seen say nothing.
const SEEN: f64 = 0.2;
/// Rays that pass farther from a joint than this see another place, metres.
pub const REACH: f64 = 0.08;
/// A picture of whose points less are where the others see them is not used.
const AGREEING: f64 = 0.5;

/// Numbers of the points.
pub mod point {
    pub const LEFT_EYE: usize = 2;
    pub const RIGHT_EYE: usize = 5;
    pub const LEFT_SHOULDER: usize = 11;
    pub const RIGHT_SHOULDER: usize = 12;
    pub const LEFT_ELBOW: usize = 13;
    pub const RIGHT_ELBOW: usize = 14;
    pub const LEFT_WRIST: usize = 15;
    pub const RIGHT_WRIST: usize = 16;
    pub const LEFT_PINKY: usize = 17;
    pub const RIGHT_PINKY: usize = 18;
    pub const LEFT_INDEX: usize = 19;
    pub const RIGHT_INDEX: usize = 20;
    pub const LEFT_HIP: usize = 23;
    pub const RIGHT_HIP: usize = 24;
    pub const LEFT_KNEE: usize = 25;
    pub const RIGHT_KNEE: usize = 26;
    pub const LEFT_ANKLE: usize = 27;
    pub const RIGHT_ANKLE: usize = 28;
}

/// What one picture says.
struct Sight {
    /// By point; none if it is not seen.
    rays: Vec<Option<Ray>>,
}

/// The points of a person, by number; none where pictures do not agree on a place.
///
/// # Errors
/// Those of [`Scene::render`].
pub fn find(models: &Models, scan: &TriangleMesh, scene: &Scene<'_>) -> Result<Vec<Option<Meeting>>> {
    let cameras: Vec<PinholeCamera> = around(FIRST, 0.0).map(|direction| framed(scan, direction)).collect();
    let first = met(&sights(&models.body, scene, &cameras)?);
    let middle = |one: usize, other: usize| Some((first[one]?.place + first[other]?.place) / 2.0);
    let hips = middle(point::LEFT_HIP, point::RIGHT_HIP);
    let shoulders = middle(point::LEFT_SHOULDER, point::RIGHT_SHOULDER);
    let (Some(hips), Some(shoulders)) = (hips, shoulders) else { return Ok(first) };
    let directions = SECOND.iter().flat_map(|(count, elevation)| around(*count, *elevation));
    let cameras: Vec<PinholeCamera> =
        directions.map(|direction| upright(scan, direction, hips.as_vec3(), (shoulders - hips).as_vec3())).collect();
    Ok(met(&sights(&models.body, scene, &cameras)?))
}

/// Directions to cameras all around.
fn around(count: usize, elevation: f32) -> impl Iterator<Item = Vec3> {
    (0..count).map(move |index| {
        let (sin, cos) = (std::f32::consts::TAU * index as f32 / count as f32).sin_cos();
        Vec3::new(sin * elevation.cos(), elevation.sin(), cos * elevation.cos())
    })
}

/// A picture of all of a scan.
fn framed(scan: &TriangleMesh, direction: Vec3) -> PinholeCamera {
    let right = Vec3::Y.cross(direction).normalize();
    let up = direction.cross(right);
    let axes = [right, up, direction];
    let [low, high] = scan.vertices.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], vertex| {
        let along = Vec3::from_array(axes.map(|axis| axis.dot(*vertex)));
        [low.min(along), high.max(along)]
    });
    let middle = (low + high) / 2.0;
    let extent = high - low;
    square(right * middle.x + up * middle.y + direction * middle.z, direction, Vec3::Y, extent.x.max(extent.y))
}

/// A picture with the hips in the middle and the torso upright.
fn upright(scan: &TriangleMesh, direction: Vec3, hips: Vec3, torso: Vec3) -> PinholeCamera {
    let across = |vertex: &Vec3| (*vertex - hips).cross(direction).length_squared();
    let radius = scan.vertices.iter().map(across).fold(0.0, f32::max).sqrt();
    square(hips, direction, torso, 2.0 * radius)
}

fn square(middle: Vec3, towards_camera: Vec3, up: Vec3, extent: f32) -> PinholeCamera {
    Square { middle, towards_camera, up, distance: DISTANCE, side: MARGIN * extent, pixels: PIXELS }.camera()
}

fn sights(network: &Network, scene: &Scene<'_>, cameras: &[PinholeCamera]) -> Result<Vec<Sight>> {
    let sight = |workspace: &mut Workspace, camera: &PinholeCamera| -> Result<Option<Sight>> {
        let Some(seen) = seen(&network.run(&taken(scene, camera)?, workspace)) else { return Ok(None) };
        let rays = seen.into_iter().map(|seen| seen.map(|(at, weight)| ray(camera, at, weight)));
        Ok(Some(Sight { rays: rays.collect() }))
    };
    let sights = cameras.par_iter().map_init(Workspace::default, sight).collect::<Result<Vec<_>>>()?;
    Ok(sights.into_iter().flatten().collect())
}

/// Where in the picture the network sees each point, pixels, and how surely; none if there is no person.
pub fn seen(outputs: &[Vec<f32>]) -> Option<Vec<Option<(Vec2, f64)>>> {
    let [points, person] = outputs else { return None };
    let point = |numbers: &[f32]| {
        let weight = sigmoid(numbers[3]) * sigmoid(numbers[4]);
        (weight > SEEN).then(|| (Vec2::new(numbers[0], numbers[1]), weight))
    };
    (person[0] >= PERSON).then(|| points.chunks_exact(NUMBERS).take(POINTS).map(point).collect())
}

fn sigmoid(value: f32) -> f64 {
    1.0 / (1.0 + f64::from(-value).exp())
}

/// Where pictures agree that points are; those that mostly disagree are left out first.
fn met(sights: &[Sight]) -> Vec<Option<Meeting>> {
    let of = |sights: &[&Sight]| -> Vec<Option<Meeting>> {
        let point = |point: usize| {
            let rays: Vec<Ray> = sights.iter().filter_map(|sight| sight.rays[point]).collect();
            meeting(&rays, REACH)
        };
        (0..POINTS).into_par_iter().map(point).collect()
    };
    let all = of(&sights.iter().collect::<Vec<_>>());
    let agrees = |sight: &&Sight| {
        let pairs = sight.rays.iter().zip(&all).filter_map(|(ray, met)| Some((*ray)?.distance((*met)?.place)));
        let distances: Vec<f64> = pairs.collect();
        let near = distances.iter().filter(|distance| **distance < REACH).count();
        near as f64 >= AGREEING * distances.len() as f64
    };
    of(&sights.iter().filter(agrees).collect::<Vec<_>>())
}

/// The middle of two points, if both are there.
pub fn place(points: &[Option<Meeting>], point: usize) -> Option<DVec3> {
    points.get(point).copied().flatten().map(|met| met.place)
}
