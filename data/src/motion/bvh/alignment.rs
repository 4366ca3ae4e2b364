//! The axes of SMPL-X's joints in the bones of another skeleton: G_j, with which a bone turned by W_b has its joint turned by W_b G_j.
//!
//! Each joint is aligned in a reference stance of its own: the rest pose, where that is a body standing, else a frame in which
//! the limb lies as standing people's do. There, with N the axes of the joint above, a limb's bone is turned by the smallest turn that
//! makes it point as the skeleton's; a foot is level and points where its toes are; collar bones, back, neck, head and hands are as
//! what they hang on. What the smallest turn leaves open, the turn of a limb about itself, may be given: [`Roll`].

use glam::{DQuat, DVec3};
use xavatar_body::smplx::{self, joint};

use super::stance::Stance;

/// A bone that points against the direction it has in the T-pose is turned about no particular axis.
const OPPOSITE: f64 = -0.985;
/// A neck this close to the trunk's direction is straight, degrees: no person's is.
const STRAIGHT: f64 = 3.0;
/// A foot's toes are ahead if they are this far, as a share of its length, off the way down.
const AHEAD: f64 = 0.5;

/// In which stance a joint is aligned.
#[derive(Clone, Copy)]
pub(super) struct Reference<'a> {
    pub(super) stance: &'a Stance,
    /// Which way is up there, if feet are level.
    pub(super) up: Option<DVec3>,
    /// Whether it is the rest pose.
    pub(super) is_rest: bool,
}

/// Turns of upper limbs about their own direction, radians, by joint.
pub(super) type Roll = Vec<f64>;

/// How a joint is aligned.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Manner {
    /// Points as the skeleton's bone does, from this direction in the T-pose.
    Limb(DVec3),
    /// Level, its toes where the skeleton's are.
    Foot,
    /// As what it hangs on.
    Follower,
}

impl Manner {
    /// Of each joint; thumbs point as the avatar's at rest, `own`.
    pub(super) fn of(joint: usize, own: &Stance) -> Self {
        let is_thumb = joint::LEFT_THUMB.chain(joint::RIGHT_THUMB).any(|thumb| thumb == joint);
        match joint {
            joint::LEFT_HIP | joint::RIGHT_HIP | joint::LEFT_KNEE | joint::RIGHT_KNEE => Self::Limb(DVec3::NEG_Y),
            joint::LEFT_ANKLE | joint::RIGHT_ANKLE => Self::Foot,
            joint::LEFT_SHOULDER | joint::LEFT_ELBOW => Self::Limb(DVec3::X),
            joint::RIGHT_SHOULDER | joint::RIGHT_ELBOW => Self::Limb(DVec3::NEG_X),
            _ if is_thumb => own.direction(joint).map_or(Self::Follower, Self::Limb),
            _ if joint::LEFT_HAND.contains(&joint) => Self::Limb(DVec3::X),
            _ if joint::RIGHT_HAND.contains(&joint) => Self::Limb(DVec3::NEG_X),
            _ => Self::Follower,
        }
    }
}

/// G_j of each joint that has a bone.
#[derive(Clone)]
pub(super) struct Axes {
    in_bone: Vec<Option<DQuat>>,
}

impl Axes {
    /// Aligns the joints, each in its reference; `root` is G_0.
    pub(super) fn new(references: &[Reference], root: DQuat, roll: &Roll, own: &Stance) -> Self {
        let mut axes = Self { in_bone: vec![None; references.len()] };
        axes.in_bone[0] = Some(root);
        for (joint, parent) in smplx::skeleton().parents.iter().enumerate() {
            let Some(parent) = *parent else { continue };
            let Reference { stance, up, is_rest } = references[joint];
            let Some(turn) = stance.turn(joint) else { continue };
            let above = axes.of(parent, stance);
            let aligned = match (Manner::of(joint, own), stance.direction(joint)) {
                (Manner::Limb(t_pose), Some(direction)) => {
                    let smallest = smallest_turn(above * t_pose, direction, above * DVec3::Z) * above;
                    DQuat::from_axis_angle(direction, roll[joint]) * smallest
                }
                (Manner::Foot, Some(direction)) => foot(above, up, direction, own.direction(joint)),
                // Where arms lie along their bones, so may the neck.
                _ if joint == joint::NECK && is_rest && !references[joint::LEFT_SHOULDER].is_rest => {
                    neck(above, stance, own)
                }
                _ if joint == joint::HEAD && is_rest => axes.of(joint::SPINE3, stance),
                _ => above,
            };
            axes.in_bone[joint] = Some(turn.inverse() * aligned);
        }
        axes
    }

