//! What a skeleton's rest pose is, and how SMPL-X's joints lie in it: is it a body standing, which way is it up, left and forward,
//! and is it a mirror image.
//!
//! A rest pose that is a body standing, in whatever pose of its arms, is believed. Of another one (every bone along its X, feet
//! along the shins, limbs turned about themselves, which knees that bend sideways show) the limbs are aligned in the frame in
//! which they lie most as in a T-pose, and turned about themselves as knees and elbows bend.

use glam::{DQuat, DVec3};
use xavatar_body::smplx::{self, joint};

use super::alignment::{Axes, Reference, Roll};
use super::hinges::HINGES;
use super::stance::Stance;
use super::upright::WorldUp;
use xavatar_body::smplx::joint::sides::{ANKLES, COLLARS, ELBOWS, HIPS, KNEES, SHOULDERS};

/// Degrees within which the parts of a body standing are of where the T-pose has them.
const UPRIGHT_BACK: f64 = 50.0;
const SQUARE_SHOULDERS: f64 = 40.0;
const HANGING_LEG: f64 = 50.0;
const FOLDED_LEG: f64 = 150.0;
const RAISED_ARM: f64 = 50.0;
const STRAIGHT_ELBOW: f64 = 70.0;
const LEVEL_COLLAR: f64 = 60.0;
/// A foot is level if its toes are no further aside, above or below; and its shin this upright, or the foot may lean with it.
const TOES_ASIDE: f64 = 60.0;
const TOES_UP: f64 = 15.0;
const TOES_DOWN: f64 = 60.0;
const UPRIGHT_SHIN: f64 = 5.0;
/// Of a frame in which feet are aligned, the legs are this straight at least.
const STANDING: f64 = 40.0;
/// Directions within this of an axis of the file are meant to be along it.
const ALONG_AXIS: f64 = 20.0;

/// The parts of a body that are aligned together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Trunk,
    Legs,
    LeftFoot,
    RightFoot,
    LeftArm,
    RightArm,
}

impl Part {
    pub(super) const ALL: [Self; 6] =
        [Self::Trunk, Self::Legs, Self::LeftFoot, Self::RightFoot, Self::LeftArm, Self::RightArm];

    pub(super) fn of(joint: usize) -> Self {
        match joint {
            joint::LEFT_HIP | joint::RIGHT_HIP | joint::LEFT_KNEE | joint::RIGHT_KNEE => Self::Legs,
            joint::LEFT_ANKLE | joint::LEFT_FOOT => Self::LeftFoot,
            joint::RIGHT_ANKLE | joint::RIGHT_FOOT => Self::RightFoot,
            joint::LEFT_COLLAR | joint::LEFT_SHOULDER | joint::LEFT_ELBOW | joint::LEFT_WRIST => Self::LeftArm,
            joint::RIGHT_COLLAR | joint::RIGHT_SHOULDER | joint::RIGHT_ELBOW | joint::RIGHT_WRIST => Self::RightArm,
            _ if joint::LEFT_HAND.contains(&joint) => Self::LeftArm,
            _ if joint::RIGHT_HAND.contains(&joint) => Self::RightArm,
            _ => Self::Trunk,
        }
    }
}

impl std::fmt::Display for Part {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Trunk => "the trunk",
            Self::Legs => "the legs",
            Self::LeftFoot => "the left foot",
            Self::RightFoot => "the right foot",
            Self::LeftArm => "the left arm",
            Self::RightArm => "the right arm",
        })
    }
}

/// A rest pose that was looked at.
pub(super) struct RestPose<'a> {
    stance: &'a Stance,
    /// G_0 where the trunk is believed: the turn to left, up, forward.
    axes: DQuat,
    /// Parts that are not as a body standing has them: which joint, and by how many degrees.
    wrong: Vec<(Part, usize, f64)>,
    /// Joints about which limbs are turned as no body's are, degrees.
    twisted: Vec<(usize, f64)>,
}

impl<'a> RestPose<'a> {
    /// Looks at the joints of a skeleton at rest; `None` if hips or shoulders are in one place.
    pub(super) fn new(stance: &'a Stance) -> Option<Self> {
        let (trunk, legs) = (stance.trunk()?, stance.legs().unwrap_or_default());
        // Legs spread or not, their middle goes on from the trunk; of who sits the trunk alone is upright.
        let whole = if trunk.dot(legs) < -0.5 { stance.top()? - stance.middle(ANKLES)? } else { trunk };
        let whole = whole.try_normalize()?;
        let axes = stance.axes(axis_along(whole).or_else(|| axis_along(trunk)).unwrap_or(whole))?;
        let mut rest = Self { stance, axes, wrong: Vec::new(), twisted: Vec::new() };
        rest.look();
        Some(rest)
    }

    /// The joints in it, as the only ones of a list.
    pub(super) fn alone(&self) -> &[Stance] {
        std::slice::from_ref(self.stance)
    }

