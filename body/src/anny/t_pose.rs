//! From the pose that the base mesh was made in to SMPL-X's T-pose: arms along x, palms down, legs vertical, by linear blend skinning with
//! the whole rig. Decimetres in, metres out.

use glam::{DMat3, DQuat, DVec3};

use super::joints::{self, SIDES};
use super::rig::Rig;

/// Metres in the base mesh's unit.
pub(super) const METRES: f64 = 0.1;
/// Where SMPL-X has the pelvis, decimetres.
const PELVIS: DVec3 = DVec3::new(0.0, -3.5, 0.1);
/// How far collar and shoulder blade are raised for the arm to be level, degrees.
const RAISED: [(&str, f64); 2] = [("clavicle", 8.0), ("shoulder01", 15.0)];
/// The twist that turns the palm down, spread over the bones from the shoulder to the hand.
const TWISTS: [(&str, f64); 4] = [("upperarm01", 0.1), ("upperarm02", 0.25), ("lowerarm01", 0.45), ("lowerarm02", 0.8)];
/// Of the angle by which fingers droop, how much is taken out.
const STRAIGHTENED: f64 = 0.85;
/// The legs stay this much apart, degrees.
const STANCE: f64 = 1.5;

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
        let origin = joints[0] - PELVIS;
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
        let level = DVec3::X * sign;
        for (name, degrees) in RAISED {
            put(name, DQuat::from_rotation_z(sign * degrees.to_radians()));
        }
        let upper = arc(head("lowerarm01") - head("upperarm01"), level);
        let lower = arc(head("wrist") - head("lowerarm01"), level);
        let palm = (head("finger3-1") + head("finger4-1")) / 2.0 - head("wrist");
        let across = head("finger2-1") - head("finger5-1");
        let hand = DQuat::from_mat3(&(frame(level, DVec3::Z) * frame(palm, across).transpose()));
        let twist = (hand * arc(palm, level).inverse()).to_scaled_axis().dot(level);
        for (name, share) in TWISTS {
            let straight = if name.starts_with("upper") { upper } else { lower };
            put(name, DQuat::from_scaled_axis(level * twist * share) * straight);
        }
        put("wrist", hand);
        for finger in 2..=5 {
            let reach =
                hand * (head(&format!("finger{finger}-3")) - head(&format!("finger{finger}-1"))).normalize_or_zero();
            let goal = DVec3::new(reach.x, -0.03, reach.z * 0.8);
            for place in 1..=3 {
                let name = format!("finger{finger}-{place}");
                let along = bone(&name).map_or(DVec3::ZERO, |bone| tails[bone] - heads[bone]);
                let straight = arc(hand * along, goal).to_scaled_axis() * STRAIGHTENED;
                put(&name, DQuat::from_scaled_axis(straight) * hand);
            }
        }
        let leg = head("foot") - head("upperleg01");
        let apart = (leg.x * sign).atan2(-leg.y) - STANCE.to_radians();
        put("upperleg01", DQuat::from_rotation_z(-sign * apart));
        put("foot", DQuat::IDENTITY);
    }
    let mut turns: Vec<DQuat> = Vec::with_capacity(own.len());
    for (bone, own) in own.iter().enumerate() {
        let inherited = rig.bones[bone].parent.map_or(DQuat::IDENTITY, |parent| turns[parent]);
        turns.push(own.unwrap_or(inherited));
    }
    turns
}

/// The smallest turn from one direction to another; none where there is no direction.
fn arc(from: DVec3, to: DVec3) -> DQuat {
    match (from.try_normalize(), to.try_normalize()) {
        (Some(from), Some(to)) => DQuat::from_rotation_arc(from, to),
        _ => DQuat::IDENTITY,
    }
}

/// Axes with x along the one and z as near to the other as that lets it be.
fn frame(x: DVec3, z: DVec3) -> DMat3 {
    let x = x.normalize_or(DVec3::X);
    let z = (z - x * x.dot(z)).normalize_or(x.any_orthonormal_vector());
    DMat3::from_cols(x, z.cross(x), z)
}
