//! From the pose that the base mesh was made in to SMPL-X's T-pose: arms along x, palms down, legs vertical, by linear blend skinning with
//! the whole rig. Decimetres in, metres out.

use glam::{DQuat, DVec3};

use super::joints::{self, SIDES};
use super::rig::Rig;
use crate::imported::{Arm, Finger, PELVIS, TurnedBones, leg_turn};

/// Metres in the base mesh's unit.
pub(super) const METRES: f64 = 0.1;
/// How far collar and shoulder blade are raised for the arm to be level, degrees.
const RAISED: [(&str, f64); 2] = [("clavicle", 8.0), ("shoulder01", 15.0)];
/// The twist that turns the palm down, spread over the bones from the shoulder to the hand.
const TWISTS: [(&str, f64); 4] = [("upperarm01", 0.1), ("upperarm02", 0.25), ("lowerarm01", 0.45), ("lowerarm02", 0.8)];
/// Index to pinky, as the rig numbers them.
const FINGERS: [usize; 4] = [2, 3, 4, 5];

/// What turns a shaped mesh to the T-pose.
pub(super) struct TPose {
    /// Decimetres.
    bones: TurnedBones,
    /// SMPL-X's joints in it (55), metres.
    pub joints: Vec<DVec3>,
}

impl TPose {
    pub fn of(rig: &Rig, vertices: &[DVec3]) -> Self {
        let heads = rig.heads(vertices);
        let own = own_turns(rig, &heads, &rig.tails(vertices));
        let bones = TurnedBones::new(|bone| rig.bones[bone].parent, &heads, &own);
        let pelvis = joints::positions(rig, &bones.heads)[0];
        let bones = bones.moved(PELVIS / METRES - pelvis);
        let joints = joints::positions(rig, &bones.heads).into_iter().map(|joint| joint * METRES).collect();
        Self { bones, joints }
    }

    /// The mesh in the T-pose, metres.
    pub fn skinned(&self, rig: &Rig, vertices: &[DVec3]) -> Vec<DVec3> {
        let moved =
            |(vertex, row): (&DVec3, &Vec<(usize, f64)>)| self.bones.skinned(*vertex, row.iter().copied()) * METRES;
        vertices.iter().zip(&rig.weights).map(moved).collect()
    }

    /// Offsets of the mesh, turned along, metres.
    pub fn turned(&self, rig: &Rig, offsets: &[DVec3]) -> Vec<DVec3> {
        let moved =
            |(offset, row): (&DVec3, &Vec<(usize, f64)>)| self.bones.linear(row.iter().copied()) * *offset * METRES;
        offsets.iter().zip(&rig.weights).map(moved).collect()
    }
}

/// How bones are turned in the world, those that are told.
fn own_turns(rig: &Rig, heads: &[DVec3], tails: &[DVec3]) -> Vec<Option<DQuat>> {
    let mut own: Vec<Option<DQuat>> = vec![None; heads.len()];
    for (side, _) in SIDES {
        let sign = if side == "L" { 1.0 } else { -1.0 };
        let bone = |name: &str| rig.bone(&format!("{name}.{side}"));
        let head = |name: &str| bone(name).map_or(DVec3::ZERO, |bone| heads[bone]);
        let mut put = |name: &str, turn: DQuat| {
            if let Some(bone) = bone(name) {
                own[bone] = Some(turn);
            }
        };
        for (name, degrees) in RAISED {
            put(name, DQuat::from_rotation_z(sign * degrees.to_radians()));
        }
        let finger = |number: usize| Finger {
            knuckle: head(&format!("finger{number}-1")),
            reach: head(&format!("finger{number}-3")) - head(&format!("finger{number}-1")),
            bones: [1, 2, 3].map(|place| {
                bone(&format!("finger{number}-{place}")).map_or(DVec3::ZERO, |bone| tails[bone] - heads[bone])
            }),
        };
        let arm = Arm {
            shoulder: head("upperarm01"),
            elbow: head("lowerarm01"),
            wrist: head("wrist"),
            fingers: FINGERS.map(finger),
        };
        let turned = arm.turns(sign);
        for (name, share) in TWISTS {
            let straight = if name.starts_with("upper") { turned.upper } else { turned.lower };
            put(name, turned.twisted(straight, share));
        }
        put("wrist", turned.hand);
        for (number, bones) in FINGERS.into_iter().zip(turned.fingers) {
            for (place, turn) in (1..).zip(bones) {
                put(&format!("finger{number}-{place}"), turn);
            }
        }
        put("upperleg01", leg_turn(head("foot") - head("upperleg01"), sign));
        put("foot", DQuat::IDENTITY);
    }
    own
}
