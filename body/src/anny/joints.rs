//! Which joint of SMPL-X each bone of MakeHuman's rig becomes, and where the joints are.
//!
//! A bone that has no joint of its own follows the nearest above it that has: metacarpals the wrist, toes the ball of the foot, the face's bones the head.

use glam::DVec3;

use super::rig::Rig;
use crate::imported::collapsed_weights;
use crate::smplx;

/// The joints of SMPL-X.
pub(super) const COUNT: usize = smplx::joint::COUNT;
/// Toes whose mean is the ball of the foot.
const BALL_OF_FOOT: [&str; 4] = ["toe1-1", "toe2-1", "toe3-1", "toe4-1"];
/// The sides, in the names of bones and of joints.
pub(super) const SIDES: [(&str, &str); 2] = [("L", "left"), ("R", "right")];
/// The fingers as joints and as bones are named.
const FINGERS: [(&str, usize); 5] = [("thumb", 1), ("index", 2), ("middle", 3), ("ring", 4), ("pinky", 5)];

/// Bones without a side, and the joints that they become; of several the first is where the joint is.
const MIDDLE: [(&str, &str); 14] = [
    ("spine05", "pelvis"),
    ("root", "pelvis"),
    ("pelvis.L", "pelvis"),
    ("pelvis.R", "pelvis"),
    ("spine04", "spine1"),
    ("spine03", "spine1"),
    ("spine02", "spine2"),
    ("spine01", "spine3"),
    ("breast.L", "spine3"),
    ("breast.R", "spine3"),
    ("neck01", "neck"),
    ("neck02", "neck"),
    ("neck03", "neck"),
    ("head", "head"),
];
/// Bones of each side.
const SIDED: [(&str, &str); 8] = [
    ("upperleg01", "hip"),
    ("lowerleg01", "knee"),
    ("foot", "ankle"),
    ("clavicle", "collar"),
    ("upperarm01", "shoulder"),
    ("lowerarm01", "elbow"),
    ("wrist", "wrist"),
    ("eye", "eye"),
];

/// Bones with a joint of their own, and the joints.
fn bones() -> impl Iterator<Item = (String, String)> {
    let middle = MIDDLE.into_iter().chain([("jaw", "jaw")]).map(|(bone, joint)| (bone.to_owned(), joint.to_owned()));
    let sided = SIDES.into_iter().flat_map(|(side, name)| {
        let bones = SIDED.into_iter().map(move |(bone, joint)| (format!("{bone}.{side}"), format!("{name}_{joint}")));
        let toes = (1..=5).map(move |toe| (format!("toe{toe}-1.{side}"), format!("{name}_foot")));
        let fingers = FINGERS.into_iter().flat_map(move |(finger, number)| {
            (1..=3).map(move |place| (format!("finger{number}-{place}.{side}"), format!("{name}_{finger}{place}")))
        });
        bones.chain(toes).chain(fingers)
    });
    middle.chain(sided)
}

/// Where the joints are (55), given where the bones begin.
pub(super) fn positions(rig: &Rig, heads: &[DVec3]) -> Vec<DVec3> {
    let skeleton = smplx::skeleton();
    let mut positions = vec![DVec3::ZERO; COUNT];
    let mut is_placed = [false; COUNT];
    for (bone, joint) in bones() {
        if let (Some(bone), Some(joint)) = (rig.bone(&bone), skeleton.joint(&joint))
            && !is_placed[joint]
        {
            (positions[joint], is_placed[joint]) = (heads[bone], true);
        }
    }
    for (side, name) in SIDES {
        let toes: Vec<DVec3> =
            BALL_OF_FOOT.iter().filter_map(|toe| Some(heads[rig.bone(&format!("{toe}.{side}"))?])).collect();
        if let Some(joint) = skeleton.joint(&format!("{name}_foot"))
            && !toes.is_empty()
        {
            positions[joint] = toes.iter().sum::<DVec3>() / toes.len() as f64;
        }
    }
    positions
}

/// The joints of a shaped mesh in the pose that it was made in, metres.
pub(super) fn in_source_pose(rig: &Rig, vertices: &[DVec3]) -> Vec<DVec3> {
    positions(rig, &rig.heads(vertices)).into_iter().map(|joint| joint * super::t_pose::METRES).collect()
}

/// The weights of the joints for the vertices that are used: (V) rows of 55.
pub(super) fn weights_of(rig: &Rig, used: &[usize]) -> Vec<Vec<f64>> {
    let skeleton = smplx::skeleton();
    let named: Vec<(String, String)> = bones().collect();
    let own = |bone: usize| {
        let found = named.iter().find(|(name, _)| *name == rig.bones[bone].name)?;
        skeleton.joint(&found.1)
    };
    let above = |bone: usize| std::iter::successors(Some(bone), |bone| rig.bones[*bone].parent);
    let joint_of: Vec<usize> = (0..rig.bones.len()).map(|bone| above(bone).find_map(own).unwrap_or_default()).collect();
    used.iter().map(|vertex| collapsed_weights(&rig.weights[*vertex], &joint_of)).collect()
}
