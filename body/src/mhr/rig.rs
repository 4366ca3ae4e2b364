//! MHR's skeleton and skinning: parameters to joints, joints to vertices. J = 127 joints; centimetres, as in the file.
//!
//! Seven numbers a joint, linear in the parameters: a shift, Euler angles, and the logarithm (base 2) of a scale. A joint's turn is its
//! prerotation times the angles', its place in its parent's frame its offset plus the shift; scales multiply along the tree.

use glam::{DMat3, DQuat, DVec3, EulerRot};

use super::joints::map;

/// Numbers a joint.
const PER_JOINT: usize = 7;
/// The last parameters are scales of the skeleton.
const SCALES: usize = 68;

/// A shift, a turn and a scale: x to shift + scale * turn x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Similarity {
    pub shift: DVec3,
    pub turn: DQuat,
    pub scale: f64,
}

impl Similarity {
    fn then(&self, inner: &Self) -> Self {
        Self { shift: self.apply(inner.shift), turn: self.turn * inner.turn, scale: self.scale * inner.scale }
    }

    fn apply(&self, point: DVec3) -> DVec3 {
        self.shift + self.turn * point * self.scale
    }

    fn linear(&self) -> DMat3 {
        DMat3::from_quat(self.turn) * self.scale
    }
}

/// The rig.
pub(super) struct Rig {
    /// Each joint's parent, which comes before it (J).
    pub parents: Vec<Option<usize>>,
    pub offsets: Vec<DVec3>,
    pub prerotations: Vec<DQuat>,
    /// What a parameter adds to the joints' numbers: (7 J, parameters), row-major.
    pub transform: Vec<f64>,
    /// Pose, then scales; the transform may have columns for shapes after them, which move no joint.
    pub parameters: usize,
    /// From the place of a vertex to each joint's frame (J).
    pub inverse_bind: Vec<Similarity>,
    /// The joints that each vertex follows, with weights (V).
    pub weights: Vec<Vec<(usize, f64)>>,
}

impl Rig {
    /// The joints in the world (J) for parameters.
    pub fn posed(&self, parameters: &[f64]) -> Vec<Similarity> {
        let columns = self.transform.len() / (PER_JOINT * self.parents.len());
        let mut joints: Vec<Similarity> = Vec::with_capacity(self.parents.len());
        for (joint, rows) in self.transform.chunks_exact(PER_JOINT * columns).enumerate() {
            let number = |at: usize| -> f64 {
                rows[at * columns..][..columns].iter().zip(parameters).map(|(entry, parameter)| entry * parameter).sum()
            };
            let [x, y, z, a, b, c, scale]: [f64; PER_JOINT] = std::array::from_fn(number);
            let own = Similarity {
                shift: self.offsets[joint] + DVec3::new(x, y, z),
                turn: self.prerotations[joint] * DQuat::from_euler(EulerRot::ZYX, c, b, a),
                scale: scale.exp2(),
            };
            joints.push(self.parents[joint].map_or(own, |parent| joints[parent].then(&own)));
        }
        joints
    }

    /// The parameters' scales alone: the skeleton in its own proportions, in the pose that it was made in.
    pub fn scales_of(&self, parameters: &[f64]) -> Vec<f64> {
        let first = self.parameters.saturating_sub(SCALES);
        parameters.iter().enumerate().map(|(index, value)| if index < first { 0.0 } else { *value }).collect()
    }

    /// What skinning with the joints does to the surroundings of each vertex (V): its place, and its linear part.
    pub fn skinned(&self, joints: &[Similarity], vertices: &[DVec3]) -> Vec<(DVec3, DMat3)> {
        let bones: Vec<Similarity> =
            joints.iter().zip(&self.inverse_bind).map(|(joint, bind)| joint.then(bind)).collect();
        let moved = |(vertex, row): (&DVec3, &Vec<(usize, f64)>)| {
            let mut place = DVec3::ZERO;
            let mut linear = DMat3::ZERO;
            for (bone, weight) in row {
                place += bones[*bone].apply(*vertex) * *weight;
                linear += bones[*bone].linear() * *weight;
            }
            (place, linear)
        };
        vertices.iter().zip(&self.weights).map(moved).collect()
    }

    /// Of a pose given as the turns of SMPL-X's joints in the world (55) from where `made` (J) they are, each joint's own turn less its
    /// prerotation (J). Joints that become one of SMPL-X's are rigid among each other.
    pub fn own_turns(&self, made: &[Similarity], world: &[DQuat]) -> Vec<DQuat> {
        let turned = |joint: usize| world[map().becomes[joint]] * made[joint].turn;
        let own = |joint: usize| {
            let parent = self.parents[joint].map_or(DQuat::IDENTITY, turned);
            (parent * self.prerotations[joint]).inverse() * turned(joint)
        };
        (0..self.parents.len()).map(own).collect()
    }
}
