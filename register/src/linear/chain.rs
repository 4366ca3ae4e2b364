//! The kinematic chain of one frame and its derivatives: where joints are, how bones are turned, what drives the correctives.
//!
//! G_j = G_parent R_j, p_j = p_parent + G_parent (J_j - J_parent), A_j = p_j - G_j J_j; J = J_0 + sum_c c J_c of the coefficients c (shape, then
//! expression). A turn d of joint k moves a joint j below it by -hat(p_j - p_k) G_k d. J joints, K = S + E coefficients.

use glam::{DMat3, DVec3};
use xavatar_body::{BodyModel, Correctives};

use super::columns::{Extents, Unknowns};
use super::frame_pose::FramePose;
use super::normal_equations::Row;
use super::so3;

/// What drives pose correctives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drive {
    /// Nothing: there are none.
    Nothing,
    /// Nine entries of R - I of every joint but the root.
    RotationEntries,
    /// Four of q - (0, 0, 0, 1) of every joint from this on, and a coefficient.
    Quaternions { first_joint: usize, coefficient: Option<usize> },
}

impl Drive {
    /// Features of one joint, and the first joint that has some.
    pub fn features(self) -> (usize, usize) {
        match self {
            Self::Nothing => (0, usize::MAX),
            Self::RotationEntries => (9, 1),
            Self::Quaternions { first_joint, .. } => (4, first_joint),
        }
    }
}

/// A skeleton with the joints that its body's coefficients give it.
#[derive(Clone, Debug)]
pub struct Linkage {
    pub(super) parents: Vec<Option<usize>>,
    template: Vec<DVec3>,
    directions: Vec<Vec<DVec3>>,
    pub(super) drive: Drive,
    extents: Extents,
}

/// A skeleton in the pose of one frame.
#[derive(Clone, Debug)]
pub struct PosedChain {
    /// G_j (J).
    pub turns: Vec<DMat3>,
    /// p_j, without translation (J).
    pub positions: Vec<DVec3>,
    /// A_j (J).
    pub(super) shifts: Vec<DVec3>,
    /// Shape, then expression (K).
    pub(super) coefficients: Vec<f64>,
    pub(super) translation: DVec3,
    /// dp_j by each coefficient (J, K).
    position_slopes: Vec<Vec<DVec3>>,
    /// dA_j by each coefficient (J, K).
    pub(super) shift_slopes: Vec<Vec<DVec3>>,
    /// The features of each joint that has some (J); empty for others.
    pub(super) features: Vec<Vec<f64>>,
    /// Their derivatives by the joint's turn (J, features, 3).
    pub(super) feature_slopes: Vec<Vec<[f64; 3]>>,
}

impl Linkage {
    /// Of a body.
    pub fn of(model: &BodyModel) -> Self {
        let anatomy = model.anatomy();
        let drive = match anatomy.correctives {
            Correctives::None => Drive::Nothing,
            Correctives::RotationEntries(_) => Drive::RotationEntries,
            Correctives::Quaternions { first_joint, coefficient, .. } => {
                Drive::Quaternions { first_joint, coefficient }
            }
        };
        Self {
            parents: anatomy.skeleton.parents.clone(),
            template: anatomy.joints.template.clone(),
            directions: anatomy.joints.directions.clone(),
            drive,
            extents: Extents {
                joints: anatomy.skeleton.joints.len(),
                shapes: model.shape_coefficients(),
                expressions: model.expression_coefficients(),
            },
        }
    }

    /// The kinds of unknowns.
    pub fn extents(&self) -> Extents {
        self.extents
    }

    /// The joints at rest, of the mean shape (J).
    pub fn rest(&self) -> &[DVec3] {
        &self.template
    }

    /// The parent of each joint (J).
    pub fn parents(&self) -> &[Option<usize>] {
        &self.parents
    }

    /// The skeleton in a pose and shape.
    pub fn posed(&self, pose: &FramePose, shape: &[f64]) -> PosedChain {
        let coefficients: Vec<f64> = shape.iter().chain(&pose.expression).copied().collect();
        let mut rest = self.template.clone();
        for (direction, coefficient) in self.directions.iter().zip(&coefficients) {
            rest.iter_mut().zip(direction).for_each(|(joint, offset)| *joint += *offset * *coefficient);
        }
        let joints = self.extents.joints;
        let mut turns: Vec<DMat3> = Vec::with_capacity(joints);
        let mut positions: Vec<DVec3> = Vec::with_capacity(joints);
        let mut position_slopes: Vec<Vec<DVec3>> = Vec::with_capacity(joints);
        for (joint, parent) in self.parents.iter().enumerate() {
            let along = |of: &dyn Fn(usize) -> DVec3, parent: usize| of(joint) - of(parent);
            match *parent {
                None => {
                    turns.push(pose.rotations[joint]);
                    positions.push(rest[joint]);
                    position_slopes.push(self.directions.iter().map(|direction| direction[joint]).collect());
                }
                Some(parent) => {
                    let turn = turns[parent];
                    positions.push(positions[parent] + turn * along(&|joint| rest[joint], parent));
                    let slope = |(coefficient, direction): (usize, &Vec<DVec3>)| {
                        position_slopes[parent][coefficient] + turn * along(&|joint| direction[joint], parent)
                    };
                    let slopes = self.directions.iter().enumerate().map(slope).collect();
                    position_slopes.push(slopes);
                    turns.push(turn * pose.rotations[joint]);
                }
            }
        }
        let shift = |joint: usize| positions[joint] - turns[joint] * rest[joint];
        let shift_slope = |joint: usize| {
            let slopes = position_slopes[joint].iter().zip(&self.directions);
            slopes.map(|(slope, direction)| *slope - turns[joint] * direction[joint]).collect()
        };
        let (features, feature_slopes) =
            pose.rotations.iter().enumerate().map(|(joint, r)| self.features(joint, r)).unzip();
        PosedChain {
            shifts: (0..joints).map(shift).collect(),
            shift_slopes: (0..joints).map(shift_slope).collect(),
            turns,
            positions,
            coefficients,
            translation: pose.translation,
            position_slopes,
            features,
            feature_slopes,
        }
    }

