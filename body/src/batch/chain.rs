//! The kinematic chain of one frame: where every joint is and how it is turned, and the way back.
//!
//! G_j = G_parent R_j and p_j = p_parent + G_parent (J_j - J_parent), from the root on, whose joint is where the body has it: the root's
//! rotation turns about it. Children come after their parents, so that one sweep up and one down are enough. J joints.

use glam::DVec3;
use xavatar_vector::Scalar;

use super::rotation::{
    Matrix3, dot, matrix_product, product_transposed, quaternion, quaternion_pullback, rotation_matrix,
    rotation_pullback, transposed_product, turned, turned_back,
};
use super::{PoseBatch, add};
use crate::{BodyModel, Correctives, JointBasis};

/// One frame's joints.
#[derive(Clone, Debug)]
pub(super) struct Chain<T> {
    /// R_j, relative to the parent (J).
    pub rotations: Vec<Matrix3<T>>,
    /// G_j (J).
    pub turns: Vec<Matrix3<T>>,
    /// p_j, without translation (J).
    positions: Vec<[T; 3]>,
    /// J_j, at rest (J).
    pub rest: Vec<[T; 3]>,
    /// f: what drives the pose correctives (F).
    pub features: Vec<T>,
}

/// G_j and A_j = p_j - G_j J_j of a joint, which move a vertex at rest; or their cotangents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bone<T> {
    pub turn: Matrix3<T>,
    pub shift: [T; 3],
}

impl<T: Scalar> Default for Bone<T> {
    fn default() -> Self {
        Self { turn: [T::zero(); 9], shift: [T::zero(); 3] }
    }
}

impl<T: Scalar> Chain<T> {
    /// The chains of a batch (B).
    pub fn of_batch(model: &BodyModel, batch: &PoseBatch<T>) -> Vec<Self> {
        let frame = |frame| Self::new(model, batch.frame_rotations(frame), batch.frame_coefficients(frame));
        (0..batch.frames()).map(frame).collect()
    }

    fn new(model: &BodyModel, axis_angles: &[[T; 3]], coefficients: &[T]) -> Self {
        let rotations: Vec<_> = axis_angles.iter().map(|r| rotation_matrix(*r)).collect();
        let features = features(&model.anatomy.correctives, axis_angles, &rotations, coefficients);
        Self::turned(model, rotations, features, coefficients)
    }

    /// The chain of joints turned by these matrices (J), which drive correctives by these features (F).
    pub fn turned(model: &BodyModel, rotations: Vec<Matrix3<T>>, features: Vec<T>, coefficients: &[T]) -> Self {
        let rest = rest_joints(model, coefficients);
        let mut turns = Vec::with_capacity(rotations.len());
        let mut positions: Vec<[T; 3]> = Vec::with_capacity(rotations.len());
        for (joint, parent) in model.skeleton().parents.iter().enumerate() {
            let (turn, position) = match parent {
                None => (rotations[joint], rest[joint]),
                Some(parent) => {
                    let bone = turned(&turns[*parent], difference(rest[joint], rest[*parent]));
                    (matrix_product(&turns[*parent], &rotations[joint]), sum(positions[*parent], bone))
                }
            };
            turns.push(turn);
            positions.push(position);
        }
        Self { rotations, turns, positions, rest, features }
    }

    /// The joints, moved by a translation.
    pub fn joints(&self, translation: [T; 3]) -> impl Iterator<Item = [T; 3]> {
        self.positions.iter().map(move |position| sum(*position, translation))
    }

    /// What moves the vertices that follow each joint (J).
    pub fn bones(&self) -> Vec<Bone<T>> {
        let joints = self.turns.iter().zip(&self.positions).zip(&self.rest);
        joints
            .map(|((turn, position), rest)| Bone { turn: *turn, shift: difference(*position, turned(turn, *rest)) })
            .collect()
    }

    /// The cotangents of the matrices by which the joints are turned (J) and of the joints at rest (J), given those of the frame's bones (J)
    /// and its joints (J).
    pub fn pullback(&self, model: &BodyModel, bones: &[Bone<T>], joints: &[[T; 3]]) -> (Vec<Matrix3<T>>, Vec<[T; 3]>) {
        let count = joints.len();
        let mut of_rest = vec![[T::zero(); 3]; count];
        let mut of_turns: Vec<Matrix3<T>> = Vec::with_capacity(count);
        let mut of_positions: Vec<[T; 3]> = Vec::with_capacity(count);
        for (joint, Bone { turn, shift }) in bones.iter().enumerate() {
            // A = p - G J
            let minus = shift.map(|component| -component);
            let mut of_turn = *turn;
            add(&mut of_turn, &outer(minus, self.rest[joint]));
            of_turns.push(of_turn);
            of_positions.push(sum(joints[joint], *shift));
            of_rest[joint] = turned_back(&self.turns[joint], minus);
        }
        let mut of_rotations = vec![[T::zero(); 9]; count];
        for (joint, parent) in model.skeleton().parents.iter().enumerate().rev() {
            let (of_turn, of_position) = (of_turns[joint], of_positions[joint]);
            let Some(parent) = *parent else {
                of_rotations[joint] = of_turn;
                add(&mut of_rest[joint], &of_position);
                continue;
            };
            of_rotations[joint] = transposed_product(&self.turns[parent], &of_turn);
            add(&mut of_turns[parent], &product_transposed(&of_turn, &self.rotations[joint]));
            add(&mut of_turns[parent], &outer(of_position, difference(self.rest[joint], self.rest[parent])));
            add(&mut of_positions[parent], &of_position);
            let of_bone = turned_back(&self.turns[parent], of_position);
            add(&mut of_rest[joint], &of_bone);
            add(&mut of_rest[parent], &of_bone.map(|component| -component));
        }
        (of_rotations, of_rest)
    }

