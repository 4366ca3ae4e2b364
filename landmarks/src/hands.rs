//! Joints and tips of the fingers, by MediaPipe's hand network (Zhang et al. 2020), from close around each hand.
//!
//! The hand is looked for beyond the wrist, the fingers pointing up in the picture, with all cut away that is farther from it; then once more
//! where the first pictures saw it. The network also says whether there is a hand, and which: where few pictures see one, or more of
//! them the other one, the scan has none here.

use glam::{DVec3, Vec2};
use rayon::prelude::*;
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;
use xavatar_mesh::camera::PinholeCamera;
use xavatar_render::Scene;

use crate::models::Models;
use crate::network::{Network, Workspace};
use crate::picture::{Square, directions, ray, taken};
use crate::rays::{Meeting, Ray, meeting};

/// Points of a hand: the wrist, then each finger from the palm to its tip.
pub const POINTS: usize = 21;
/// Number of the wrist.
pub const WRIST: usize = 0;
/// Number of the middle finger's knuckle.
pub const KNUCKLE: usize = 9;
/// Directions of which those are taken that see the hand from its sides.
const DIRECTIONS: usize = 40;
/// The largest cosine between the view and the fingers.
const ALONG: f64 = 0.75;
/// How far cameras are from the hand, metres.
const DISTANCE: f32 = 1.0;
/// The first and the second time: what is farther from the middle of the hand is cut away, and how large a picture is, metres.
pub const ROUNDS: [Round; 2] = [Round { around: 0.2, side: 0.30 }, Round { around: 0.15, side: 0.26 }];
/// Rows and columns of a picture.
pub const PIXELS: u32 = 224;
/// Pictures in which the network is less sure that there is a hand say nothing.
const HAND: f32 = 0.5;
/// Rays that pass farther from a joint see another place, metres.
pub const REACH: f64 = 0.025;
/// A hand that fewer of the pictures see is not there: hands that are have 0.36 and more, others none.
const SEEN: f64 = 0.2;

/// One look at a hand.
pub struct Round {
    around: f32,
    /// How much a picture shows, metres.
    pub side: f32,
}

/// Which hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The person's left one.
    Left,
    /// The person's right one.
    Right,
}

/// What one picture says.
struct Sight {
    rays: Vec<Ray>,
    is_right: bool,
}

/// Where a hand is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Whereabouts {
    /// About its middle, metres.
    pub middle: DVec3,
    /// Towards the fingers.
    pub outward: DVec3,
}

/// The points of a hand, by number; none if the scan has no hand there.
///
/// # Errors
/// Those of [`Scene::render`].
pub fn find(
    models: &Models,
    scan: &TriangleMesh,
    side: Side,
    first: Whereabouts,
) -> Result<Option<Vec<Option<Meeting>>>> {
    let mut whereabouts = first;
    let mut points = None;
    for round in &ROUNDS {
        let part = around(scan, whereabouts.middle, round.around);
        let cameras = cameras(whereabouts, round.side);
        let (own, other): (Vec<Sight>, Vec<Sight>) = (sights(&models.hand, &Scene::new(&part)?, &cameras)?.into_iter())
            .partition(|sight| sight.is_right == (side == Side::Right));
        let found = met(&own);
        let Some(next) = refined(&found) else { return Ok(None) };
        whereabouts = next;
        let is_seen = own.len() > other.len() && own.len() as f64 > SEEN * cameras.len() as f64;
        points = is_seen.then_some(found);
    }
    Ok(points)
}

fn met(sights: &[Sight]) -> Vec<Option<Meeting>> {
    let point = |point: usize| {
        let rays: Vec<Ray> = sights.iter().map(|sight| sight.rays[point]).collect();
        meeting(&rays, REACH)
    };
    (0..POINTS).into_par_iter().map(point).collect()
}

/// The middle of a hand's points and the way from the wrist to the knuckles.
fn refined(points: &[Option<Meeting>]) -> Option<Whereabouts> {
    let places: Vec<DVec3> = points.iter().flatten().map(|met| met.place).collect();
    let place = |point: usize| points[point].map(|met| met.place);
    let outward = (place(KNUCKLE)? - place(WRIST)?).try_normalize()?;
    Some(Whereabouts { middle: places.iter().sum::<DVec3>() / places.len() as f64, outward })
}

fn cameras(whereabouts: Whereabouts, side: f32) -> Vec<PinholeCamera> {
    let Whereabouts { middle, outward } = whereabouts;
    let camera = |direction: DVec3| {
        let square = Square {
            middle: middle.as_vec3(),
            towards_camera: direction.as_vec3(),
            up: outward.as_vec3(),
            distance: DISTANCE,
            side,
            pixels: PIXELS,
        };
        square.camera()
    };
    let across = directions(DIRECTIONS).into_iter().filter(|direction| direction.dot(outward).abs() < ALONG);
    across.map(camera).collect()
}

/// What of a scan is near a place.
fn around(scan: &TriangleMesh, middle: DVec3, radius: f32) -> TriangleMesh {
    let near = |vertex: &u32| scan.vertices[*vertex as usize].distance(middle.as_vec3()) < radius;
    TriangleMesh {
        vertices: scan.vertices.clone(),
        faces: scan.faces.iter().filter(|face| face.iter().all(near)).copied().collect(),
        normals: scan.normals.clone(),
        colouring: scan.colouring.clone(),
    }
}

/// A hand as the network sees it.
pub struct SeenHand {
    /// Its points in the picture, pixels.
    pub points: Vec<Vec2>,
    /// How sure it is that there is a hand.
    pub sure: f64,
    /// Which it is.
    pub side: Side,
}

/// What the network says of a picture; none if there is no hand.
pub fn seen(outputs: &[Vec<f32>]) -> Option<SeenHand> {
    let [points, hand, right] = outputs else { return None };
    let seen = || SeenHand {
        points: points.chunks_exact(3).map(|place| Vec2::new(place[0], place[1])).collect(),
        sure: f64::from(hand[0]),
        side: if right[0] > 0.5 { Side::Right } else { Side::Left },
    };
    (hand[0] >= HAND).then(seen)
}

fn sights(network: &Network, scene: &Scene<'_>, cameras: &[PinholeCamera]) -> Result<Vec<Sight>> {
    let sight = |workspace: &mut Workspace, camera: &PinholeCamera| -> Result<Option<Sight>> {
        let Some(seen) = seen(&network.run(&taken(scene, camera)?, workspace)) else { return Ok(None) };
        let rays = seen.points.iter().map(|at| ray(camera, *at, seen.sure));
        Ok(Some(Sight { rays: rays.collect(), is_right: seen.side == Side::Right }))
    };
    let sights = cameras.par_iter().map_init(Workspace::default, sight).collect::<Result<Vec<_>>>()?;
    Ok(sights.into_iter().flatten().collect())
}
