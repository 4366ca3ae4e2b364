//! Blend-shape directions of the mannequin: what shape, expression and pose do to each vertex, per unit of coefficient.
//!
//! The recipe describes the left side; a vertex on the right gets the mirror image of what its twin would get.

use glam::Vec3;

use super::recipe::{Bulge, Move, Pull, joint_index, joint_set, twin};
use crate::formats::Result;

/// A vertex seen on the left side: its position, normal, and skinning weights with left and right exchanged if it was
/// on the right.
pub(super) struct LeftView {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) weights: Vec<f32>,
    mirrored: bool,
}

impl LeftView {
    pub(super) fn of(position: Vec3, normal: Vec3, weights: &[f32]) -> Self {
        if position.x >= 0.0 {
            return Self { position, normal, weights: weights.to_vec(), mirrored: false };
        }
        let weights = (0..weights.len()).map(|joint| weights[twin(joint)]).collect();
        Self { position: flip(position), normal: flip(normal), weights, mirrored: true }
    }

    /// A displacement of the view as one of the vertex.
    fn place(&self, displacement: Vec3) -> Vec3 {
        if self.mirrored { flip(displacement) } else { displacement }
    }
}

fn flip(vector: Vec3) -> Vec3 {
    Vec3::new(-vector.x, vector.y, vector.z)
}

/// A direction of body shape (V).
pub(super) fn shape_direction(moves: &[Move], vertices: &[LeftView]) -> Result<Vec<Vec3>> {
    let mut direction = vec![Vec3::ZERO; vertices.len()];
    for step in moves {
        let joints = joint_set(&step.joints)?;
        let (shift, stretch, about) = (Vec3::from(step.shift), Vec3::from(step.stretch), Vec3::from(step.about));
        for (displacement, view) in direction.iter_mut().zip(vertices) {
            let held: f32 =
                view.weights.iter().zip(&joints).filter(|(_, named)| **named).map(|(weight, _)| weight).sum();
            let whole = shift + stretch * (view.position - about) + view.normal * step.inflate;
            *displacement += view.place(whole * held);
        }
    }
    Ok(direction)
}

/// A direction of expression (V); what the joints of the eyes move stays in place.
pub(super) fn expression_direction(pulls: &[Pull], eyes: [usize; 2], vertices: &[LeftView]) -> Vec<Vec3> {
    let displacement = |view: &LeftView| {
        let eyeball = view.weights[eyes[0]] + view.weights[eyes[1]];
        let pulled =
            |pull: &Pull| Vec3::from(pull.shift) * falloff(view.position.distance(pull.at.into()), pull.radius);
        view.place(pulls.iter().map(pulled).sum::<Vec3>() * (1.0 - eyeball))
    };
    vertices.iter().map(displacement).collect()
}

/// What one pose feature, the diagonal entries of a joint's R - I, does (V); `None` where it moves nothing.
///
/// A turn by t has diagonal entries that sum to -2 (1 - cos t), whatever its axis.
pub(super) fn bulge_direction(
    bulge: &Bulge,
    places: &[Vec3],
    vertices: &[LeftView],
) -> Result<[(usize, Vec<Vec3>); 2]> {
    let joint = joint_index(&bulge.joint)?;
    Ok([joint, twin(joint)].map(|joint| {
        let displacement = |view: &LeftView| {
            let position = if view.mirrored { flip(view.position) } else { view.position };
            view.place(view.normal) * (-0.5 * bulge.amount * falloff(position.distance(places[joint]), bulge.radius))
        };
        (joint, vertices.iter().map(displacement).collect())
    }))
}

/// exp(-(distance / radius)^2), cut to zero where it no longer matters.
fn falloff(distance: f32, radius: f32) -> f32 {
    let ratio = distance / radius;
    if ratio > 3.0 { 0.0 } else { (-ratio * ratio).exp() }
}
