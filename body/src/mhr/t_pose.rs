//! From the pose that MHR was made in to SMPL-X's T-pose, by linear blend skinning with SMPL-X's joints. Centimetres in, metres out.

use glam::{DMat3, DQuat, DVec3};

use super::joints::map;
use crate::imported::{Arm, Finger, PELVIS, TurnedBones, leg_turn};
use crate::smplx;

/// Metres in a centimetre.
pub(super) const METRES: f64 = 0.01;
/// The shares of the twist that turns the palm down, of the bones before the hand.
const TWISTS: [(&str, f64); 2] = [("shoulder", 0.15), ("elbow", 0.6)];
/// Fingers but the thumb, which stays as it is in the hand.
const FINGERS: [&str; 4] = ["index", "middle", "ring", "pinky"];

/// What turns a body to the T-pose.
pub(super) struct TPose {
    /// SMPL-X's joints (55), centimetres.
    bones: TurnedBones,
}

impl TPose {
    /// For MHR's joints (127) at these places, centimetres.
    pub fn of(places: &[DVec3]) -> Self {
        let heads: Vec<DVec3> = map().at.iter().map(|joint| places[*joint]).collect();
        let own = own_turns(places, &heads);
        let bones = TurnedBones::new(|joint| smplx::skeleton().parents[joint], &heads, &own);
        Self { bones: bones.moved(PELVIS / METRES - heads[smplx::joint::PELVIS]) }
    }

    /// How the joints are turned in the world (55).
    pub fn turns(&self) -> &[DQuat] {
        &self.bones.turns
    }

    /// Where the joints are (55), metres.
    pub fn joints(&self) -> Vec<DVec3> {
        self.bones.heads.iter().map(|joint| *joint * METRES).collect()
    }

    /// Where a vertex with weights of the joints (55) goes, metres.
    pub fn place(&self, vertex: DVec3, weights: &[f64]) -> DVec3 {
        self.bones.skinned(vertex, weights.iter().copied().enumerate()) * METRES
    }

    /// How an offset of a vertex with weights of the joints (55) is turned and made metres.
    pub fn linear(&self, weights: &[f64]) -> DMat3 {
        self.bones.linear(weights.iter().copied().enumerate().filter(|(_, weight)| *weight > 0.0)) * METRES
    }
}

/// How SMPL-X's joints are turned in the world, those that are told.
fn own_turns(places: &[DVec3], heads: &[DVec3]) -> Vec<Option<DQuat>> {
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
    own
}
