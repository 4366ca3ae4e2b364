//! Which bone is which joint: by the names that the common skeletons use, or as the user says.
//!
//! A name is split where its case or its punctuation changes, and its side taken off: `mixamorig:LeftUpLeg`, `lThigh`,
//! `Bip01 L Thigh` and `left_hip` are all the left hip. Two words mean different joints in different skeletons, a shoulder that
//! is above an arm, and a foot that is below an ankle; the other bones tell which it is. The bones of the back are taken in order.

use std::collections::BTreeMap;

use super::parse::Joint;
use xavatar_body::smplx;
use xavatar_formats::{Error, Result};

/// The words for joints that have a side, by the joint's name without it.
const SIDED: [(&str, &[&str]); 13] = [
    ("hip", &["hip", "upleg", "thigh", "upperleg", "legupper"]),
    ("knee", &["knee", "leg", "lowleg", "lowerleg", "leglower", "shin", "calf"]),
    ("ankle", &["ankle", "foot"]),
    ("foot", &["toe", "toebase", "toes", "ball"]),
    ("collar", &["collar", "clavicle", "shoulder"]),
    ("shoulder", &["arm", "uparm", "upperarm", "armupper", "shldr"]),
    ("elbow", &["elbow", "forearm", "lowarm", "lowerarm", "armlower"]),
    ("wrist", &["wrist", "hand"]),
    ("index", &["index", "handindex", "indexfinger", "findex"]),
    ("middle", &["middle", "mid", "handmiddle", "middlefinger", "fmiddle"]),
    ("pinky", &["pinky", "little", "handpinky", "pinkyfinger", "littlefinger", "fpinky"]),
    ("ring", &["ring", "handring", "ringfinger", "fring"]),
    ("thumb", &["thumb", "handthumb", "fthumb"]),
];
/// Those in the middle.
const MIDDLE: [(&str, &[&str]); 4] =
    [("pelvis", &["hips", "hip", "pelvis"]), ("neck", &["neck"]), ("head", &["head"]), ("jaw", &["jaw"])];
/// Bones of the back, from the pelvis up.
const BACK: [&str; 8] = ["lowerback", "spine", "chest", "upperchest", "abdomen", "torso", "back", "waist"];

/// The bone (an index into the file's joints) of each SMPL-X joint, if it has one.
pub(super) type Bones = Vec<Option<usize>>;

/// Finds the bones by their names.
pub(super) fn recognised(joints: &[Joint]) -> Bones {
    let names: Vec<Name> = joints.iter().map(|joint| Name::of(&joint.name)).collect();
    let says = |words: &[&str]| names.iter().any(|name| name.side.is_some() && words.contains(&name.word.as_str()));
    let shoulder_is_arm = !says(&["arm", "uparm", "upperarm", "armupper", "shldr"]);
    let foot_is_toe = says(&["ankle"]);
    let mut bones = vec![None; smplx::skeleton().joints.len()];
    let mut back = Vec::new();
    for (bone, name) in names.iter().enumerate() {
        let word = name.word.as_str();
        let joint = match (&name.side, word) {
            (Some(side), "shoulder") if shoulder_is_arm => Some(format!("{side}_shoulder")),
            (Some(side), "foot") if foot_is_toe => Some(format!("{side}_foot")),
            (Some(side), "eye" | "eyeball") => Some(format!("{side}_eye")),
            (Some(side), _) => known(&SIDED, word).and_then(|joint| name.numbered(side, joint)),
            (None, _) if BACK.contains(&word) => {
                back.push(bone);
                None
            }
            (None, _) if name.number.is_none_or(|number| number == 0) => known(&MIDDLE, word).map(str::to_owned),
            (None, _) => None,
        };
        // The first of a name: a twist bone or a second head comes after it.
        if let Some(joint) = joint.and_then(|joint| joint_index(&joint)) {
            bones[joint].get_or_insert(bone);
        }
    }
    let of_back: &[(usize, usize)] = match back.len() {
        0 => &[],
        1 => &[(6, 0)],
        2 => &[(3, 0), (9, 1)],
        count => &[(3, 0), (6, count / 2), (9, count - 1)],
    };
    for &(joint, place) in of_back {
        bones[joint] = Some(back[place]);
    }
    bones
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
    Ok(bones)
}