    /// Which way is up in it.
    pub(super) fn up(&self) -> DVec3 {
        self.axes * DVec3::Y
    }

    pub(super) fn believes(&self, part: Part) -> bool {
        // One arm, an arm of a trunk or a foot of a leg that is elsewhere, may be right by chance.
        let with: &[Part] = match part {
            Part::Trunk | Part::Legs => &[],
            Part::LeftFoot | Part::RightFoot => &[Part::Legs],
            Part::LeftArm | Part::RightArm => &[Part::Trunk, Part::LeftArm, Part::RightArm],
        };
        let is_right = self.wrong.iter().all(|(wrong, ..)| *wrong != part && !with.contains(wrong));
        is_right && (self.twisted.is_empty() || part == Part::Trunk)
    }

    /// Whether all that is wrong with a foot is its shin.
    fn only_leans(&self, part: Part) -> bool {
        let foot = match part {
            Part::LeftFoot => joint::LEFT_ANKLE,
            Part::RightFoot => joint::RIGHT_ANKLE,
            _ => return false,
        };
        self.stands() && self.wrong.iter().all(|(wrong, joint, _)| *wrong != part || *joint != foot)
    }

    /// Whether trunk and legs are a body standing.
    pub(super) fn stands(&self) -> bool {
        self.believes(Part::Trunk) && self.believes(Part::Legs)
    }

    /// What is wrong with it, for people.
    pub(super) fn faults(&self) -> Option<String> {
        let listed = |faults: &mut dyn Iterator<Item = (usize, f64)>| {
            let mut worst = std::collections::BTreeMap::<usize, f64>::new();
            faults.for_each(|(joint, degrees)| {
                let before = worst.entry(joint).or_default();
                *before = before.max(degrees);
            });
            let faults = worst
                .iter()
                .map(|(joint, degrees)| format!("{} {degrees:.0} degrees", smplx::skeleton().joints[*joint]));
            faults.collect::<Vec<_>>().join(", ")
        };
        if !self.twisted.is_empty() {
            let twisted = listed(&mut self.twisted.iter().copied());
            return Some(format!("its limbs are turned about themselves (from how they bend: {twisted})"));
        }
        let wrong = listed(&mut self.wrong.iter().map(|(_, joint, degrees)| (*joint, *degrees)));
        (!wrong.is_empty()).then(|| format!("it is no body standing (off: {wrong})"))
    }

    /// Takes note of limbs that are turned about themselves as no body's are.
    pub(super) fn disbelieve(&mut self, twisted: Vec<(usize, f64)>) {
        self.twisted = twisted;
    }

    fn look(&mut self) {
        let stance = self.stance;
        let own = |direction: Option<DVec3>| direction.map(|direction| self.axes.inverse() * direction);
        let mut wrong = Vec::new();
        let mut check = |part, joint, off: f64, most: f64| {
            if off > most {
                wrong.push((part, joint, off));
            }
        };
        for joint in [joint::SPINE1, joint::SPINE2, joint::SPINE3, joint::NECK, joint::HEAD] {
            let bone = stance.above(joint).and_then(|above| stance.between(above, joint));
            let bone =
                own(bone.filter(|bone| bone.length() > 0.02 * stance.leg_lengths())).and_then(DVec3::try_normalize);
            check(Part::Trunk, joint, bone.map_or(0.0, |bone| degrees(bone, DVec3::Y)), UPRIGHT_BACK);
        }
        let across = own(stance.across_top());
        check(Part::Trunk, joint::SPINE3, across.map_or(0.0, |across| degrees(across, DVec3::X)), SQUARE_SHOULDERS);
        let mut folded = 180.0f64;
        for joint in [HIPS, KNEES].concat() {
            let leg = own(stance.direction(joint));
            let off = leg.map_or(180.0, |leg| degrees(leg, DVec3::NEG_Y));
            check(Part::Legs, joint, off, HANGING_LEG);
            folded = folded.min(off);
        }
        // Bones that lie along each other may all be turned about themselves: the back's too.
        check(Part::Trunk, joint::LEFT_HIP, folded, FOLDED_LEG);
        for ((part, ankle), knee) in [Part::LeftFoot, Part::RightFoot].into_iter().zip(ANKLES).zip(KNEES) {
            let (Some(foot), Some(shin)) = (own(stance.direction(ankle)), own(stance.direction(knee))) else {
                continue;
            };
            let aside = foot.x.abs().atan2(foot.z).to_degrees();
            let up = foot.y.asin().to_degrees();
            check(part, ankle, aside, TOES_ASIDE);
            check(part, ankle, up, TOES_UP);
            check(part, ankle, -up, TOES_DOWN);
            check(part, knee, degrees(shin, DVec3::NEG_Y), UPRIGHT_SHIN);
        }
        let arms = [(Part::LeftArm, DVec3::X), (Part::RightArm, DVec3::NEG_X)];
        for (place, (part, side)) in arms.into_iter().enumerate() {
            let (collar, shoulder, elbow) = (COLLARS[place], SHOULDERS[place], ELBOWS[place]);
            let collar_bone = own(stance.direction(collar));
            check(part, collar, collar_bone.map_or(0.0, |bone| degrees(bone, side)), LEVEL_COLLAR);
            let (upper, lower) = (own(stance.direction(shoulder)), own(stance.direction(elbow)));
            let Some(upper) = upper else { continue };
            check(part, shoulder, upper.y.asin().to_degrees(), RAISED_ARM);
            // Arms may hang, and point ahead a little.
            check(part, shoulder, degrees(upper, side), 90.0 + RAISED_ARM / 2.0);
            check(part, elbow, lower.map_or(0.0, |lower| degrees(lower, upper)), STRAIGHT_ELBOW);
        }
        self.wrong = wrong;
    }

