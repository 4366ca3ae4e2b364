//! A first guess from landmarks: the torso turned and moved onto hips, shoulders and neck (Kabsch 1976), arms hanging.

use glam::DVec3;

use crate::landmarks::{Seen, Site, Sites};
use crate::linear::{FramePose, Linkage, rotation_between};
use crate::terms::PosePrior;

/// How far arms hang down from the T-pose, radians.
const ARMS_DOWN: f64 = 1.0;
/// Joints whose distances no pose changes much.
const TORSO: [&str; 7] = ["pelvis", "left_hip", "right_hip", "neck", "left_shoulder", "right_shoulder", "spine3"];

/// A pose to start from, if enough was seen to say where the body is and which way it faces: of the torso, or else of all joints.
pub fn from_landmarks(linkage: &Linkage, sites: &Sites, prior: &PosePrior, seen: &[Seen]) -> Option<FramePose> {
    let of_joints = |only: &[&str]| -> Vec<(usize, DVec3, f64)> {
        let of_joint = |one: &Seen| {
            let site = sites.site(one.site);
            let Site::Joint(joint) = site.at else { return None };
            let is_wanted = one.confidence > 0.0 && (only.is_empty() || only.contains(&site.name.as_str()));
            is_wanted.then_some((joint, one.place, one.confidence * site.weight))
        };
        seen.iter().filter_map(of_joint).collect()
    };
    placed(linkage, sites, prior, &of_joints(&TORSO)).or_else(|| placed(linkage, sites, prior, &of_joints(&[])))
}

/// The body at rest but for its arms, turned and moved onto joints: number, place and weight of each.
fn placed(linkage: &Linkage, sites: &Sites, prior: &PosePrior, torso: &[(usize, DVec3, f64)]) -> Option<FramePose> {
    let total: f64 = torso.iter().map(|(_, _, weight)| weight).sum();
    let mean = |place: &dyn Fn(&(usize, DVec3, f64)) -> DVec3| {
        torso.iter().map(|one| place(one) * one.2).sum::<DVec3>() / total
    };
    let moved = torso.iter().map(|(joint, place, weight)| (linkage.rest()[*joint], *place, *weight));
    let turn = rotation_between(&moved.collect::<Vec<_>>())?;
    let arm = |name: &str, sign: f64| {
        sites
            .named(name)
            .map(|_| name)
            .and_then(|name| joint_of(sites, name))
            .map(|joint| (joint, DVec3::Z * sign * ARMS_DOWN))
    };
    let arms = [arm("left_shoulder", -1.0), arm("right_shoulder", 1.0)];
    let mut pose = FramePose::turned(linkage.extents(), prior.means().chain(arms.into_iter().flatten()));
    pose.rotations[0] = turn;
    let chain = linkage.posed(&pose, &vec![0.0; linkage.extents().shapes]);
    pose.translation = mean(&|one| one.1) - mean(&|one| chain.joint(one.0));
    pose.is_finite().then_some(pose)
}

fn joint_of(sites: &Sites, name: &str) -> Option<usize> {
    match sites.site(sites.named(name)?).at {
        Site::Joint(joint) => Some(joint),
        Site::Vertex(_) => None,
    }
}
