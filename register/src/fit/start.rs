//! A first guess from landmarks: the torso turned and moved onto hips, shoulders and neck (Kabsch 1976), arms hanging; or a pose that is
//! given, turned and moved onto all of them.

use glam::{DMat3, DVec3};

use crate::landmarks::{Seen, Site, Sites};
use crate::linear::{FramePose, Linkage, rotation_between};
use crate::terms::PosePrior;

/// How far arms hang down from the T-pose, radians.
const ARMS_DOWN: f64 = 1.0;
/// Joints whose distances no pose changes much.
const TORSO: [&str; 7] = ["pelvis", "left_hip", "right_hip", "neck", "left_shoulder", "right_shoulder", "spine3"];

/// A pose to start from, if enough was seen to say where the body is and which way it faces: of the torso, or else of all joints.
pub fn from_landmarks(linkage: &Linkage, sites: &Sites, prior: &PosePrior, seen: &[Seen]) -> Option<FramePose> {
    let hanging = hanging(linkage, sites, prior);
    let onto = |joints: Vec<SeenJoint>| placed(linkage, hanging.clone(), linkage.rest(), &joints);
    onto(of_joints(sites, seen, &TORSO)).or_else(|| onto(of_joints(sites, seen, &[])))
}

/// A pose that is given, turned and moved onto the joints that were seen, if they are enough.
pub fn onto_landmarks(linkage: &Linkage, sites: &Sites, given: &FramePose, seen: &[Seen]) -> Option<FramePose> {
    let mut upright = given.clone();
    upright.rotations[0] = DMat3::IDENTITY;
    upright.translation = DVec3::ZERO;
    let chain = linkage.posed(&upright, &vec![0.0; linkage.extents().shapes]);
    let places: Vec<DVec3> = (0..linkage.extents().joints).map(|joint| chain.joint(joint)).collect();
    placed(linkage, upright, &places, &of_joints(sites, seen, &[]))
}

/// A joint's number, where it was seen, and how much that counts.
type SeenJoint = (usize, DVec3, f64);

/// The joints among landmarks, of these names or of all.
fn of_joints(sites: &Sites, seen: &[Seen], only: &[&str]) -> Vec<SeenJoint> {
    let of_joint = |one: &Seen| {
        let site = sites.site(one.site);
        let Site::Joint(joint) = site.at else { return None };
        let is_wanted = one.confidence > 0.0 && (only.is_empty() || only.contains(&site.name.as_str()));
        is_wanted.then_some((joint, one.place, one.confidence * site.weight))
    };
    seen.iter().filter_map(of_joint).collect()
}

/// The body at rest but for its arms and fingers.
fn hanging(linkage: &Linkage, sites: &Sites, prior: &PosePrior) -> FramePose {
    let arm = |name: &str, sign: f64| {
        sites
            .named(name)
            .map(|_| name)
            .and_then(|name| joint_of(sites, name))
            .map(|joint| (joint, DVec3::Z * sign * ARMS_DOWN))
    };
    let arms = [arm("left_shoulder", -1.0), arm("right_shoulder", 1.0)];
    FramePose::turned(linkage.extents(), prior.means().chain(arms.into_iter().flatten()))
}

/// A pose turned and moved as a whole, so that joints that are at `from` (J) before lie where they were seen.
fn placed(linkage: &Linkage, mut pose: FramePose, from: &[DVec3], seen: &[SeenJoint]) -> Option<FramePose> {
    let total: f64 = seen.iter().map(|(_, _, weight)| weight).sum();
    let mean = |place: &dyn Fn(&SeenJoint) -> DVec3| seen.iter().map(|one| place(one) * one.2).sum::<DVec3>() / total;
    let moved = seen.iter().map(|(joint, place, weight)| (from[*joint], *place, *weight));
    pose.rotations[0] = rotation_between(&moved.collect::<Vec<_>>())?;
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
