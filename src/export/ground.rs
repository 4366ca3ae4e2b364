//! A figure on the floor: y = 0 at the lowest place of its surface.
//!
//! A body model's origin is near its chest or pelvis, so that a motion without a world of its own plays with its feet more than a metre under
//! zero. A motion is moved as a whole, by one distance for all frames: what jumps still jumps. T frames; metres.

use glam::{Affine3A, Vec3};

use super::reference::{Reference, in_motion};
use super::rig::RiggedMesh;
use crate::Result;
use crate::avatar::Avatar;
use crate::body::{BodyModel, Pose};
use crate::mesh::TriangleMesh;

/// Cells along the longest side of the surface that is looked for the lowest place: it is found to about a millimetre.
const RESOLUTION: usize = 128;

/// Moves `frames` (T) up or down, all alike, so that the avatar's surface is at its lowest on the floor. How far.
///
/// # Errors
/// As [`Rigging::rig`](super::Rigging::rig).
pub fn ground_motion(avatar: &Avatar, body: Option<&BodyModel>, frames: &mut [Pose]) -> Result<f32> {
    let reference = Reference::new(avatar, body, RESOLUTION)?;
    let mut floor = f32::INFINITY;
    for (index, pose) in frames.iter().enumerate() {
        let frame = reference.frame(pose).map_err(|error| in_motion(error, index))?;
        floor = floor.min(lowest(&frame.posed));
    }
    let lift = if floor.is_finite() { -floor } else { 0.0 };
    frames.iter_mut().for_each(|pose| pose.translation.y += lift);
    Ok(lift)
}

/// Moves a mesh so that it stands on the floor.
pub fn ground_mesh(mesh: &mut TriangleMesh) {
    let lift = lift(mesh);
    mesh.vertices.iter_mut().for_each(|vertex| *vertex += lift);
}

impl RiggedMesh {
    /// Moves the bind pose so that it stands on the floor. The clip stays where it is.
    pub fn ground_bind_pose(&mut self) {
        let lift = lift(&self.mesh);
        self.mesh.vertices.iter_mut().for_each(|vertex| *vertex += lift);
        for joint in &mut self.joints {
            joint.inverse_bind *= Affine3A::from_translation(-lift);
            if joint.parent.is_none() {
                joint.translation += lift;
            }
        }
    }
}

fn lift(mesh: &TriangleMesh) -> Vec3 {
    if mesh.vertices.is_empty() { Vec3::ZERO } else { -lowest(&mesh.vertices) * Vec3::Y }
}

fn lowest(vertices: &[Vec3]) -> f32 {
    vertices.iter().map(|vertex| vertex.y).fold(f32::INFINITY, f32::min)
}
