//! Which bone is which joint: by the names that the common skeletons use and the tree that they stand in, or as the user says.
//!
//! Some words mean different joints in different skeletons, a shoulder that is above an arm, a foot that is below an ankle, a hip
//! that is above a thigh; the other bones tell which it is. The bones of the back are taken by their height. Where two bones of
//! one name stand below each other, or a helper stands in a joint's place, the lower one is the joint: it has the turns of both.

mod name;
mod table;
mod tree;

use std::collections::BTreeMap;

use xavatar_body::smplx::{self, joint};
use xavatar_formats::{Error, Result};

use super::skeleton::Joint;
use name::{Name, Phalanx};
use tree::Tree;
use xavatar_body::smplx::joint::sides::{HIPS, SHOULDERS};

/// The bone (an index into the file's joints) of each SMPL-X joint, if it has one.
pub(super) type Bones = Vec<Option<usize>>;

/// Finds the bones by their names and their places in the tree.
pub(super) fn recognised(joints: &[Joint]) -> Bones {
    let names = Name::all(joints.iter().map(|joint| joint.name.as_str()));
    let tree = Tree { joints };
    let meaning = Meaning::of(&names);
    let mut bones = vec![None; smplx::skeleton().joints.len()];
    for bone in 0..joints.len() {
        let Some(joint) = meaning.joint(&names[bone]).and_then(|joint| joint_index(&joint)) else { continue };
        let takes = bones[joint].is_none_or(|before: usize| {
            let (rank, rank_before) = (names[bone].rank(), names[before].rank());
            // A twist bone or a second head comes after the joint; a helper of the same name before it.
            rank < rank_before
                || (rank == rank_before && names[bone].word == names[before].word && tree.is_above(before, bone))
        });
        if takes {
            bones[joint] = Some(bone);
        }
    }
    find_trunk(&tree, &names, &mut bones);
    tree.carriers(&bones)
}

/// The pelvis, the back, the neck and the head, where the tree has to say.
fn find_trunk(tree: &Tree, names: &[Name], bones: &mut Bones) {
    let of = |joints: [usize; 2]| -> Vec<usize> { joints.iter().filter_map(|joint| bones[*joint]).collect() };
    let (hips, arms) = (of(HIPS), of(SHOULDERS));
    if arms.len() < 2 || (hips.len() < 2 && bones[joint::PELVIS].is_none()) {
        return;
    }
    let (common, chest) = (tree.common(&[hips, arms.clone()].concat()), tree.common(&arms));
    // Of several bones called so, the lowest that has the legs and the back below it.
    let is_pelvis = |bone: &usize| names[*bone].side.is_none() && table::middle(&names[*bone].word) == Some("pelvis");
    let named =
        (0..names.len()).rev().filter(is_pelvis).find(|bone| common.is_some_and(|common| tree.is_above(*bone, common)));
    bones[joint::PELVIS] = named.or(bones[joint::PELVIS]).or(common);
    let (Some(pelvis), Some(chest)) = (bones[joint::PELVIS], chest) else { return };
    let head = bones[joint::HEAD];
    if head.is_none() && bones[joint::NECK].is_none() {
        // Skeletons that number the bones from the pelvis to the head.
        let neck = tree.chain(chest, |bone| names[bone].side.is_none() && names[bone].word == names[chest].word);
        if let [first, .., last] = neck[..] {
            (bones[joint::NECK], bones[joint::HEAD]) = (Some(first), Some(last));
        }
    }
    if let (None, Some(head)) = (bones[joint::NECK], bones[joint::HEAD]) {
        bones[joint::NECK] = tree.path(chest, head).first().copied().filter(|neck| *neck != head);
    }
    let top = bones[joint::NECK].or(bones[joint::HEAD]);
    for (joint, bone) in tree.back(&tree.path(pelvis, chest), top) {
        bones[joint] = Some(bone);
    }
}

/// What words mean in one skeleton, where skeletons differ.
struct Meaning {
    shoulder_is_arm: bool,
    hip_is_helper: bool,
    leg_is_thigh: bool,
    foot_is_toe: bool,
    hand_is_below_wrist: bool,
    thumb_has_metacarpal: bool,
    /// What fingers are counted from: 0 or 1.
    first_phalanx: u64,
    /// Whether a numbered finger is followed by its phalanx as a number of its own (`finger2-1`, not `Finger11`).
    phalanx_is_apart: bool,
}