    /// The axes of the joints in their bones, aligned in the rest pose where it is believed and in `frames` elsewhere; and
    /// the frames that served, by part.
    pub(super) fn aligned(
        &self,
        frames: &[Stance],
        own: &Stance,
        world_up: &WorldUp,
    ) -> Option<(Axes, Vec<(Part, usize)>)> {
        let mut served = Vec::new();
        let here = Reference { stance: self.stance, up: Some(self.up()), is_rest: true };
        let mut references = vec![here; smplx::skeleton().joints.len()];
        for part in Part::ALL.into_iter().filter(|part| !self.believes(*part)) {
            let off = |frame: &Stance| off_the_t_pose(frame, part);
            let best = (0..frames.len()).min_by(|one, other| off(&frames[*one]).total_cmp(&off(&frames[*other])))?;
            let stance = &frames[best];
            let stands = off(stance) < STANDING;
            if !stands && self.only_leans(part) {
                continue;
            }
            let up = stance.body().map(|body| world_up.near(body * DVec3::Y)).filter(|_| stands);
            served.push((part, best));
            for (_, reference) in references.iter_mut().enumerate().filter(|(joint, _)| Part::of(*joint) == part) {
                *reference = Reference { stance, up, is_rest: false };
            }
        }
        let root = match self.believes(Part::Trunk) {
            true => self.axes,
            false => references[0].stance.turn(0)?.inverse() * references[0].stance.body()?,
        };
        let mut roll: Roll = vec![0.0; references.len()];
        let straight = Axes::new(&references, root, &roll, own);
        for hinge in HINGES.iter().filter(|hinge| !self.believes(Part::of(hinge.upper))) {
            roll[hinge.upper] = hinge.roll(&straight, frames).unwrap_or(0.0);
        }
        Some((Axes::new(&references, root, &roll, own), served))
    }
}

/// How far a part of the body is from where the T-pose has it, degrees; of arms, from the T-pose and straight.
fn off_the_t_pose(stance: &Stance, part: Part) -> f64 {
    let Some(body) = stance.body() else { return f64::INFINITY };
    let off = |joint: usize, t_pose: DVec3| {
        stance.direction(joint).map_or(0.0, |direction| degrees(body.inverse() * direction, t_pose))
    };
    let bent = |joints: [usize; 2]| match joints.map(|joint| stance.direction(joint)) {
        [Some(upper), Some(lower)] => degrees(upper, lower),
        _ => 0.0,
    };
    let sum = match part {
        Part::Trunk => {
            let head = stance
                .between(joint::SPINE3, joint::HEAD)
                .or_else(|| stance.between(joint::SPINE3, joint::NECK))
                .and_then(DVec3::try_normalize);
            let (head, across) = (head.unwrap_or(body * DVec3::Y), stance.across_top().unwrap_or(body * DVec3::X));
            degrees(body.inverse() * head, DVec3::Y) + degrees(body.inverse() * across, DVec3::X)
        }
        Part::Legs => HIPS.into_iter().chain(KNEES).map(|joint| off(joint, DVec3::NEG_Y)).fold(0.0, f64::max),
        Part::LeftFoot => off(HIPS[0], DVec3::NEG_Y).max(off(KNEES[0], DVec3::NEG_Y)),
        Part::RightFoot => off(HIPS[1], DVec3::NEG_Y).max(off(KNEES[1], DVec3::NEG_Y)),
        Part::LeftArm => off(SHOULDERS[0], DVec3::X) + bent([SHOULDERS[0], ELBOWS[0]]),
        Part::RightArm => off(SHOULDERS[1], DVec3::NEG_X) + bent([SHOULDERS[1], ELBOWS[1]]),
    };
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// The axis of the file that a direction is close to.
fn axis_along(direction: DVec3) -> Option<DVec3> {
    let mut axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    axes.find(|axis| degrees(direction, *axis) < ALONG_AXIS)
}

/// Between two directions.
pub(super) fn degrees(one: DVec3, other: DVec3) -> f64 {
    one.angle_between(other).to_degrees()
}
