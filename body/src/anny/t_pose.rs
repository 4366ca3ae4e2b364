//! From the pose that the base mesh was made in to SMPL-X's T-pose: arms along x, palms down, legs vertical, by linear blend skinning with
//! the whole rig. Decimetres in, metres out.

use glam::{DQuat, DVec3};

use super::joints::{self, SIDES};
use super::rig::Rig;
use crate::imported::{Arm, Finger, PELVIS, leg_turn};

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
    /// Of each bone: turn, then shift, decimetres.
    turns: Vec<DQuat>,
    shifts: Vec<DVec3>,
    /// SMPL-X's joints in it (55), metres.
    pub joints: Vec<DVec3>,
}

impl TPose {
    pub fn of(rig: &Rig, vertices: &[DVec3]) -> Self {
        let heads = rig.heads(vertices);
        let turns = turns(rig, &heads, &rig.tails(vertices));
        let mut places: Vec<DVec3> = Vec::with_capacity(heads.len());
        for (bone, head) in heads.iter().enumerate() {
            places.push(match rig.bones[bone].parent {
                None => *head,
                Some(parent) => places[parent] + turns[parent] * (*head - heads[parent]),
            });
        }
        let joints = joints::positions(rig, &places);
        let origin = joints[0] - PELVIS / METRES;
        let shift = |((place, turn), head): ((&DVec3, &DQuat), &DVec3)| *place - *turn * *head - origin;
        Self {
            shifts: places.iter().zip(&turns).zip(&heads).map(shift).collect(),
            joints: joints.iter().map(|joint| (*joint - origin) * METRES).collect(),
            turns,
        }
    }

    /// The mesh in the T-pose, metres.
    pub fn skinned(&self, rig: &Rig, vertices: &[DVec3]) -> Vec<DVec3> {
        let moved = |(vertex, row): (&DVec3, &Vec<(usize, f64)>)| {
            let by_bone = row.iter().map(|(bone, weight)| (self.turns[*bone] * *vertex + self.shifts[*bone]) * *weight);
            by_bone.sum::<DVec3>() * METRES
        };
        vertices.iter().zip(&rig.weights).map(moved).collect()
    }

    /// Offsets of the mesh, turned along, metres.
    pub fn turned(&self, rig: &Rig, offsets: &[DVec3]) -> Vec<DVec3> {
        let moved = |(offset, row): (&DVec3, &Vec<(usize, f64)>)| {
            row.iter().map(|(bone, weight)| self.turns[*bone] * *offset * *weight).sum::<DVec3>() * METRES
        };
        offsets.iter().zip(&rig.weights).map(moved).collect()
    }
}

/// How each bone is turned in the world; one that is not told follows its parent.
fn turns(rig: &Rig, heads: &[DVec3], tails: &[DVec3]) -> Vec<DQuat> {
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
    let mut turns: Vec<DQuat> = Vec::with_capacity(own.len());
    for (bone, own) in own.iter().enumerate() {
        let inherited = rig.bones[bone].parent.map_or(DQuat::IDENTITY, |parent| turns[parent]);
        turns.push(own.unwrap_or(inherited));
    }
    turns
}
