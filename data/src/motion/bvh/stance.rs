//! SMPL-X's joints where another skeleton has them, at rest or in a frame: which way its bones point, and the body as a whole.
//!
//! The body's axes are left, up and forward, of hips and collar bones alone: they need no bone's own axes.

use glam::{DMat3, DQuat, DVec3};
use xavatar_body::smplx;

use super::bones::Bones;
use super::skeleton::Place;

/// Where the bone of a joint ends, for bones that have a direction: legs, feet, collar bones, arms, fingers.
#[rustfmt::skip]
const ENDS: [(usize, usize); 32] = [
    (1, 4), (2, 5), (4, 7), (5, 8), (7, 10), (8, 11),
    (13, 16), (14, 17), (16, 18), (17, 19), (18, 20), (19, 21),
    (25, 26), (26, 27), (28, 29), (29, 30), (31, 32), (32, 33), (34, 35), (35, 36), (37, 38), (38, 39),
    (40, 41), (41, 42), (43, 44), (44, 45), (46, 47), (47, 48), (49, 50), (50, 51), (52, 53), (53, 54),
];

/// Joints closer than this, by the length of both legs, have no direction between them.
const APART: f64 = 0.02;

/// The joints of a body, as far as a skeleton has them.
pub(super) struct Stance {
    places: Vec<Option<Place>>,
}

impl Stance {
    /// The joints' bones among those of a skeleton.
    pub(super) fn of(world: &[Place], bones: &Bones) -> Self {
        Self { places: bones.iter().map(|bone| bone.map(|bone| world[bone])).collect() }
    }

    /// SMPL-X's own skeleton, nothing turned.
    pub(super) fn at_rest(joints: impl Iterator<Item = DVec3>) -> Self {
        Self { places: joints.map(|position| Some(Place { turn: DQuat::IDENTITY, position })).collect() }
    }

    pub(super) fn position(&self, joint: usize) -> Option<DVec3> {
        self.places[joint].map(|place| place.position)
    }

    pub(super) fn turn(&self, joint: usize) -> Option<DQuat> {
        self.places[joint].map(|place| place.turn)
    }

    /// From one joint to another.
    pub(super) fn between(&self, from: usize, to: usize) -> Option<DVec3> {
        Some(self.position(to)? - self.position(from)?)
    }

    /// The direction of a joint's bone, if it has one.
    pub(super) fn direction(&self, joint: usize) -> Option<DVec3> {
        let end = ENDS.iter().find(|(start, _)| *start == joint).map(|(_, end)| *end)?;
        self.between(joint, end)?.try_normalize()
    }

    /// Half-way between two joints.
    pub(super) fn middle(&self, joints: [usize; 2]) -> Option<DVec3> {
        Some((self.position(joints[0])? + self.position(joints[1])?) * 0.5)
    }

    /// Where the trunk ends: half-way between the collar bones, or the shoulders of a skeleton without.
    pub(super) fn top(&self) -> Option<DVec3> {
        self.middle([13, 14]).or_else(|| self.middle([16, 17]))
    }

    /// The way up the trunk, from the hips.
    pub(super) fn trunk(&self) -> Option<DVec3> {
        (self.top()? - self.middle([1, 2])?).try_normalize()
    }

    /// The way from right to left at the top of the trunk, where collar bones or else shoulders are apart.
    pub(super) fn across_top(&self) -> Option<DVec3> {
        let is_apart = |across: &DVec3| across.length() > APART * self.leg_lengths();
        let across = self.between(14, 13).filter(is_apart).or_else(|| self.between(17, 16).filter(is_apart))?;
        across.try_normalize()
    }

    /// The way down the legs, from the hips to the ankles.
    pub(super) fn legs(&self) -> Option<DVec3> {
        (self.middle([7, 8])? - self.middle([1, 2])?).try_normalize()
    }

    /// The turn to the axes left (of the hips), up and forward from x, y and z.
    pub(super) fn axes(&self, up: DVec3) -> Option<DQuat> {
        let across = self.between(2, 1)?;
        let left = (across - up * across.dot(up)).try_normalize()?;
        Some(DQuat::from_mat3(&DMat3::from_cols(left, up, left.cross(up))))
    }

    /// The body's axes, upright along the trunk.
    pub(super) fn body(&self) -> Option<DQuat> {
        self.axes(self.trunk()?)
    }

    /// The length of both legs together.
    pub(super) fn leg_lengths(&self) -> f64 {
        [(1, 4), (4, 7), (2, 5), (5, 8)]
            .into_iter()
            .filter_map(|(from, to)| self.between(from, to))
            .map(DVec3::length)
            .sum()
    }

    /// The nearest joint above that has a place.
    pub(super) fn above(&self, joint: usize) -> Option<usize> {
        let parents = &smplx::skeleton().parents;
        std::iter::successors(parents[joint], |above| parents[*above]).find(|above| self.places[*above].is_some())
    }
}
