//! The landmarks of one scan: the body first, then each hand beyond its wrist.

use glam::DVec3;
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;
use xavatar_render::Scene;

use crate::body::{self, place, point};
use crate::hands::{self, Side, Whereabouts};
use crate::models::Models;
use crate::rays::Meeting;

/// A landmark.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    /// A joint of the body, or the tip of a finger: `left_index`.
    pub name: String,
    /// Where it is, in the scan's coordinates, metres.
    pub place: DVec3,
    /// 0 to 1.
    pub confidence: f64,
}

/// Joints and the points that they are.
pub const JOINTS: [(&str, usize); 14] = [
    ("left_eye", point::LEFT_EYE),
    ("right_eye", point::RIGHT_EYE),
    ("left_shoulder", point::LEFT_SHOULDER),
    ("right_shoulder", point::RIGHT_SHOULDER),
    ("left_elbow", point::LEFT_ELBOW),
    ("right_elbow", point::RIGHT_ELBOW),
    ("left_wrist", point::LEFT_WRIST),
    ("right_wrist", point::RIGHT_WRIST),
    ("left_hip", point::LEFT_HIP),
    ("right_hip", point::RIGHT_HIP),
    ("left_knee", point::LEFT_KNEE),
    ("right_knee", point::RIGHT_KNEE),
    ("left_ankle", point::LEFT_ANKLE),
    ("right_ankle", point::RIGHT_ANKLE),
];
/// Fingers as the network counts them.
const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];
/// From the wrist to the middle of the hand, metres.
pub const TO_MIDDLE: f64 = 0.09;
/// How much the forearm says of where fingers point, of what the knuckles say.
const OF_FOREARM: f64 = 0.5;
/// Landmarks that are less sure are left out.
const SURE: f64 = 0.05;

/// An arm: its side, the name of that, and its points.
pub struct Arm {
    pub side: Side,
    pub name: &'static str,
    pub elbow: usize,
    pub wrist: usize,
    pub knuckles: [usize; 2],
}

/// Both.
pub const ARMS: [Arm; 2] = [
    Arm {
        side: Side::Left,
        name: "left",
        elbow: point::LEFT_ELBOW,
        wrist: point::LEFT_WRIST,
        knuckles: [point::LEFT_PINKY, point::LEFT_INDEX],
    },
    Arm {
        side: Side::Right,
        name: "right",
        elbow: point::RIGHT_ELBOW,
        wrist: point::RIGHT_WRIST,
        knuckles: [point::RIGHT_PINKY, point::RIGHT_INDEX],
    },
];

/// Finds the landmarks of a person in a scan in metres, Y up: those that pictures agree on. A hand that is not there has none, and no
/// wrist: where arms end without one, wrists are seen anywhere.
///
/// # Errors
/// Those of a mesh that cannot be rendered.
pub fn find(models: &Models, scan: &TriangleMesh) -> Result<Vec<Landmark>> {
    let points = body::find(models, scan, &Scene::new(scan)?)?;
    let wrists = ARMS.map(|arm| arm.wrist);
    let joints = JOINTS.iter().filter(|(_, point)| !wrists.contains(point));
    let mut landmarks: Vec<Landmark> =
        joints.filter_map(|(name, point)| landmark(name, points[*point]?, body::REACH)).collect();
    for arm in &ARMS {
        let Some(whereabouts) = whereabouts(arm, &points) else { continue };
        let hand = hands::find(models, scan, arm.side, whereabouts)?;
        landmarks.extend(hand.into_iter().flat_map(|points| of_hand(arm.name, &points)));
    }
    Ok(landmarks)
}

/// Where an arm's hand may be, if its elbow and its wrist were seen.
fn whereabouts(arm: &Arm, points: &[Option<Meeting>]) -> Option<Whereabouts> {
    let at = |point: usize| place(points, point);
    let (elbow, wrist) = (at(arm.elbow)?, at(arm.wrist)?);
    let forearm = (wrist - elbow).try_normalize()?;
    let outward = match arm.knuckles.map(at) {
        [Some(pinky), Some(index)] => {
            let knuckles = ((pinky + index) / 2.0 - wrist).normalize_or(forearm);
            (knuckles + forearm * OF_FOREARM).normalize_or(forearm)
        }
        _ => forearm,
    };
    Some(Whereabouts { middle: wrist + outward * TO_MIDDLE, outward })
}

fn of_hand(side: &str, points: &[Option<Meeting>]) -> Vec<Landmark> {
    let point =
        |(point, met): (usize, &Option<Meeting>)| landmark(&hand_point_name(side, point), (*met)?, hands::REACH);
    points.iter().enumerate().filter_map(point).collect()
}

/// What a point of a hand is called.
pub fn hand_point_name(side: &str, point: usize) -> String {
    match point.checked_sub(1).map(|place| (FINGERS[place / 4], place % 4)) {
        None => format!("{side}_wrist"),
        Some((finger, 3)) => format!("{side}_{finger}"),
        Some((finger, joint)) => format!("{side}_{finger}{}", joint + 1),
    }
}

/// Surer the closer the pictures' rays pass to each other, and the more of them do.
fn landmark(name: &str, met: Meeting, reach: f64) -> Option<Landmark> {
    let confidence = met.share * (1.0 - met.error / reach).clamp(0.0, 1.0);
    (confidence > SURE).then(|| Landmark { name: name.into(), place: met.place, confidence })
}