fn known<'a>(table: &[(&'a str, &[&str])], word: &str) -> Option<&'a str> {
    table.iter().find(|(_, words)| words.contains(&word)).map(|(joint, _)| *joint)
}

fn joint_index(name: &str) -> Option<usize> {
    smplx::skeleton().joint(name)
}

/// A bone's name, taken apart.
#[derive(Debug, PartialEq)]
struct Name {
    side: Option<&'static str>,
    /// The words between side and number, joined.
    word: String,
    number: Option<u32>,
}

impl Name {
    fn of(name: &str) -> Self {
        let name = name.rsplit(':').next().unwrap_or(name);
        let mut parsed = Self { side: None, word: String::new(), number: None };
        for part in parts(name) {
            match part.as_str() {
                "left" | "l" if parsed.side.is_none() => parsed.side = Some("left"),
                "right" | "r" if parsed.side.is_none() => parsed.side = Some("right"),
                // Prefixes of whole skeletons.
                "bip" | "mixamorig" | "def" | "org" => {}
                // `HipJoint`s stand between pelvis and hip; the word keeps them apart from hips.
                part => match part.parse() {
                    Ok(number) if !parsed.word.is_empty() => parsed.number = Some(number),
                    Ok(_) => {}
                    Err(_) => parsed.word.push_str(part),
                },
            }
        }
        parsed
    }

    /// The joint's whole name: fingers have a number, other joints must not have one above 0.
    fn numbered(&self, side: &str, joint: &str) -> Option<String> {
        if matches!(joint, "index" | "middle" | "pinky" | "ring" | "thumb") {
            return Some(format!("{side}_{joint}{}", self.number.unwrap_or(1)));
        }
        self.number.is_none_or(|number| number == 0).then(|| format!("{side}_{joint}"))
    }
}

