//! One frame's pose while it is fitted: rotations as matrices, so that no angle is special.

use glam::{DMat3, DVec3};
use xavatar_body::{Pose, PoseAxisAngle};

use super::columns::Extents;
use super::so3;

/// Steps turn no joint by more, radians.
const LARGEST_TURN: f64 = 0.5;

/// Rotations, place and expression of one frame; the shape is the subject's.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePose {
    /// Of each joint relative to its parent (J).
    pub rotations: Vec<DMat3>,
    /// Metres.
    pub translation: DVec3,
    /// psi (E).
    pub expression: Vec<f64>,
}

impl FramePose {
    /// At rest, but for some joints.
    pub fn turned(extents: Extents, turns: impl IntoIterator<Item = (usize, DVec3)>) -> Self {
        let mut rotations = vec![DMat3::IDENTITY; extents.joints];
        turns.into_iter().for_each(|(joint, turn)| rotations[joint] = so3::exp(turn));
        Self { rotations, translation: DVec3::ZERO, expression: vec![0.0; extents.expressions] }
    }

    /// The same of a body's pose; what it leaves out is at rest.
    pub fn of(pose: &Pose, extents: Extents) -> Self {
        let turns = pose.rotations.iter().enumerate().map(|(joint, turn)| (joint, turn.0.as_dvec3()));
        let mut frame = Self::turned(extents, turns);
        frame.expression.iter_mut().zip(&pose.expression).for_each(|(own, given)| *own = f64::from(*given));
        Self { translation: pose.translation.as_dvec3(), ..frame }
    }

    /// The pose of a body of a shape.
    pub fn pose(&self, shape: &[f64]) -> Pose {
        let single = |values: &[f64]| values.iter().map(|value| *value as f32).collect();
        Pose {
            rotations: self.rotations.iter().map(|rotation| PoseAxisAngle(so3::log(rotation).as_vec3())).collect(),
            shape: single(shape),
            expression: single(&self.expression),
            translation: self.translation.as_vec3(),
        }
    }

    /// Moved by a step in all columns, shortened where it would turn a joint too far.
    #[must_use]
    pub fn moved(&self, extents: Extents, step: &[f64]) -> Self {
        let turns = &step[..3 * extents.joints];
        let largest = turns.iter().fold(0.0_f64, |largest, turn| largest.max(turn.abs()));
        let share = if largest > LARGEST_TURN { LARGEST_TURN / largest } else { 1.0 };
        let turned = |(rotation, turn): (&DMat3, &[f64])| *rotation * so3::exp(DVec3::from_slice(turn) * share);
        let expression = self.expression.iter().zip(&step[extents.expression()]);
        Self {
            rotations: self.rotations.iter().zip(turns.chunks_exact(3)).map(turned).collect(),
            translation: self.translation + DVec3::from_slice(&step[extents.translation()]) * share,
            expression: expression.map(|(value, step)| value + step * share).collect(),
        }
    }

    /// On the way to another, `share` (0..1) of it: joints along their arcs.
    #[must_use]
    pub fn between(&self, other: &Self, share: f64) -> Self {
        let turned = |(one, other): (&DMat3, &DMat3)| *one * so3::exp(so3::log(&(one.transpose() * *other)) * share);
        let expression = self.expression.iter().zip(&other.expression);
        Self {
            rotations: self.rotations.iter().zip(&other.rotations).map(turned).collect(),
            translation: self.translation.lerp(other.translation, share),
            expression: expression.map(|(one, other)| one + (other - one) * share).collect(),
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.rotations.iter().all(|rotation| rotation.is_finite())
            && self.translation.is_finite()
            && self.expression.iter().all(|value| value.is_finite())
    }
}