    /// The axes of a joint in a stance: W_b G_j, or those of the next joint above that has a bone.
    pub(super) fn of(&self, joint: usize, stance: &Stance) -> DQuat {
        let mut joint = joint;
        loop {
            if let (Some(turn), Some(axes)) = (stance.turn(joint), self.in_bone[joint]) {
                return (turn * axes).normalize();
            }
            let Some(parent) = smplx::skeleton().parents[joint] else { return DQuat::IDENTITY };
            joint = parent;
        }
    }

    /// G_j.
    pub(super) fn in_bone(&self, joint: usize) -> Option<DQuat> {
        self.in_bone[joint]
    }
}

/// The axes of a neck in a rest pose whose bones lie along each other: tilted as the avatar's if it is straight.
fn neck(trunk: DQuat, stance: &Stance, own: &Stance) -> DQuat {
    let to_head = |stance: &Stance| stance.between(joint::NECK, joint::HEAD).and_then(DVec3::try_normalize);
    match (to_head(stance), to_head(own)) {
        (Some(direction), Some(own)) if direction.angle_between(trunk * DVec3::Y).to_degrees() < STRAIGHT => {
            smallest_turn(trunk * own, direction, trunk * DVec3::X) * trunk
        }
        _ => trunk,
    }
}

/// The smallest turn of one direction to another; about `axis`, where they are opposite and any would do.
fn smallest_turn(from: DVec3, to: DVec3, axis: DVec3) -> DQuat {
    if from.dot(to) < OPPOSITE {
        let square = (axis - from * axis.dot(from)).normalize_or(from.any_orthonormal_vector());
        let half = DQuat::from_axis_angle(square, std::f64::consts::PI);
        return DQuat::from_rotation_arc(half * from, to) * half;
    }
    DQuat::from_rotation_arc(from, to)
}

/// A foot's axes: level, its toes where `direction` has them, be they as high as the ankle or low; where the foot is not level,
/// as the shin's, turned so that the avatar's foot, which points along `own` when level, points along `direction`.
fn foot(shin: DQuat, up: Option<DVec3>, direction: DVec3, own: Option<DVec3>) -> DQuat {
    let ahead = up.map(|up| (up, direction - up * direction.dot(up))).filter(|(_, ahead)| ahead.length() > AHEAD);
    if let Some((up, ahead)) = ahead {
        let level = DQuat::from_rotation_arc(shin * DVec3::Y, up) * shin;
        return DQuat::from_rotation_arc(level * DVec3::Z, ahead.normalize()) * level;
    }
    let own = own.map_or(DVec3::Z, |own| DVec3::new(0.0, own.y, own.x.hypot(own.z)));
    smallest_turn(shin * own, direction, shin * DVec3::X) * shin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_directions_are_turned_about_the_axis_given() {
        for (to, axis) in [(DVec3::Y, DVec3::Z), (DVec3::new(0.05, 1.0, -0.02).normalize(), DVec3::Z)] {
            let turn = smallest_turn(DVec3::NEG_Y, to, axis);
            assert!((turn * DVec3::NEG_Y).distance(to) < 1e-12);
            assert!((turn * DVec3::Z).distance(DVec3::Z) < 0.1);
        }
    }

    #[test]
    fn feet_are_level_and_point_where_their_toes_are() {
        let shin = DQuat::from_rotation_x(0.2);
        for pitch in [-0.9, -0.4, 0.0, 0.6] {
            let direction = DQuat::from_rotation_y(0.3) * DQuat::from_rotation_x(-pitch) * DVec3::Z;
            let found = foot(shin, Some(DVec3::Y), direction, None);
            assert!(found.angle_between(DQuat::from_rotation_y(0.3)) < 1e-6, "{pitch}");
        }
        let own = DVec3::new(0.3, -0.4, 0.6).normalize();
        let found = foot(shin, None, DVec3::NEG_Y, Some(own));
        assert!((found * DVec3::new(0.0, own.y, own.x.hypot(own.z))).distance(DVec3::NEG_Y) < 1e-9);
    }
}
