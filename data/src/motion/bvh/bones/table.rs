//! The words that skeletons use for SMPL-X's joints.

/// The words for joints that have a side, by the joint's name without it.
const SIDED: [(&str, &[&str]); 9] = [
    ("hip", &["hip", "upleg", "uleg", "thigh", "thighbend", "upperthigh", "upperleg", "legupper", "femur"]),
    ("knee", &["knee", "leg", "lowleg", "lowerleg", "leglower", "shin", "calf", "tibia"]),
    ("ankle", &["ankle", "foot"]),
    ("foot", &["toe", "toebase", "toes", "ball", "forefoot"]),
    ("collar", &["collar", "collarbone", "clavicle", "scapula", "shoulder"]),
    ("shoulder", ARM),
    ("elbow", &["elbow", "forearm", "forearmbend", "farm", "lowarm", "lowerarm", "armlower"]),
    ("wrist", &["wrist", "hand"]),
    ("eye", &["eye", "eyeball"]),
];
/// Words that leave no doubt that a shoulder beside them is the collar bone.
pub(super) const ARM: &[&str] = &["arm", "uparm", "uarm", "upperarm", "armupper", "shldr", "shldrbend", "humerus"];
/// Words that leave no doubt that a hip with a side beside them is a helper above the thigh.
pub(super) const THIGH: &[&str] =
    &["upleg", "uleg", "thigh", "thighbend", "upperthigh", "upperleg", "legupper", "femur"];
/// The words for fingers, by the finger's name.
const FINGERS: [(&str, &[&str]); 5] = [
    ("thumb", &["thumb", "handthumb", "fthumb", "thumbfinger"]),
    ("index", &["index", "handindex", "indexfinger", "findex", "pointer"]),
    ("middle", &["middle", "mid", "handmiddle", "middlefinger", "fmiddle"]),
    ("ring", &["ring", "handring", "ringfinger", "fring"]),
    ("pinky", &["pinky", "little", "handpinky", "pinkyfinger", "littlefinger", "fpinky"]),
];
/// Words for a finger that a number names.
const NUMBERED: [&str; 4] = ["finger", "handfinger", "digit", "fingers"];
/// The words for joints in the middle.
const MIDDLE: [(&str, &[&str]); 4] = [
    ("pelvis", &["hips", "hip", "pelvis", "hipcenter", "hipscenter", "centerhip", "spinebase"]),
    ("neck", &["neck", "necklower", "necktwist"]),
    ("head", &["head"]),
    ("jaw", &["jaw", "lowerjaw", "jawbone"]),
];

fn lookup(table: &[(&'static str, &[&str])], word: &str) -> Option<&'static str> {
    table.iter().find(|(_, words)| words.contains(&word)).map(|(joint, _)| *joint)
}

/// The joint, without its side, that a word means.
pub(super) fn sided(word: &str) -> Option<&'static str> {
    lookup(&SIDED, word)
}

/// The joint in the middle that a word means.
pub(super) fn middle(word: &str) -> Option<&'static str> {
    lookup(&MIDDLE, word)
}

/// The finger that a word means.
pub(super) fn finger(word: &str) -> Option<&'static str> {
    lookup(&FINGERS, word)
}

/// The finger of a number, counted from the thumb, 0.
pub(super) fn finger_of(number: usize) -> Option<&'static str> {
    FINGERS.get(number).map(|(finger, _)| *finger)
}

/// Whether a word is for fingers that numbers name.
pub(super) fn is_numbered_finger(word: &str) -> bool {
    NUMBERED.contains(&word)
}

/// Whether a word is one for joints that have a side.
pub(super) fn has_side(word: &str) -> bool {
    sided(word).is_some() || finger(word).is_some() || is_numbered_finger(word)
}

/// Whether a word is one for joints in the middle.
pub(super) fn is_middle(word: &str) -> bool {
    middle(word).is_some()
}
