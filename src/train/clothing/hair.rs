//! Whether hair hangs down the back: a plait or a ponytail goes with the head, though the back is what is nearest.
//!
//! Points of the scans far from the body are taken back by the head's bone transform, and by that of the bone below the neck. What is
//! found at the same place in most frames goes with that bone.

use glam::{Affine3A, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::affine;
use crate::body::Skeleton;
use crate::train::frames::Frames;
use crate::{Error, InputError, Result};

/// Most frames that are compared, evenly chosen.
const MOST_FRAMES: usize = 10;
/// Fewest frames that tell what goes with the head.
const FEWEST_FRAMES: usize = 4;
/// Most points of a scan that are looked at.
const MOST_POINTS: usize = 6000;
/// Farther from the body than this, a point is not skin, metres.
const OFF_BODY: f32 = 0.03;
/// Where another frame has a point this near, it is the same place, metres.
const SAME_PLACE: f32 = 0.015;
/// Share of the other frames that have a place, and by how much more of them under the head than under the back.
const SHARED: f32 = 0.6;
const ADVANTAGE: f32 = 0.25;
/// Share of a scan's points that hang, from which it is hair.
const HAIR: f32 = 0.002;

/// Whether scans of several frames show hair that hangs behind the back, of a body whose canonical `joints` (J) are here, metres.
///
/// # Errors
/// A frame that cannot be read or prepared.
pub fn hair_hangs(frames: &mut Frames, skeleton: &Skeleton, joints: &[Vec3]) -> Result<bool> {
    let (Some(head), Some(neck)) = (skeleton.joint("head"), skeleton.joint("neck")) else { return Ok(false) };
    let Some(back) = skeleton.parents[neck] else { return Ok(false) };
    let count = frames.len().min(MOST_FRAMES);
    if count < FEWEST_FRAMES {
        return Ok(false);
    }
    let (mut views, mut looked_at) = (Vec::with_capacity(count), 0);
    for number in 0..count {
        let frame = frames.prepared(number * frames.len() / count)?;
        let Some(scan) = frame.supervision.scan() else { return Ok(false) };
        let every = scan.mesh.vertices.len().div_ceil(MOST_POINTS);
        let points: Vec<Vec3> = scan.mesh.vertices.iter().copied().step_by(every).collect();
        looked_at += points.len();
        let inverse = |joint: usize| {
            let (linear, translation) = affine(&frame.pose.bones[joint]);
            Affine3A::from_mat3_translation(linear, translation).inverse()
        };
        let (by_head, by_back) = (inverse(head), inverse(back));
        let is_off = |point: &Vec3| {
            scan.body.surface().closest_within(*point, OFF_BODY).is_none() && !scan.body.is_inside(*point)
        };
        let places = points
            .into_par_iter()
            .filter(is_off)
            .map(|point| [by_head, by_back].map(|transform| transform.transform_point3(point)));
        views.push(View::new(places.collect())?);
    }
    let hangs = |place: &Vec3| place.y < joints[head].y && place.z < joints[head].z;
    let found: usize = (0..count).map(|view| View::hanging(&views, view, &hangs)).sum();
    Ok(found as f32 >= HAIR * looked_at as f32)
}

/// What is off the body in one frame: under the head and under the back.
struct View {
    places: Vec<[Vec3; 2]>,
    trees: Option<[ImmutableKdTree<f32, 3>; 2]>,
}

impl View {
    fn new(places: Vec<[Vec3; 2]>) -> Result<Self> {
        let tree = |bone: usize| {
            let rows: Vec<[f32; 3]> = places.iter().map(|place| place[bone].to_array()).collect();
            ImmutableKdTree::new_from_slice(&rows).map_err(|failure| {
                Error::from(InputError::Value {
                    name: "points off the body".into(),
                    found: format!("{} ({failure})", rows.len()),
                    expected: "at most 2^32".into(),
                })
            })
        };
        let trees = if places.is_empty() { None } else { Some([tree(0)?, tree(1)?]) };
        Ok(Self { places, trees })
    }

    /// Whether something is at this place under a bone.
    fn has(&self, bone: usize, place: Vec3) -> bool {
        self.trees.as_ref().is_some_and(|trees| {
            let nearest = trees[bone].query(&place.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
            nearest.distance < SAME_PLACE * SAME_PLACE
        })
    }

    /// How many places of one of the views hang and go with the head.
    fn hanging(views: &[Self], own: usize, hangs: &(impl Fn(&Vec3) -> bool + Sync)) -> usize {
        let others = || views.iter().enumerate().filter(|(view, _)| *view != own).map(|(_, view)| view);
        let share = |bone: usize, place: Vec3| {
            others().filter(|view| view.has(bone, place)).count() as f32 / (views.len() - 1) as f32
        };
        let goes_with_head = |place: &&[Vec3; 2]| {
            let under_head = share(0, place[0]);
            hangs(&place[0]) && under_head >= SHARED && under_head >= share(1, place[1]) + ADVANTAGE
        };
        views[own].places.par_iter().filter(goes_with_head).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Views of points that keep their places under one of the bones and move by this much between frames under the other.
    fn views(keeps: usize, step: f32) -> Vec<View> {
        let view = |frame: usize| {
            let place = |index: usize| {
                let place = Vec3::new(0.0, 0.01 * index as f32 - 0.3, -0.1);
                let mut both = [place; 2];
                both[1 - keeps] += Vec3::X * step * frame as f32;
                both
            };
            View::new((0..20).map(place).collect()).unwrap()
        };
        (0..6).map(view).collect()
    }

    fn hanging(views: &[View]) -> usize {
        (0..views.len()).map(|own| View::hanging(views, own, &|place| place.y < -0.205)).sum()
    }

    #[test]
    fn what_keeps_its_place_under_the_head_alone_is_hair() {
        assert_eq!(hanging(&views(0, 0.02)), 6 * 10, "the half that hangs");
        assert_eq!(hanging(&views(1, 0.02)), 0, "a coat goes with the back");
        assert_eq!(hanging(&views(0, 0.0)), 0, "a head that does not move tells nothing");
        assert_eq!(hanging(&[View::new(Vec::new()).unwrap(), View::new(Vec::new()).unwrap()]), 0);
    }
}
