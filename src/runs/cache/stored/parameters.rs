//! A frame's body as arrays: its pose, resolved on the run's body model.

use super::{Stored, rows};
use crate::body::{Pose, PoseAxisAngle};
use crate::formats::{Array, ArrayMap, Result};

pub(super) fn insert(arrays: &mut ArrayMap, pose: &Pose) {
    let numbers = |values: &[f32]| Array::from_f32(&[values.len()], values.to_vec());
    arrays.extend([
        ("rotations".to_owned(), rows(pose.rotations.iter().map(|rotation| rotation.0))),
        ("shape".to_owned(), numbers(&pose.shape)),
        ("expression".to_owned(), numbers(&pose.expression)),
        ("translation".to_owned(), rows([pose.translation])),
    ]);
}

pub(super) fn of(stored: &Stored) -> Result<Pose> {
    let translation = stored.points("translation")?;
    Ok(Pose {
        rotations: stored.points("rotations")?.into_iter().map(PoseAxisAngle).collect(),
        shape: stored.floats("shape")?,
        expression: stored.floats("expression")?,
        translation: *translation.first().ok_or_else(|| stored.broken("translation"))?,
    })
}
