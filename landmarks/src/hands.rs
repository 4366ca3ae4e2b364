//! Joints and tips of the fingers, by MediaPipe's hand network (Zhang et al. 2020), from close around each hand.
//!
//! The hand is looked for beyond the wrist, the forearm pointing up in the picture, with all cut away that is farther from it. The network
//! also says whether there is a hand, and which: where most pictures see none, or the other, the scan has none here.

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
/// Directions of which those are taken that see the hand from the side of the forearm.
const DIRECTIONS: usize = 40;
/// The largest cosine between the view and the forearm.
const ALONG: f64 = 0.75;
/// From the wrist to the middle of the hand, metres.
const TO_MIDDLE: f64 = 0.09;
/// What is farther from the middle of the hand is cut away, metres.
const AROUND: f32 = 0.2;
/// How far cameras are from the hand, metres.
const DISTANCE: f32 = 1.0;
/// Side of a picture, metres.
const SIDE: f32 = 0.30;
/// Pictures in which the network is less sure that there is a hand say nothing.
const HAND: f32 = 0.5;
/// Rays that pass farther from a joint see another place, metres.
const REACH: f64 = 0.025;

/// Which hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The person's left one.
    Left,
    /// The person's right one.
    Right,
}

/// A hand as pictures see it.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    /// Share of the pictures that see a hand of this side.
    pub votes: f64,
    /// Its points.
    pub points: Vec<Option<Meeting>>,
}

/// What one picture says.
struct Sight {
    rays: Vec<Ray>,
}

/// Looks for a hand beyond a wrist, in the direction of the forearm.
///
/// # Errors
/// Those of [`Scene::render`].
pub fn find(models: &Models, scan: &TriangleMesh, side: Side, elbow: DVec3, wrist: DVec3) -> Result<Hand> {
    let forearm = (wrist - elbow).normalize_or(DVec3::NEG_Y);
    let middle = wrist + forearm * TO_MIDDLE;
    let part = around(scan, middle);
    let scene = Scene::new(&part)?;
    let cameras: Vec<PinholeCamera> = (directions(DIRECTIONS).into_iter())
        .filter(|direction| direction.dot(forearm).abs() < ALONG)
        .map(|direction| {
            let square = Square {
                middle: middle.as_vec3(),
                towards_camera: direction.as_vec3(),
                up: forearm.as_vec3(),
                distance: DISTANCE,
                side: SIDE,
                pixels: 224,
            };
            square.camera()
        })
        .collect();
    let sights = sights(&models.hand, &scene, side, &cameras)?;
    let points = (0..POINTS).into_par_iter().map(|point| {
        let rays: Vec<Ray> = sights.iter().map(|sight| sight.rays[point]).collect();
        meeting(&rays, REACH)
    });
    Ok(Hand { votes: sights.len() as f64 / cameras.len().max(1) as f64, points: points.collect() })
}

/// What of a scan is near a place.
fn around(scan: &TriangleMesh, middle: DVec3) -> TriangleMesh {
    let near = |vertex: &u32| scan.vertices[*vertex as usize].distance(middle.as_vec3()) < AROUND;
    TriangleMesh { faces: scan.faces.iter().filter(|face| face.iter().all(near)).copied().collect(), ..scan.clone() }
}

fn sights(network: &Network, scene: &Scene<'_>, side: Side, cameras: &[PinholeCamera]) -> Result<Vec<Sight>> {
    let sight = |workspace: &mut Workspace, camera: &PinholeCamera| -> Result<Option<Sight>> {
        let outputs = network.run(&taken(scene, camera)?, workspace);
        let [points, hand, right] = outputs.as_slice() else { return Ok(None) };
        let is_right = right[0] > 0.5;
        if hand[0] < HAND || is_right != (side == Side::Right) {
            return Ok(None);
        }
        let rays = points.chunks_exact(3).map(|place| ray(camera, Vec2::new(place[0], place[1]), f64::from(hand[0])));
        Ok(Some(Sight { rays: rays.collect() }))
    };
    let sights = cameras.par_iter().map_init(Workspace::default, sight).collect::<Result<Vec<_>>>()?;
    Ok(sights.into_iter().flatten().collect())
}
