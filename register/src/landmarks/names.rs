//! What the programs that find landmarks call them, and in which order they write them.
//!
//! An empty name is a point that is no place of a body's skeleton, such as a nose or a toe.

/// OpenPose's BODY_25.
const BODY_25: [&str; 25] = [
    "",
    "neck",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "pelvis",
    "right_hip",
    "right_knee",
    "right_ankle",
    "left_hip",
    "left_knee",
    "left_ankle",
    "right_eye",
    "left_eye",
    "",
    "",
    "",
    "",
    "",
    "",
    "",
    "",
];

/// COCO's 17 points.
pub const COCO_17: [&str; 17] = [
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
];
/// Those of them that are no place of a skeleton.
const OFF_SKELETON: [&str; 3] = ["nose", "left_ear", "right_ear"];

/// A hand as OpenPose, COCO-WholeBody and MediaPipe count it: the wrist, then each finger from the palm to its tip.
const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];

/// Names that markers have, in lower case without `_` and blanks, and the places that they are.
const ALIASES: [(&str, &str); 30] = [
    ("hip", "pelvis"),
    ("midhip", "pelvis"),
    ("root", "pelvis"),
    ("lhip", "left_hip"),
    ("rhip", "right_hip"),
    ("lknee", "left_knee"),
    ("rknee", "right_knee"),
    ("lankle", "left_ankle"),
    ("rankle", "right_ankle"),
    ("lshoulder", "left_shoulder"),
    ("rshoulder", "right_shoulder"),
    ("lelbow", "left_elbow"),
    ("relbow", "right_elbow"),
    ("lwrist", "left_wrist"),
    ("rwrist", "right_wrist"),
    ("leye", "left_eye"),
    ("reye", "right_eye"),
    ("lhjc", "left_hip"),
    ("rhjc", "right_hip"),
    ("lkjc", "left_knee"),
    ("rkjc", "right_knee"),
    ("lajc", "left_ankle"),
    ("rajc", "right_ankle"),
    ("lsjc", "left_shoulder"),
    ("rsjc", "right_shoulder"),
    ("lejc", "left_elbow"),
    ("rejc", "right_elbow"),
    ("lwjc", "left_wrist"),
    ("rwjc", "right_wrist"),
    ("spinec7", "neck"),
];

/// A hand's points: 21 with the wrist, 20 without.
fn hand(side: &str, with_wrist: bool) -> Vec<String> {
    let finger = |finger: &&str| {
        let joints = [1, 2, 3].map(|place| format!("{side}_{finger}{place}"));
        joints.into_iter().chain([format!("{side}_{finger}")]).collect::<Vec<String>>()
    };
    let wrist = with_wrist.then(|| format!("{side}_wrist"));
    wrist.into_iter().chain(FINGERS.iter().flat_map(finger)).collect()
}

fn blank(count: usize) -> Vec<String> {
    vec![String::new(); count]
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

/// COCO's points, without names where they are no place of a skeleton.
fn coco() -> Vec<String> {
    owned(&COCO_17.map(|name| if OFF_SKELETON.contains(&name) { "" } else { name }))
}

/// The names of a layout with so many points; none if no layout has so many.
///
/// 17 COCO, 133 COCO-WholeBody, 136 Halpe, 25 BODY_25, 67 with hands, 118 and 137 with a face, 135 BODY_135.
pub fn of_count(count: usize) -> Option<Vec<String>> {
    let with_hands =
        |body: Vec<String>, face: usize| [body, hand("left", true), hand("right", true), blank(face)].concat();
    match count {
        17 => Some(coco()),
        25 => Some(owned(&BODY_25)),
        67 | 118 | 137 => Some(with_hands(owned(&BODY_25), count - 67)),
        133 => Some([coco(), blank(6 + 68), hand("left", true), hand("right", true)].concat()),
        135 => Some([owned(&BODY_25), hand("left", false), hand("right", false), blank(70)].concat()),
        136 => {
            let body = [coco(), owned(&["", "neck", "pelvis"]), blank(6)].concat();
            Some([body, blank(68), hand("left", true), hand("right", true)].concat())
        }
        _ => None,
    }
}

/// The place that a marker's name means: a name of a site itself, or what programs call it; empty if it is unknown.
pub fn of_marker(marker: &str) -> String {
    // Vicon puts the subject before the marker.
    let name = marker.rsplit(':').next().unwrap_or(marker).trim().to_ascii_lowercase();
    let plain: String = name.chars().filter(|character| character.is_ascii_alphanumeric()).collect();
    ALIASES
        .iter()
        .find(|(alias, _)| *alias == plain)
        .map_or(name.replace([' ', '-'], "_"), |(_, site)| (*site).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layout_has_as_many_names_as_points() {
        for count in [17, 25, 67, 118, 133, 135, 136, 137] {
            let names = of_count(count).unwrap();
            assert_eq!(names.len(), count);
            assert!(names.iter().any(|name| name == "left_hip"));
        }
        assert_eq!(of_count(133).unwrap()[91 + 8], "left_index");
        assert_eq!(of_count(135).unwrap()[25 + 20 + 4], "right_index1");
        assert_eq!(of_count(67).unwrap()[25 + 21], "right_wrist");
        assert_eq!(of_count(17).unwrap()[..3], ["", "left_eye", "right_eye"]);
        assert_eq!(of_count(33), None);
    }

    #[test]
    fn markers_are_known_by_their_usual_names() {
        assert_eq!(of_marker("Anna:LKJC"), "left_knee");
        assert_eq!(of_marker("R Shoulder"), "right_shoulder");
        assert_eq!(of_marker("left_index2"), "left_index2");
    }
}
