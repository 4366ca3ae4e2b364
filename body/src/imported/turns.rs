//! How limbs turn from the pose that a body was made in to SMPL-X's T-pose: arms along x, palms down, fingers straight, legs vertical; and where
//! that takes what hangs on them.
//!
//! All turns are in the world, from one pose to the other.

use glam::{DMat3, DQuat, DVec3};

/// Of the angle by which fingers droop, how much is taken out.
const STRAIGHTENED: f64 = 0.85;
/// The legs stay this much apart, degrees.
const STANCE: f64 = 1.5;

/// A finger's bones, as they lie.
pub(crate) struct Finger {
    pub knuckle: DVec3,
    /// From the knuckle to the last joint.
    pub reach: DVec3,
    /// Along each bone.
    pub bones: [DVec3; 3],
}

/// Where an arm is.
pub(crate) struct Arm {
    pub shoulder: DVec3,
    pub elbow: DVec3,
    pub wrist: DVec3,
    /// Index, middle, ring, pinky.
    pub fingers: [Finger; 4],
}

/// How an arm turns.
pub(crate) struct ArmTurns {
    pub upper: DQuat,
    pub lower: DQuat,
    pub hand: DQuat,
    /// What turns the palm down, about the arm: axis times angle. Bones from the shoulder to the hand take more and more of it.
    pub twist: DVec3,
    /// Each bone of each finger.
    pub fingers: [[DQuat; 3]; 4],
}

impl Arm {
    /// The turns of the arm on the side of `sign` times x.
    pub fn turns(&self, sign: f64) -> ArmTurns {
        let level = DVec3::X * sign;
        let [index, middle, ring, pinky] = &self.fingers;
        let palm = (middle.knuckle + ring.knuckle) / 2.0 - self.wrist;
        let across = index.knuckle - pinky.knuckle;
        let hand = DQuat::from_mat3(&(frame(level, DVec3::Z) * frame(palm, across).transpose()));
        let straight = |finger: &Finger| {
            let reach = hand * finger.reach.normalize_or_zero();
            let goal = DVec3::new(reach.x, -0.03, reach.z * 0.8);
            finger.bones.map(|along| {
                let straight = arc(hand * along, goal).to_scaled_axis() * STRAIGHTENED;
                DQuat::from_scaled_axis(straight) * hand
            })
        };
        ArmTurns {
            upper: arc(self.elbow - self.shoulder, level),
            lower: arc(self.wrist - self.elbow, level),
            twist: level * (hand * arc(palm, level).inverse()).to_scaled_axis().dot(level),
            fingers: self.fingers.each_ref().map(straight),
            hand,
        }
    }
}

impl ArmTurns {
    /// A turn of the arm with so much of the twist.
    pub fn twisted(&self, straight: DQuat, share: f64) -> DQuat {
        DQuat::from_scaled_axis(self.twist * share) * straight
    }
}

/// The turn of a leg, given from hip to foot, on the side of `sign` times x.
pub(crate) fn leg_turn(leg: DVec3, sign: f64) -> DQuat {
    let apart = (leg.x * sign).atan2(-leg.y) - STANCE.to_radians();
    DQuat::from_rotation_z(-sign * apart)
}

/// Bones of a tree that were turned and hang together.
pub(crate) struct TurnedBones {
    pub turns: Vec<DQuat>,
    /// What is added after the turn.
    shifts: Vec<DVec3>,
    /// Where the bones begin.
    pub heads: Vec<DVec3>,
}

impl TurnedBones {
    /// Of bones that began at `heads`; their parents come before them. A bone without a turn of its `own` follows its parent, and roots stay where they are.
    pub fn new(parents: impl Fn(usize) -> Option<usize>, heads: &[DVec3], own: &[Option<DQuat>]) -> Self {
        let count = heads.len();
        let mut bones = Self {
            turns: Vec::with_capacity(count),
            shifts: Vec::with_capacity(count),
            heads: Vec::with_capacity(count),
        };
        for bone in 0..count {
            let (turn, head) = match parents(bone) {
                None => (DQuat::IDENTITY, heads[bone]),
                Some(parent) => (bones.turns[parent], bones.place(heads[bone], parent)),
            };
            let turn = own[bone].unwrap_or(turn);
            bones.turns.push(turn);
            bones.shifts.push(head - turn * heads[bone]);
            bones.heads.push(head);
        }
        bones
    }

    /// All of them moved along.
    pub fn moved(mut self, by: DVec3) -> Self {
        self.shifts.iter_mut().chain(&mut self.heads).for_each(|place| *place += by);
        self
    }

    fn place(&self, point: DVec3, bone: usize) -> DVec3 {
        self.turns[bone] * point + self.shifts[bone]
    }

    /// Where a point goes that follows bones with these weights.
    pub fn skinned(&self, point: DVec3, weights: impl IntoIterator<Item = (usize, f64)>) -> DVec3 {
        weights.into_iter().map(|(bone, weight)| self.place(point, bone) * weight).sum()
    }

    /// What becomes of offsets there.
    pub fn linear(&self, weights: impl IntoIterator<Item = (usize, f64)>) -> DMat3 {
        weights.into_iter().map(|(bone, weight)| DMat3::from_quat(self.turns[bone]) * weight).sum()
    }
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