impl Meaning {
    fn of(names: &[Name]) -> Self {
        let says = |words: &[&str]| names.iter().any(|name| name.side.is_some() && words.contains(&name.word.as_str()));
        let mut fingers = names.iter().filter(|name| name.side.is_some() && table::finger(&name.word).is_some());
        let numbered = |name: &&Name| table::is_numbered_finger(&name.word);
        Self {
            shoulder_is_arm: !says(table::ARM),
            hip_is_helper: says(table::THIGH),
            leg_is_thigh: says(&["knee"]) && !says(table::THIGH) && !says(&["hip"]),
            foot_is_toe: says(&["ankle"]),
            hand_is_below_wrist: says(&["wrist"]),
            thumb_has_metacarpal: fingers
                .clone()
                .any(|name| table::finger(&name.word) == Some("thumb") && name.phalanx == Some(Phalanx::Metacarpal)),
            first_phalanx: u64::from(!fingers.any(|name| name.rank().first() == Some(&0))),
            phalanx_is_apart: names
                .iter()
                .filter(numbered)
                .any(|name| name.numbers.len() > 1 || name.phalanx.is_some()),
        }
    }

    /// The joint that a name means.
    fn joint(&self, name: &Name) -> Option<String> {
        let word = name.word.as_str();
        let Some(side) = name.side else { return table::middle(word).map(str::to_owned) };
        let joint = match word {
            "shoulder" if self.shoulder_is_arm => "shoulder",
            "hip" if self.hip_is_helper => return None,
            "leg" if self.leg_is_thigh => "hip",
            "foot" if self.foot_is_toe => "foot",
            "hand" if self.hand_is_below_wrist => return None,
            _ => match table::sided(word) {
                Some(joint) => joint,
                None => return self.finger(name).map(|(finger, phalanx)| format!("{side}_{finger}{phalanx}")),
            },
        };
        Some(format!("{side}_{joint}"))
    }

    /// The finger and its bone, 1 to 3 from the palm on.
    fn finger(&self, name: &Name) -> Option<(&'static str, u64)> {
        let number = |place: usize| name.numbers.get(place).and_then(|number| number.parse::<u64>().ok());
        let (finger, phalanx) = if let Some(finger) = table::finger(&name.word) {
            (finger, number(0).map(|number| number + 1 - self.first_phalanx))
        } else if table::is_numbered_finger(&name.word) && self.phalanx_is_apart {
            (table::finger_of(number(0)?.checked_sub(1)? as usize)?, number(1))
        } else if table::is_numbered_finger(&name.word) {
            // Finger1 is the index, Finger11 its second bone.
            let (finger, phalanx) = name.numbers.first()?.split_at_checked(1)?;
            let phalanx = if phalanx.is_empty() { 0 } else { phalanx.parse::<u64>().ok()? };
            (table::finger_of(finger.parse().ok()?)?, Some(phalanx.checked_add(1)?))
        } else {
            return None;
        };
        let is_whole_thumb = finger == "thumb" && self.thumb_has_metacarpal;
        let phalanx = match (name.phalanx, is_whole_thumb) {
            (Some(Phalanx::Metacarpal), false) => return None,
            (Some(Phalanx::Metacarpal), true) | (Some(Phalanx::Proximal), false) => 1,
            (Some(Phalanx::Proximal), true) | (Some(Phalanx::Middle), _) => 2,
            (Some(Phalanx::Distal), _) => 3,
            (None, _) => phalanx.unwrap_or(1),
        };
        Some((finger, phalanx))
    }
}

/// The bones of a map from the file's names to SMPL-X's.
///
/// # Errors
/// [`Error::Value`] for a bone that the file, or a joint that SMPL-X does not have.
pub(super) fn declared(joints: &[Joint], map: &BTreeMap<String, String>) -> Result<Bones> {
    let mut bones = vec![None; smplx::skeleton().joints.len()];
    for (bone, joint) in map {
        let names = || joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ");
        let index = joints.iter().position(|other| other.name == *bone).ok_or_else(|| Error::Value {
            name: "a bone of the map".into(),
            found: bone.clone(),
            expected: format!("one of the file's: {}", names()),
        })?;
        let joint = joint_index(joint).ok_or_else(|| Error::Value {
            name: format!("the joint of bone {bone}"),
            found: joint.clone(),
            expected: format!("one of SMPL-X: {}", smplx::skeleton().joints.join(", ")),
        })?;
        if bones[joint].replace(index).is_some() {
            return Err(Error::Value {
                name: "the map".into(),
                found: format!("two bones for {}", smplx::skeleton().joints[joint]),
                expected: "one a joint".into(),
            });
        }
    }
    Ok(Tree { joints }.carriers(&bones))
}

/// A map in TOML to start from, a line a bone: those that are known, and the others as comments.
pub(super) fn draft(joints: &[Joint], bones: &Bones) -> Vec<String> {
    let line = |(index, joint): (usize, &Joint)| {
        let known = bones.iter().position(|bone| *bone == Some(index));
        let (comment, known) = known.map_or(("# ", ""), |known| ("", smplx::skeleton().joints[known].as_str()));
        format!("{comment}{:?} = \"{known}\"", joint.name)
    };
    joints.iter().enumerate().map(line).collect()
}

fn joint_index(name: &str) -> Option<usize> {
    smplx::skeleton().joint(name)
}

#[cfg(test)]
mod tests;
