//! Feet of a body that stands: contact and what it does, found together.
//!
//! c_0 = contact(v), then B_k = B_F(f(c_k)), v_k = v + M B_k, c_{k+1} = contact(v_k), with M how each vertex is turned from rest. A round more than these moves
//! vertices by less than networks are wrong.

use glam::{DMat3, DVec3};
use xavatar_body::{BodyModel, Pose};
use xavatar_formats::Result;
use xavatar_register::linear::FramePose;

use super::Foot;
use super::ground::is_in_contact;
use crate::core::{FittedBody, shaped};
use crate::descent::{Parameters, of_tensors};

/// Rounds of contact and offsets.
const ROUNDS: usize = 2;

/// The feet of a body, with what the ground does to them.
#[derive(Debug)]
pub struct Feet {
    /// Left and right.
    pub feet: [Foot; 2],
    pub(super) parameters: Parameters,
}

/// A body in a pose, as its feet need it.
#[derive(Clone, Copy, Debug)]
pub struct Stance<'a> {
    /// The person's template (V).
    pub rest: &'a [DVec3],
    /// Turns of the joints beside their parents (J).
    pub rotations: &'a [DMat3],
    /// And in the world (J).
    pub turns: &'a [DMat3],
    /// Vertices, no ground pressing them (V).
    pub positions: &'a [DVec3],
    /// M: how each vertex is turned from rest (V).
    pub vertex_turns: &'a [DMat3],
}

impl Feet {
    /// The vertices of both, of the body.
    pub fn vertices(&self) -> impl Iterator<Item = usize> {
        self.feet.iter().flat_map(|foot| foot.vertices.iter().copied())
    }

    /// The height of the ground under a registration (V): what is known of it, or where the feet are flat.
    pub fn ground(&self, registration: &[DVec3], known: Option<f64>) -> f64 {
        Foot::ground(&self.feet, registration, known)
    }

    /// The vertices (V) of a body that stands on the ground at this height.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if the feet are not this body's.
    pub fn pressed(&self, stance: Stance<'_>, ground: f64) -> Result<Vec<DVec3>> {
        let mut positions = stance.positions.to_vec();
        for foot in &self.feet {
            for _ in 0..ROUNDS {
                let contact: Vec<bool> =
                    foot.vertices.iter().map(|vertex| is_in_contact(positions[*vertex], ground)).collect();
                let asked = foot.asked(stance.rotations, stance.turns, stance.rest, contact);
                let offsets = foot.offsets(&asked).map_err(of_tensors)?;
                for (vertex, offset) in foot.vertices.iter().zip(offsets) {
                    positions[*vertex] = stance.positions[*vertex] + stance.vertex_turns[*vertex] * offset;
                }
            }
        }
        Ok(positions)
    }

    /// The vertices (V) of a body of the feet's file in a pose, on the ground at this height.
    ///
    /// # Errors
    /// As [`pressed`](Self::pressed).
    pub fn posed(&self, model: &BodyModel, pose: &Pose, ground: f64) -> Result<Vec<DVec3>> {
        let body = FittedBody::of(model);
        let mut shape: Vec<f64> = pose.shape.iter().map(|coefficient| f64::from(*coefficient)).collect();
        shape.resize(body.linkage.extents().shapes, 0.0);
        let frame = FramePose::of(pose, body.linkage.extents());
        let (posed, chain) = body.posed(&frame, &shape);
        let rest = shaped(model, &shape).template;
        let stance = Stance {
            rest: &rest,
            rotations: &frame.rotations,
            turns: &chain.turns,
            positions: &posed.positions,
            vertex_turns: &posed.turns,
        };
        self.pressed(stance, ground)
    }
}
