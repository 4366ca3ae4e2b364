//! Between bodies as files have them and what training works on: identities, rows of weights.

use glam::DVec3;
use xavatar_body::{Anatomy, BodyModel, Correctives};
use xavatar_formats::Result;

use super::Identity;

impl Identity {
    /// The mean shape of a body.
    pub fn of(model: &BodyModel) -> Self {
        Self {
            template: model.template().iter().map(|vertex| vertex.as_dvec3()).collect(),
            joints: model.anatomy().joints.template.clone(),
        }
    }
}

/// The mean shape and its joints with these coefficients.
pub fn shaped(model: &BodyModel, shape: &[f64]) -> Identity {
    let mut identity = Identity::of(model);
    let anatomy = model.anatomy();
    for ((direction, joints), coefficient) in anatomy.shapes.directions().zip(&anatomy.joints.directions).zip(shape) {
        for (place, offset) in identity.template.iter_mut().zip(direction.as_chunks::<3>().0) {
            *place += glam::Vec3::from_array(*offset).as_dvec3() * *coefficient;
        }
        identity.joints.iter_mut().zip(joints).for_each(|(place, offset)| *place += *offset * *coefficient);
    }
    identity
}

/// The mean of subjects.
pub fn mean_identity<'a>(subjects: impl Iterator<Item = &'a Identity>) -> Identity {
    let subjects: Vec<&Identity> = subjects.collect();
    let mean = |points: &dyn Fn(&Identity) -> &Vec<DVec3>| -> Vec<DVec3> {
        let count = subjects.first().map_or(0, |subject| points(subject).len());
        let at = |index: usize| subjects.iter().map(|subject| points(subject)[index]).sum::<DVec3>();
        (0..count).map(|index| at(index) / subjects.len() as f64).collect()
    };
    Identity { template: mean(&|identity| &identity.template), joints: mean(&|identity| &identity.joints) }
}

/// A body's weights that are not zero (V).
pub fn weight_rows(model: &BodyModel) -> Vec<Vec<(usize, f64)>> {
    let row = |row: &[f32]| {
        let entries = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        entries.map(|(joint, weight)| (joint, f64::from(*weight))).collect()
    };
    model.skinning_weights().chunks_exact(model.skeleton().joints.len()).map(row).collect()
}

/// A body with these weights (V) and correctives.
pub fn with_skin(model: &BodyModel, weights: &[Vec<(usize, f64)>], correctives: Correctives) -> Result<BodyModel> {
    let joints = model.skeleton().joints.len();
    let mut skin = vec![0.0; weights.len() * joints];
    for (row, weights) in skin.chunks_exact_mut(joints).zip(weights) {
        weights.iter().for_each(|(joint, weight)| row[*joint] = *weight as f32);
    }
    let anatomy = Anatomy { skinning_weights: skin, correctives, ..model.anatomy().clone() };
    BodyModel::assemble(model.path(), anatomy)
}