    /// The cotangents of the frame's axis-angles (J), given those of their matrices (J) and of its features (F).
    pub fn axis_angle_pullback(
        &self,
        model: &BodyModel,
        axis_angles: &[[T; 3]],
        mut of_rotations: Vec<Matrix3<T>>,
        of_features: &[T],
    ) -> Vec<[T; 3]> {
        let mut of_axis_angles = vec![[T::zero(); 3]; axis_angles.len()];
        features_pullback(&model.anatomy.correctives, axis_angles, of_features, &mut of_rotations, &mut of_axis_angles);
        for (joint, sum) in of_axis_angles.iter_mut().enumerate() {
            add(sum, &rotation_pullback(axis_angles[joint], &self.rotations[joint], &of_rotations[joint]));
        }
        of_axis_angles
    }
}

/// The joints at rest (J) of coefficients (K).
fn rest_joints<T: Scalar>(model: &BodyModel, coefficients: &[T]) -> Vec<[T; 3]> {
    let JointBasis { template, directions } = &model.anatomy.joints;
    let of = |place: &DVec3| place.to_array().map(T::of);
    let mut joints: Vec<[T; 3]> = template.iter().map(of).collect();
    for (direction, coefficient) in directions.iter().zip(coefficients) {
        let moved = direction.iter().map(|place| of(place).map(|component| component * *coefficient));
        joints.iter_mut().zip(moved).for_each(|(joint, moved)| add(joint, &moved));
    }
    joints
}

/// The cotangents of coefficients (K), given those of the joints at rest (J).
pub(super) fn rest_joints_pullback<T: Scalar>(model: &BodyModel, joints: &[[T; 3]]) -> Vec<T> {
    let along = |direction: &Vec<DVec3>| {
        direction.iter().zip(joints).map(|(place, joint)| dot(place.to_array().map(T::of), *joint)).sum()
    };
    model.anatomy.joints.directions.iter().map(along).collect()
}

/// f of a pose, given its joints' axis-angles and matrices (J): what drives the correctives (F).
pub fn features<T: Scalar>(
    correctives: &Correctives,
    axis_angles: &[[T; 3]],
    rotations: &[Matrix3<T>],
    coefficients: &[T],
) -> Vec<T> {
    match correctives {
        Correctives::None => Vec::new(),
        Correctives::RotationEntries(_) => {
            let less_identity = |at: usize, entry: T| if at.is_multiple_of(4) { entry - T::one() } else { entry };
            let entries = rotations.iter().skip(1).flat_map(|rotation| rotation.iter().copied().enumerate());
            entries.map(|(at, entry)| less_identity(at, entry)).collect()
        }
        Correctives::Quaternions { first_joint, coefficient, .. } => {
            let less_identity = |[x, y, z, w]: [T; 4]| [x, y, z, w - T::one()];
            let of_joints = axis_angles.iter().skip(*first_joint).flat_map(|r| less_identity(quaternion(*r)));
            of_joints.chain(coefficient.map(|index| coefficients[index])).collect()
        }
    }
}

/// Adds the cotangents of f (F) to those of the rotations (J): of their matrices, or of their axis-angles.
fn features_pullback<T: Scalar>(
    correctives: &Correctives,
    axis_angles: &[[T; 3]],
    of_features: &[T],
    of_rotations: &mut [Matrix3<T>],
    of_axis_angles: &mut [[T; 3]],
) {
    match correctives {
        Correctives::None => {}
        Correctives::RotationEntries(_) => {
            let blocks = of_features.as_chunks::<9>().0;
            of_rotations.iter_mut().skip(1).zip(blocks).for_each(|(sum, block)| add(sum, block));
        }
        Correctives::Quaternions { first_joint, .. } => {
            let blocks = of_features.as_chunks::<4>().0;
            let joints = of_axis_angles.iter_mut().zip(axis_angles).skip(*first_joint);
            joints.zip(blocks).for_each(|((sum, r), block)| add(sum, &quaternion_pullback(*r, *block)));
        }
    }
}

fn sum<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [0, 1, 2].map(|axis| a[axis] + b[axis])
}

fn difference<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

/// a b^T.
pub(super) fn outer<T: Scalar>(a: [T; 3], b: [T; 3]) -> Matrix3<T> {
    std::array::from_fn(|at| a[at / 3] * b[at % 3])
}
