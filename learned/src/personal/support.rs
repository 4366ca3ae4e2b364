//! Which joints may correct which vertex: those that do in the body, or that it follows (METHOD-BODY 6).
//!
//! Where neither is so nothing is learned: a scan with bent elbows says nothing of the knees. Vertices with the same joints share their covariance.

use std::collections::BTreeMap;

use xavatar_body::{BodyModel, Correctives};

/// A block of the body's that moves a vertex by less is none, metres for a feature of one.
const NEGLIGIBLE: f32 = 5e-5;

/// Vertices by the joints that may correct them.
#[derive(Clone, Debug)]
pub struct Support {
    /// Features of a joint: nine entries of a rotation, or four of a quaternion.
    pub per_joint: usize,
    /// Joints less one, and the vertices that they may correct.
    pub patterns: Vec<(Vec<usize>, Vec<usize>)>,
}

impl Support {
    /// Of a body with J joints; one without correctives is to have those of rotations' entries.
    pub fn of(model: &BodyModel) -> Self {
        let joints = model.skeleton().joints.len();
        let (per_joint, directions): (usize, Vec<&[f32]>) = match model.correctives() {
            Correctives::None => (9, Vec::new()),
            Correctives::RotationEntries(shapes) => (9, shapes.directions().collect()),
            Correctives::Quaternions { first_joint, shapes, .. } => {
                (4, shapes.directions().skip(4 * (1 - first_joint)).take(4 * (joints - 1)).collect())
            }
        };
        let corrects = |group: usize, vertex: usize| {
            let rows = directions.iter().skip(per_joint * group).take(per_joint);
            let mut offsets = rows.filter_map(|row| row.get(3 * vertex..3 * vertex + 3));
            offsets.any(|offset| glam::Vec3::from_slice(offset).length() > NEGLIGIBLE)
        };
        let mut patterns: BTreeMap<Vec<usize>, Vec<usize>> = BTreeMap::new();
        for (vertex, weights) in model.skinning_weights().chunks_exact(joints).enumerate() {
            let may = |group: &usize| weights[group + 1] > 0.0 || corrects(*group, vertex);
            patterns.entry((0..joints - 1).filter(may).collect()).or_default().push(vertex);
        }
        Self { per_joint, patterns: patterns.into_iter().collect() }
    }

    /// The features of a pattern's joints, of all (F).
    pub fn features(&self, joints: &[usize], all: &[f64]) -> Vec<f64> {
        joints
            .iter()
            .flat_map(|group| all[self.per_joint * group..self.per_joint * (group + 1)].iter().copied())
            .collect()
    }
}
