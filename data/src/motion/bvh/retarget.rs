//! Another skeleton's rotations, as SMPL-X's.
//!
//! With W_b(t) the rotation of bone b in the file's world, all helper bones above it composed, and G_j the axes of joint j in its bone
//! ([`alignment`](super::alignment)), H_j the same of SMPL-X's own skeleton at rest,
//!
//! F_j(t) = W_b(t) G_j H_j^-1,    theta_j = F_parent(j)^-1 F_j,
//!
//! so that a bone points where the file's does. Joints without a bone follow their parents. Bone lengths are the avatar's; the
//! path is scaled by the ratio of the legs, which settles the file's unit too. Double precision.

use glam::{DQuat, DVec3, Vec3};
use xavatar_body::smplx::{self, joint};
use xavatar_body::{Pose, PoseAxisAngle};
use xavatar_formats::Choice;

use super::alignment::{Axes, Manner, Reference};
use super::bones::Bones;
use super::handedness::Handedness;
use super::hinges::twists;
use super::rest_pose::{Part, RestPose, degrees};
use super::skeleton::Bvh;
use super::stance::Stance;
use super::upright::WorldUp;
use crate::motion::{RestPose as AvatarRest, UpAxis, Warning};
use xavatar_body::smplx::joint::sides::{HIPS, SHOULDERS};

/// Without these there is no person: pelvis, hips, knees, ankles, shoulders, elbows.
const REQUIRED: [usize; 11] = [
    joint::PELVIS,
    joint::LEFT_HIP,
    joint::RIGHT_HIP,
    joint::LEFT_KNEE,
    joint::RIGHT_KNEE,
    joint::LEFT_ANKLE,
    joint::RIGHT_ANKLE,
    joint::LEFT_SHOULDER,
    joint::RIGHT_SHOULDER,
    joint::LEFT_ELBOW,
    joint::RIGHT_ELBOW,
];
/// Above this, the report says that the rest poses differ, degrees.
const NOTABLE_TURN: f64 = 20.0;
/// Frames that are looked at to understand a rest pose.
const LOOKED_AT: usize = 240;

