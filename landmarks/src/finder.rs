//! The landmarks of one scan: the body first, then each hand beyond its wrist.

use glam::DVec3;
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;
use xavatar_render::Scene;

use crate::body::{self, place, point};
use crate::hands::{self, Hand, Side};
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

/// What was found in a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Landmarks that pictures agree on.
    pub landmarks: Vec<Landmark>,
    /// Share of the pictures around the left and the right hand that see it; none where no wrist was found.
    pub hand_votes: [Option<f64>; 2],
}

/// Joints and the points that they are.
const JOINTS: [(&str, usize); 14] = [
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
/// A hand that fewer of the pictures see is not there.
const VOTES: f64 = 0.5;

/// Finds the landmarks of a person; metres, Y up.
///
/// # Errors
/// Those of a mesh that cannot be rendered.
pub fn find(models: &Models, scan: &TriangleMesh) -> Result<Found> {
    let scene = Scene::new(scan)?;
    let points = body::find(models, scan, &scene)?;
    let mut landmarks: Vec<Landmark> = Vec::new();
    let mut hand_votes = [None; 2];
    let arms = [
        (Side::Left, "left", point::LEFT_ELBOW, point::LEFT_WRIST),
        (Side::Right, "right", point::RIGHT_ELBOW, point::RIGHT_WRIST),
    ];
    let mut unseen = Vec::new();
    for (index, (side, name, elbow, wrist)) in arms.into_iter().enumerate() {
        let (Some(elbow), Some(wrist_place)) = (place(&points, elbow), place(&points, wrist)) else { continue };
        let hand = hands::find(models, scan, side, elbow, wrist_place)?;
        hand_votes[index] = Some(hand.votes);
        if hand.votes > VOTES {
            landmarks.extend(of_hand(name, &hand));
        }
        unseen.push(wrist);
    }
    let joints = JOINTS.iter().filter(|(_, point)| !unseen.contains(point));
    landmarks.extend(joints.filter_map(|(name, point)| landmark(name, points[*point]?, 0.08)));
    Ok(Found { landmarks, hand_votes })
}

fn of_hand(side: &str, hand: &Hand) -> Vec<Landmark> {
    let name = |point: usize| match point.checked_sub(1).map(|place| (FINGERS[place / 4], place % 4)) {
        None => format!("{side}_wrist"),
        Some((finger, 3)) => format!("{side}_{finger}"),
        Some((finger, joint)) => format!("{side}_{finger}{}", joint + 1),
    };
    (0..hands::POINTS).filter_map(|point| landmark(&name(point), hand.points[point]?, 0.025)).collect()
}

/// Surer the closer the pictures' rays pass to each other, and the more of them do.
fn landmark(name: &str, met: Meeting, reach: f64) -> Option<Landmark> {
    let confidence = met.share * (1.0 - met.error / reach).clamp(0.0, 1.0);
    (confidence > 0.05).then(|| Landmark { name: name.into(), place: met.place, confidence })
}
