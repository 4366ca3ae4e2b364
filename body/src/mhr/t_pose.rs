//! From the pose that MHR was made in to SMPL-X's T-pose, by linear blend skinning with SMPL-X's joints. Centimetres in, metres out.

use glam::{DMat3, DQuat, DVec3};

use super::joints::map;
use crate::imported::{Arm, Finger, PELVIS, leg_turn};
use crate::smplx;

/// Metres in a centimetre.
pub(super) const METRES: f64 = 0.01;
/// The shares of the twist that turns the palm down, of the bones before the hand.
const TWISTS: [(&str, f64); 2] = [("shoulder", 0.15), ("elbow", 0.6)];
/// Fingers but the thumb, which stays as it is in the hand.
const FINGERS: [&str; 4] = ["index", "middle", "ring", "pinky"];

/// What turns a body to the T-pose.
pub(super) struct TPose {
    /// Of each of SMPL-X's joints in the world (55).
    pub turns: Vec<DQuat>,
    /// What is added after the turn, centimetres (55).
    shifts: Vec<DVec3>,
    /// Where the joints are in the T-pose (55), metres.
    pub joints: Vec<DVec3>,
}

impl TPose {
    /// For MHR's joints (127) at these places, centimetres.
    pub fn of(places: &[DVec3]) -> Self {
        let heads: Vec<DVec3> = map().at.iter().map(|joint| places[*joint]).collect();
        let turns = turns(places, &heads);
        let parents = &smplx::skeleton().parents;
        let mut turned: Vec<DVec3> = Vec::with_capacity(heads.len());
        for (joint, head) in heads.iter().enumerate() {
            turned.push(match parents[joint] {
                None => PELVIS / METRES,
                Some(parent) => turned[parent] + turns[parent] * (*head - heads[parent]),
            });
        }
        let shift = |((place, turn), head): ((&DVec3, &DQuat), &DVec3)| *place - *turn * *head;
        Self {
            shifts: turned.iter().zip(&turns).zip(&heads).map(shift).collect(),
            joints: turned.iter().map(|joint| *joint * METRES).collect(),
            turns,
        }
    }

    /// Where a vertex with weights of the joints (55) goes, metres.
    pub fn place(&self, vertex: DVec3, weights: &[f64]) -> DVec3 {
        let by_joint = self.turns.iter().zip(&self.shifts).zip(weights);
        by_joint.map(|((turn, shift), weight)| (*turn * vertex + *shift) * *weight).sum::<DVec3>() * METRES
    }

    /// How an offset of a vertex with weights of the joints (55) is turned and made metres.
    pub fn linear(&self, weights: &[f64]) -> DMat3 {
        let by_joint = self.turns.iter().zip(weights).filter(|(_, weight)| **weight > 0.0);
        by_joint.map(|(turn, weight)| DMat3::from_quat(*turn) * (*weight * METRES)).sum()
    }
}

/// How each of SMPL-X's joints is turned in the world; one that is not told follows its parent.
fn turns(places: &[DVec3], heads: &[DVec3]) -> Vec<DQuat> {
    let skeleton = smplx::skeleton();
    let mut own: Vec<Option<DQuat>> = vec![None; heads.len()];
    for (side, letter, sign) in [("left", 'l', 1.0), ("right", 'r', -1.0)] {
        let joint = |name: &str| skeleton.joint(&format!("{side}_{name}"));
        let head = |name: &str| joint(name).map_or(DVec3::ZERO, |joint| heads[joint]);
        let tip =
            |finger: &str| map().joint(&format!("{letter}_{finger}_null")).map_or(DVec3::ZERO, |joint| places[joint]);
        let mut put = |name: &str, turn: DQuat| {
            if let Some(joint) = joint(name) {
                own[joint] = Some(turn);
            }
        };
        let finger = |name: &str| {
            let [first, second, third] = [1, 2, 3].map(|place| head(&format!("{name}{place}")));
            Finger { knuckle: first, reach: third - first, bones: [second - first, third - second, tip(name) - third] }
        };
        let (shoulder, elbow, wrist) = (head("shoulder"), head("elbow"), head("wrist"));
        let turned = Arm { shoulder, elbow, wrist, fingers: FINGERS.map(finger) }.turns(sign);
        for ((name, share), straight) in TWISTS.into_iter().zip([turned.upper, turned.lower]) {
            put(name, turned.twisted(straight, share));
        }
        put("wrist", turned.hand);
        for (name, bones) in FINGERS.into_iter().zip(turned.fingers) {
            for (place, turn) in (1..).zip(bones) {
                put(&format!("{name}{place}"), turn);
            }
        }
        put("hip", leg_turn(head("ankle") - head("hip"), sign));
        put("ankle", DQuat::IDENTITY);
    }
    let mut turns: Vec<DQuat> = Vec::with_capacity(own.len());
    for (joint, own) in own.iter().enumerate() {
        let inherited = skeleton.parents[joint].map_or(DQuat::IDENTITY, |parent| turns[parent]);
        turns.push(own.unwrap_or(inherited));
    }
    turns
}