/// Why a skeleton cannot be turned onto SMPL-X's.
#[derive(Debug)]
pub(super) enum Unusable {
    /// Joints that have no bone.
    Missing(Vec<&'static str>),
    /// What is wrong with the body.
    NoBody(&'static str),
}

/// A file's skeleton, matched with SMPL-X's.
pub(super) struct Retargeting {
    bvh: Bvh,
    bones: Bones,
    axes: Axes,
    /// H_j.
    own: Axes,
    own_rest: Stance,
    up: WorldUp,
    /// Metres of the avatar per unit of the file.
    scale: f64,
    pelvis: DVec3,
    report: Vec<String>,
    doubts: Vec<Warning>,
}

impl Retargeting {
    /// Matches the skeletons.
    pub(super) fn new(bvh: Bvh, bones: Bones, rest: &AvatarRest) -> Result<Self, Unusable> {
        let missing: Vec<&str> = REQUIRED.into_iter().filter(|joint| bones[*joint].is_none()).map(name).collect();
        if !missing.is_empty() {
            return Err(Unusable::Missing(missing));
        }
        let (bvh, mirrored) = unmirrored(bvh, &bones)?;
        let (stance, frames) = stances(&bvh, &bones);
        let own_rest = Stance::at_rest(rest.joints().iter().map(|place| place.as_dvec3()));
        let at_own_rest = vec![Reference { stance: &own_rest, up: Some(DVec3::Y), is_rest: true }; bones.len()];
        let own = Axes::new(&at_own_rest, DQuat::IDENTITY, &vec![0.0; bones.len()], &own_rest);

        let without = "hips and shoulders apart from each other, as a body has";
        let mut at_rest = RestPose::new(&stance).ok_or(Unusable::NoBody(without))?;
        let up = WorldUp::of(&at_rest, &frames);
        let (mut axes, mut served) = at_rest.aligned(&frames, &own_rest, &up).ok_or(Unusable::NoBody(without))?;
        let twisted = twists(&axes, &frames);
        if !twisted.is_empty() {
            at_rest.disbelieve(twisted);
            (axes, served) = at_rest.aligned(&frames, &own_rest, &up).ok_or(Unusable::NoBody(without))?;
        }
        let mut doubts: Vec<Warning> = at_rest
            .faults()
            .map(|faults| {
                let parts = served.iter().map(|(part, frame)| format!("{part} in frame {}", 1 + frame * step(&bvh)));
                let parts: Vec<String> = parts.collect();
                let aligned = parts.join(", ");
                let words = "aligned where they are most as in a T-pose";
                Warning::plain(format!("the rest pose is not to be believed: {faults}; {words}: {aligned}"))
            })
            .into_iter()
            .collect();
        doubts.extend(mirrored.then(|| Warning::choosing(Choice::BoneMap, MIRRORED)));
        doubts.extend(up.doubt.map(|doubt| Warning::choosing(Choice::UpAxis, doubt)));
        let (file, avatar) = (stance.leg_lengths(), own_rest.leg_lengths());
        let scale = if file > 0.0 && avatar > 0.0 { avatar / file } else { 1.0 };
        let pelvis = rest.pelvis().as_dvec3();
        let mut retargeting = Self { bvh, bones, axes, own, own_rest, up, scale, pelvis, report: Vec::new(), doubts };
        retargeting.report = retargeting.describe(&at_rest, &stance);
        Ok(retargeting)
    }

    /// SMPL-X parameters of each frame, in the file's axes; at least one.
    pub(super) fn frames(&self) -> Vec<smplx::Parameters> {
        self.bvh.frames().map(|row| self.frame(row)).collect()
    }

    /// The axis of the file's world that is up, and how that is known.
    pub(super) fn up(&self) -> (UpAxis, &'static str) {
        (self.up.axis, self.up.reason)
    }

    /// What became of the bones, a line each.
    pub(super) fn report(&self) -> &[String] {
        &self.report
    }

    /// What the user should look at, a line each.
    pub(super) fn doubts(&self) -> &[Warning] {
        &self.doubts
    }

    fn frame(&self, row: &[f64]) -> smplx::Parameters {
        let world = self.bvh.posed(row);
        let parents = &smplx::skeleton().parents;
        let above = |facing: &[DQuat], joint: usize| parents[joint].map_or(DQuat::IDENTITY, |parent| facing[parent]);
        let mut facing = Vec::with_capacity(parents.len());
        for (joint, bone) in self.bones.iter().enumerate() {
            facing.push(match (bone, self.axes.in_bone(joint)) {
                (Some(bone), Some(axes)) => world[*bone].turn * axes * self.own.of(joint, &self.own_rest).inverse(),
                _ => above(&facing, joint),
            });
        }
        let turn = |joint: usize| {
            let turn = above(&facing, joint).inverse() * facing[joint];
            let turn = if turn.w < 0.0 { -turn } else { turn };
            PoseAxisAngle(turn.to_scaled_axis().as_vec3())
        };
        let translation =
            self.bones[0].map_or(Vec3::ZERO, |bone| (world[bone].position * self.scale - self.pelvis).as_vec3());
        let rotations = (0..parents.len()).map(turn).collect();
        smplx::Parameters::from(&Pose { rotations, translation, ..Pose::default() })
    }

    fn describe(&self, rest: &RestPose, stance: &Stance) -> Vec<String> {
        let joints = &self.bvh.joints;
        let mapped = self.bones.iter().enumerate().filter_map(|(joint, bone)| Some((joint, (*bone)?)));
        let pairs: Vec<String> =
            mapped.map(|(joint, bone)| format!("{} -> {}", joints[bone].name, name(joint))).collect();
        let ignored = (0..joints.len()).filter(|bone| !self.bones.contains(&Some(*bone)));
        let ignored: Vec<&str> = ignored.map(|bone| joints[bone].name.as_str()).collect();
        let unmapped: Vec<&str> =
            (0..self.bones.len()).filter(|joint| self.bones[*joint].is_none()).map(name).collect();
        let turn = |joint: &usize| {
            let Manner::Limb(t_pose) = Manner::of(*joint, &self.own_rest) else { return 0.0 };
            let body = self.axes.of(0, stance).inverse();
            stance.direction(*joint).map_or(0.0, |direction| degrees(body * direction, t_pose))
        };
        let turned: Vec<String> = [SHOULDERS, HIPS]
            .as_flattened()
            .iter()
            .filter(|joint| rest.believes(Part::of(**joint)) && turn(joint) > NOTABLE_TURN)
            .map(|joint| format!("{} {:.0} degrees", name(*joint), turn(joint)))
            .collect();
        let mut report = vec![format!("bones: {} of {} used: {}", pairs.len(), joints.len(), pairs.join(", "))];
        if !ignored.is_empty() {
            report.push(format!("bones left out (their turns go to the next bone below): {}", ignored.join(", ")));
        }
        if !unmapped.is_empty() {
            report.push(format!("joints without a bone, which follow their parents: {}", unmapped.join(", ")));
        }
        if !turned.is_empty() {
            report.push(format!("rest pose: not a T-pose, aligned: {}", turned.join(", ")));
        }
        report.push(format!("scale: 1 unit is {:.4} m, by the length of the legs", self.scale));
        report
    }
}

const MIRRORED: &str = "the skeleton is a mirror image: where its left and right bones are, its toes and knees point backward; \
     it is read as of a left-handed world, so that what is called left stays left";

/// A joint's name.
fn name(joint: usize) -> &'static str {
    &smplx::skeleton().joints[joint]
}

/// The skeleton with its world right-handed, and whether it was not.
fn unmirrored(mut bvh: Bvh, bones: &Bones) -> Result<(Bvh, bool), Unusable> {
    let (_, frames) = stances(&bvh, bones);
    match Handedness::of(&frames) {
        Handedness::Own => Ok((bvh, false)),
        Handedness::Contradictory => Err(Unusable::NoBody(
            "toes and knees that point the same way: from where its left and right bones are, the toes point backward, the knees forward",
        )),
        Handedness::Mirrored => {
            // Along any axis it is the same but for a turn of the world: the one along which the person stands first keeps it small.
            let across = frames.first().and_then(|stance| stance.between_two(HIPS)).unwrap_or(DVec3::X).abs();
            bvh.mirror(if across.x >= across.max_element() {
                0
            } else if across.y >= across.z {
                1
            } else {
                2
            });
            Ok((bvh, true))
        }
    }
}

/// Of how many frames one is looked at.
fn step(bvh: &Bvh) -> usize {
    bvh.frames().len().div_ceil(LOOKED_AT).max(1)
}

/// The joints at rest, and in frames evenly chosen.
fn stances(bvh: &Bvh, bones: &Bones) -> (Stance, Vec<Stance>) {
    let frames = bvh.frames().step_by(step(bvh)).map(|row| Stance::of(&bvh.posed(row), bones)).collect();
    (Stance::of(&bvh.at_rest(), bones), frames)
}
