//! A BLSM body, and its vertices in a pose.

use glam::{DMat3, DVec3};

use super::{Atoms, PosedSkeleton, ScaledSkeleton};
use crate::core::WeightRow;

/// A body whose bones and flesh are apart.
#[derive(Clone, Debug, PartialEq)]
pub struct BlsmBody {
    /// The joints' names (J).
    pub names: Vec<String>,
    /// The skeleton.
    pub skeleton: ScaledSkeleton,
    /// What moves it.
    pub atoms: Atoms,
    /// The flesh at rest (V).
    pub template: Vec<DVec3>,
    /// Corners of faces.
    pub faces: Vec<[u32; 3]>,
    /// Skinning weights that are not zero (V).
    pub weights: Vec<WeightRow>,
    /// Mean scales of bones (J); the root's is 1.
    pub bone_mean: Vec<f64>,
    /// Modes of them (K, J), of unit variance; the root's are 0.
    pub bone_basis: Vec<Vec<f64>>,
    /// What flesh does with each mode (K, V); an empty one does nothing.
    pub bone_correctives: Vec<Vec<DVec3>>,
    /// Shapes of the flesh (S, V), of unit variance.
    pub shape_basis: Vec<Vec<DVec3>>,
}

/// What a body is posed by.
#[derive(Clone, Debug, PartialEq)]
pub struct BlsmParameters {
    /// The root's rotation, which is free.
    pub turn: DMat3,
    /// Of the root, metres.
    pub translation: DVec3,
    /// The atoms' coordinates x (A).
    pub atoms: Vec<f64>,
    /// c_b (K).
    pub bones: Vec<f64>,
    /// c_s (S).
    pub shape: Vec<f64>,
}

/// A body in a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedBlsm {
    /// (V).
    pub vertices: Vec<DVec3>,
    /// The flesh at rest, with its shape (V).
    pub shaped: Vec<DVec3>,
    /// Scales of bones (J).
    pub scales: Vec<f64>,
    /// The atoms' axes in the world (A).
    pub axes: Vec<DVec3>,
    /// The skeleton; its places are the joints.
    pub skeleton: PosedSkeleton,
}

impl BlsmBody {
    /// At rest: the middle of every atom is not rest, so angles of 0.
    pub fn rest(&self) -> BlsmParameters {
        BlsmParameters {
            turn: DMat3::IDENTITY,
            translation: DVec3::ZERO,
            atoms: self.atoms.list.iter().map(|atom| atom.coordinate(0.0)).collect(),
            bones: vec![0.0; self.bone_basis.len()],
            shape: vec![0.0; self.shape_basis.len()],
        }
    }

    /// The scales of bones (J) of coefficients (K).
    pub fn scales(&self, bones: &[f64]) -> Vec<f64> {
        let mut scales = self.bone_mean.clone();
        for (mode, coefficient) in self.bone_basis.iter().zip(bones) {
            scales.iter_mut().zip(mode).for_each(|(scale, entry)| *scale += entry * coefficient);
        }
        scales
    }

    /// The flesh at rest (V).
    pub fn shaped(&self, parameters: &BlsmParameters) -> Vec<DVec3> {
        let mut shaped = self.template.clone();
        let of_bones = self.bone_correctives.iter().zip(&parameters.bones);
        for (direction, coefficient) in of_bones.chain(self.shape_basis.iter().zip(&parameters.shape)) {
            shaped.iter_mut().zip(direction).for_each(|(place, offset)| *place += *offset * *coefficient);
        }
        shaped
    }

    /// The body in a pose.
    pub fn posed(&self, parameters: &BlsmParameters) -> PosedBlsm {
        let angles = self.atoms.angles(&parameters.atoms);
        let mut rotations = self.atoms.rotations(&angles);
        if let Some(root) = rotations.first_mut() {
            *root = parameters.turn * *root;
        }
        let scales = self.scales(&parameters.bones);
        let skeleton = self.skeleton.posed(&scales, &rotations, parameters.translation);
        let shaped = self.shaped(parameters);
        let place = |(row, place): (&WeightRow, &DVec3)| {
            row.iter().map(|(joint, weight)| skeleton.moved(*joint, *place) * *weight).sum()
        };
        let vertices = self.weights.iter().zip(&shaped).map(place).collect();
        let above =
            |joint: usize| self.skeleton.parents[joint].map_or(parameters.turn, |parent| skeleton.turns[parent]);
        let axes = self.atoms.axes(&angles);
        let axes = self.atoms.list.iter().zip(axes).map(|(atom, axis)| above(atom.joint) * axis).collect();
        PosedBlsm { vertices, shaped, scales, axes, skeleton }
    }

    /// The body with some of its vertices alone.
    pub fn chosen(&self, vertices: &[usize]) -> Self {
        let chosen = |points: &Vec<DVec3>| vertices.iter().filter_map(|vertex| points.get(*vertex)).copied().collect();
        Self {
            template: chosen(&self.template),
            faces: Vec::new(),
            weights: vertices.iter().map(|vertex| self.weights[*vertex].clone()).collect(),
            bone_correctives: self.bone_correctives.iter().map(chosen).collect(),
            shape_basis: self.shape_basis.iter().map(chosen).collect(),
            names: self.names.clone(),
            skeleton: self.skeleton.clone(),
            atoms: self.atoms.clone(),
            bone_mean: self.bone_mean.clone(),
            bone_basis: self.bone_basis.clone(),
        }
    }
}
