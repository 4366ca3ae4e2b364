//! Poses as callers have them, and as the library takes them.

use glam::Vec3;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyDictMethods};
use xavatar::body::{Pose, PoseAxisAngle, Skeleton};

use crate::arrays::{Numbers, array_of_rows, points};
use crate::errors::{Raise, refused};
use crate::python_classes;

/// The pose that was given: none is the pose at rest; a dictionary has rotations by the joints' names, anything with `rotations` is a
/// `Pose`, and all else is an array of rotations (J, 3).
pub fn pose_of(given: Option<&Bound<'_, PyAny>>, skeleton: &Skeleton) -> PyResult<Pose> {
    let Some(given) = given else { return Ok(skeleton.rest_pose()) };
    if let Ok(named) = given.cast::<PyDict>() {
        return pose_of_names(named, skeleton);
    }
    if !given.hasattr("rotations")? {
        return Ok(Pose { rotations: rotations(given, skeleton)?, ..Pose::default() });
    }
    let coefficients = |name: &str| Ok::<_, PyErr>(Numbers::<f32>::of(&given.getattr(name)?)?.values()?.to_vec());
    let translation = points("translation", &given.getattr("translation")?)?;
    let [translation] = translation[..] else {
        return Err(refused("translation", format!("{} rows", translation.len()), "three numbers"));
    };
    Ok(Pose {
        rotations: rotations(&given.getattr("rotations")?, skeleton)?,
        shape: coefficients("shape")?,
        expression: coefficients("expression")?,
        translation,
    })
}

fn pose_of_names(named: &Bound<'_, PyDict>, skeleton: &Skeleton) -> PyResult<Pose> {
    let turn = |(name, turn): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let turn = points("a joint's rotation", &turn)?.first().copied().unwrap_or(Vec3::NAN);
        Ok((name.extract::<String>()?, turn))
    };
    let turns = named.iter().map(turn).collect::<PyResult<Vec<_>>>()?;
    skeleton.turned(turns.iter().map(|(name, turn)| (name.as_str(), *turn))).or_raise()
}

fn rotations(given: &Bound<'_, PyAny>, skeleton: &Skeleton) -> PyResult<Vec<PoseAxisAngle>> {
    let rows = points("rotations", given)?;
    let (found, expected) = (rows.len(), skeleton.joints.len());
    if found != expected {
        let expected = format!("{expected}, for {}", skeleton.description());
        return Err(refused("the pose", format!("{found} rotations"), expected));
    }
    Ok(rows.into_iter().map(PoseAxisAngle).collect())
}

/// The pose as an `xavatar.Pose`.
pub fn python_pose<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyAny>> {
    let rotations = array_of_rows(py, pose.rotations.iter().map(|turn| turn.0.to_array()).collect())?;
    let (expression, shape) = (pose.expression.clone(), pose.shape.clone());
    python_classes::pose(py)?.call1((rotations, pose.translation.to_array(), expression, shape))
}
