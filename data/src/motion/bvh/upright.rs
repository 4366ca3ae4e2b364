//! Which axis of a skeleton's world is up.
//!
//! A rest pose that stands along Y or Z says so, and is believed whatever the body does then: a person lies prone for a whole clip.
//! Only one who stands on the floor along the other of the two axes in every frame, and does not lie on that along the first,
//! contradicts it. Where the rest pose does
//! not stand along either, the height at which the file places the root says it, or the frames; where these neither, it is the format's, Y, and
//! not certain.

use glam::DVec3;

use super::rest_pose::{RestPose, degrees};
use super::stance::Stance;
use crate::motion::UpAxis;

/// A body stands if the mean of its own up is this close to an axis, a cosine.
const STANDS: f64 = 0.8;
/// Heights of a pelvis over the floor, by the length of a leg.
const ON_THE_FLOOR: std::ops::RangeInclusive<f64> = 0.8..=1.4;
/// Heights of the pelvis of who lies, by the same.
const LYING: std::ops::RangeInclusive<f64> = 0.03..=0.5;
/// A body this far from the axis, degrees, leans too far for its feet to be level.
const LEANS: f64 = 35.0;

/// The axis, and how it is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WorldUp {
    pub(super) axis: UpAxis,
    pub(super) reason: &'static str,
    /// What the user should look at.
    pub(super) doubt: Option<&'static str>,
}

impl WorldUp {
    pub(super) fn of(rest: &RestPose, frames: &[Stance]) -> Self {
        let axis_of =
            |direction: DVec3| UpAxis::ALL.into_iter().find(|axis| direction.dot(axis.direction().as_dvec3()) > 0.9);
        let resting = axis_of(rest.up()).filter(|_| rest.stands());
        let usual = resting.filter(|axis| matches!(axis, UpAxis::Y | UpAxis::Z));
        let standing = stands_along(frames);
        let placed = [UpAxis::Y, UpAxis::Z].into_iter().find(|axis| is_on_floor(rest.alone(), *axis));
        let sure = |axis, reason| Self { axis, reason, doubt: None };
        if let (None, Some(placed)) = (usual, placed) {
            return sure(placed, "the skeleton is placed at a leg's height along it");
        }
        match (usual, standing) {
            (Some(resting), Some(standing))
                if matches!(standing, UpAxis::Y | UpAxis::Z)
                    && is_on_floor(frames, standing)
                    && !is_on_floor(frames, resting)
                    && !lies_on_floor(frames, resting) =>
            {
                sure(standing, "the body stands on the floor along it in every frame, though at rest it does not")
            }
            (Some(resting), _) => sure(resting, "the skeleton at rest stands along it"),
            (None, Some(UpAxis::Y)) => sure(UpAxis::Y, "the body stands along it"),
            (None, Some(standing)) => Self {
                axis: standing,
                reason: "the body stands along it",
                doubt: Some(
                    "which way is up shows only in the frames, where the body stands: if it lies, declare the axis that is up",
                ),
            },
            (None, None) => Self {
                axis: UpAxis::Y,
                reason: "the format's",
                doubt: Some(
                    "which way is up shows neither at rest nor in the frames; Y is taken: declare the axis if it is another",
                ),
            },
        }
    }

    /// The axis, or a body's own up where it leans away from it.
    pub(super) fn near(&self, up: DVec3) -> DVec3 {
        let axis = self.axis.direction().as_dvec3();
        if degrees(axis, up) < LEANS { axis } else { up }
    }
}

/// The axis along which the body stands, head up, for most of the frames.
fn stands_along(frames: &[Stance]) -> Option<UpAxis> {
    let up: DVec3 = frames.iter().filter_map(|stance| Some(stance.body()? * DVec3::Y)).sum();
    let mean = up / frames.len().max(1) as f64;
    UpAxis::ALL.into_iter().find(|axis| mean.dot(axis.direction().as_dvec3()) > STANDS)
}

/// Whether the pelvis is a leg's length over the origin along an axis, in every frame.
fn is_on_floor(frames: &[Stance], axis: UpAxis) -> bool {
    frames.iter().all(|stance| height(stance, axis).is_some_and(|height| ON_THE_FLOOR.contains(&height)))
}

/// Whether the pelvis is as high over the origin along an axis as that of who lies there, in every frame.
fn lies_on_floor(frames: &[Stance], axis: UpAxis) -> bool {
    frames.iter().all(|stance| height(stance, axis).is_some_and(|height| LYING.contains(&height)))
}

/// The height of the pelvis along an axis, by the length of a leg.
fn height(stance: &Stance, axis: UpAxis) -> Option<f64> {
    Some(stance.position(0)?.dot(axis.direction().as_dvec3()) / (0.5 * stance.leg_lengths()))
}