/// The parts of a name in lower case, split at punctuation, before capitals, and between letters and digits.
fn parts(name: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    let mut before = ' ';
    let mut characters = name.chars().peekable();
    while let Some(character) = characters.next() {
        let next_is_lower = characters.peek().is_some_and(|next| next.is_lowercase());
        let begins = character.is_uppercase() && (before.is_lowercase() || next_is_lower);
        if begins || character.is_ascii_digit() != before.is_ascii_digit() || !character.is_alphanumeric() {
            parts.push(String::new());
        }
        if let Some(part) = parts.last_mut().filter(|_| character.is_alphanumeric()) {
            part.extend(character.to_lowercase());
        }
        before = character;
    }
    parts.retain(|part| !part.is_empty());
    parts
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn mapped(names: &str) -> BTreeMap<&str, &str> {
        let names: Vec<&str> = names.split(',').map(str::trim).collect();
        let joint = |name: &&str| Joint {
            name: (*name).into(),
            parent: None,
            offset: DVec3::ZERO,
            channels: Vec::new(),
            first_channel: 0,
        };
        let bones = recognised(&names.iter().map(joint).collect::<Vec<_>>());
        bones
            .iter()
            .zip(&smplx::skeleton().joints)
            .filter_map(|(bone, joint)| Some((names[(*bone)?], joint.as_str())))
            .collect()
    }

    fn assert_maps(names: &str, expected: &[(&str, &str)]) {
        assert_eq!(mapped(names), expected.iter().copied().collect(), "{names}");
    }

    #[test]
    fn the_names_of_common_skeletons_are_known() {
        assert_maps(
            "mixamorig:Hips, mixamorig:Spine, mixamorig:Spine1, mixamorig:Spine2, mixamorig:LeftShoulder, mixamorig:LeftArm, \
             mixamorig:LeftForeArm, mixamorig:LeftHand, mixamorig:LeftHandIndex2, mixamorig:RightUpLeg, mixamorig:RightLeg, \
             mixamorig:RightFoot, mixamorig:RightToeBase, mixamorig:HeadTop_End",
            &[
                ("mixamorig:Hips", "pelvis"),
                ("mixamorig:Spine", "spine1"),
                ("mixamorig:Spine1", "spine2"),
                ("mixamorig:Spine2", "spine3"),
                ("mixamorig:LeftShoulder", "left_collar"),
                ("mixamorig:LeftArm", "left_shoulder"),
                ("mixamorig:LeftForeArm", "left_elbow"),
                ("mixamorig:LeftHand", "left_wrist"),
                ("mixamorig:LeftHandIndex2", "left_index2"),
                ("mixamorig:RightUpLeg", "right_hip"),
                ("mixamorig:RightLeg", "right_knee"),
                ("mixamorig:RightFoot", "right_ankle"),
                ("mixamorig:RightToeBase", "right_foot"),
            ],
        );
        assert_maps(
            "Hips, LHipJoint, LeftUpLeg, LowerBack, Spine, Spine1, Neck, Neck1, Head, LThumb, RightFingerBase",
            &[
                ("Hips", "pelvis"),
                ("LeftUpLeg", "left_hip"),
                ("LowerBack", "spine1"),
                ("Spine", "spine2"),
                ("Spine1", "spine3"),
                ("Neck", "neck"),
                ("Head", "head"),
                ("LThumb", "left_thumb1"),
            ],
        );
        assert_maps(
            "Hips, Chest, LeftCollar, LeftShoulder, LeftElbow, LeftWrist, LeftHip, LeftKnee, LeftAnkle",
            &[
                ("Hips", "pelvis"),
                ("Chest", "spine2"),
                ("LeftCollar", "left_collar"),
                ("LeftShoulder", "left_shoulder"),
                ("LeftElbow", "left_elbow"),
                ("LeftWrist", "left_wrist"),
                ("LeftHip", "left_hip"),
                ("LeftKnee", "left_knee"),
                ("LeftAnkle", "left_ankle"),
            ],
        );
        assert_maps(
            "Bip01 Pelvis, Bip01 L Thigh, Bip01 L Calf, Bip01 R Clavicle, Bip01 R UpperArm, thigh.R, shin.R",
            &[
                ("Bip01 Pelvis", "pelvis"),
                ("Bip01 L Thigh", "left_hip"),
                ("Bip01 L Calf", "left_knee"),
                ("Bip01 R Clavicle", "right_collar"),
                ("Bip01 R UpperArm", "right_shoulder"),
                ("thigh.R", "right_hip"),
                ("shin.R", "right_knee"),
            ],
        );
    }

    #[test]
    fn smplx_names_are_their_own_joints() {
        let names = smplx::skeleton().joints.join(",");
        for (bone, joint) in mapped(&names) {
            assert_eq!(bone, joint);
        }
        assert_eq!(mapped(&names).len(), smplx::skeleton().joints.len());
    }

    #[test]
    fn a_map_that_names_nothing_is_refused() {
        let joints =
            [Joint { name: "Hips".into(), parent: None, offset: DVec3::ZERO, channels: Vec::new(), first_channel: 0 }];
        let map = |pairs: &[(&str, &str)]| {
            declared(&joints, &pairs.iter().map(|(bone, joint)| (bone.to_string(), joint.to_string())).collect())
        };
        assert_eq!(map(&[("Hips", "pelvis")]).unwrap()[0], Some(0));
        assert!(map(&[("Hip", "pelvis")]).unwrap_err().to_string().contains("Hips"));
        assert!(map(&[("Hips", "pelves")]).unwrap_err().to_string().contains("left_hip"));
    }
}