    /// What drives the correctives of a joint, and its derivative by a turn: d(R exp(hat(d))) = R hat(d), d(q exp(d / 2)) = q (d, 0) / 2.
    fn features(&self, joint: usize, rotation: &DMat3) -> (Vec<f64>, Vec<[f64; 3]>) {
        let (_, first) = self.drive.features();
        if joint < first {
            return (Vec::new(), Vec::new());
        }
        match self.drive {
            Drive::Nothing => (Vec::new(), Vec::new()),
            Drive::RotationEntries => {
                let row_major = |matrix: DMat3| matrix.transpose().to_cols_array();
                let slopes = DVec3::AXES.map(|axis| row_major(*rotation * so3::hat(axis)));
                let entries = row_major(*rotation - DMat3::IDENTITY).to_vec();
                (entries, (0..9).map(|entry| [0, 1, 2].map(|axis| slopes[axis][entry])).collect())
            }
            Drive::Quaternions { .. } => {
                let quaternion = so3::quaternion(rotation);
                let [x, y, z, w] = quaternion.to_array();
                let slopes = DVec3::AXES.map(|axis| {
                    let turned = quaternion.xyz().cross(axis) + axis * w;
                    [turned.x / 2.0, turned.y / 2.0, turned.z / 2.0, -quaternion.xyz().dot(axis) / 2.0]
                });
                (vec![x, y, z, w - 1.0], (0..4).map(|entry| [0, 1, 2].map(|axis| slopes[axis][entry])).collect())
            }
        }
    }
}

/// What derivatives are by, in one frame.
#[derive(Clone, Copy)]
pub struct Basis<'a> {
    /// The skeleton.
    pub linkage: &'a Linkage,
    /// Its pose in the frame.
    pub chain: &'a PosedChain,
    /// What is solved for.
    pub unknowns: &'a Unknowns,
}

impl Basis<'_> {
    /// Makes `row` the derivative of n . joint by the unknowns.
    pub fn joint_row(self, joint: usize, n: DVec3, row: &mut Row) {
        let Self { linkage, chain, unknowns } = self;
        row.clear();
        let mut above = linkage.parents[joint];
        while let Some(k) = above {
            let turned = chain.turns[k].transpose() * (chain.positions[joint] - chain.positions[k]).cross(n);
            let first = linkage.extents.turn(k);
            turned.to_array().iter().enumerate().for_each(|(axis, value)| row.push(unknowns, first + axis, *value));
            above = linkage.parents[k];
        }
        let translation = linkage.extents.translation().zip(n.to_array());
        translation.for_each(|(column, value)| row.push(unknowns, column, value));
        for (index, slope) in chain.position_slopes[joint].iter().enumerate() {
            row.push(unknowns, linkage.extents.coefficient(index), n.dot(*slope));
        }
    }

    /// Makes `row` the derivative of n . v by turns and translation, of a point v = sum_j w_j (B_j x) that bones move and no corrective
    /// does. `pulls` (J) are w_j B_j x, without translation, and w_j; the sums over each joint's subtree take their place.
    pub fn skinned_row(self, pulls: &mut [(DVec3, f64)], n: DVec3, row: &mut Row) {
        let Self { linkage, chain, .. } = self;
        row.clear();
        for (joint, parent) in linkage.parents.iter().enumerate().rev() {
            let (moment, mass) = pulls[joint];
            if let Some(parent) = *parent {
                pulls[parent].0 += moment;
                pulls[parent].1 += mass;
            }
        }
        for (joint, (moment, mass)) in pulls.iter().enumerate() {
            let lever = *moment - chain.positions[joint] * *mass;
            let turned = chain.turns[joint].transpose() * lever.cross(n);
            let first = linkage.extents.turn(joint);
            turned
                .to_array()
                .iter()
                .enumerate()
                .for_each(|(axis, value)| row.push(self.unknowns, first + axis, *value));
        }
        linkage
            .extents
            .translation()
            .zip(n.to_array())
            .for_each(|(column, value)| row.push(self.unknowns, column, value));
    }
}

impl PosedChain {
    /// Where a joint is, with the translation.
    pub fn joint(&self, joint: usize) -> DVec3 {
        self.positions[joint] + self.translation
    }
}
