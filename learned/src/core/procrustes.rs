//! A first pose of a registration: each joint turned as the vertices that follow it are, from the root down (weighted Kabsch).
//!
//! G_j = argmin sum w |G (T_v - T) - (r_v - r)|^2 over the vertices with w_vj > 1/2, T and r their means; R_j = G_parent^T G_j. A joint that
//! too few vertices follow turns with its parent. Metres.

use glam::{DMat3, DVec3};
use xavatar_register::linear::{FramePose, rotation_between};

use super::FittedBody;

/// Vertices with such a weight follow a joint.
const FOLLOWS: f64 = 0.5;
/// So many say how it is turned.
const FEWEST: usize = 6;

/// The pose that brings a body with this template near a registration (V).
pub fn first_pose(body: &FittedBody, template: &[DVec3], registration: &[DVec3]) -> FramePose {
    let parents = body.linkage.parents();
    let mut turns: Vec<DMat3> = Vec::with_capacity(parents.len());
    let mut pose = FramePose::turned(body.linkage.extents(), []);
    for (joint, parent) in parents.iter().enumerate() {
        let above = parent.map_or(DMat3::IDENTITY, |parent| turns[parent]);
        let follows = |row: &Vec<(usize, f64)>| row.iter().any(|(of, weight)| *of == joint && *weight > FOLLOWS);
        let mut vertices: Vec<usize> = (0..template.len()).filter(|vertex| follows(&body.weights[*vertex])).collect();
        if parent.is_none() && vertices.len() < FEWEST {
            vertices = (0..template.len()).collect();
        }
        let moved = vertices.iter().map(|vertex| (template[*vertex], registration[*vertex], 1.0));
        let own = if vertices.len() < FEWEST { None } else { rotation_between(&moved.collect::<Vec<_>>()) };
        let turned = own.unwrap_or(above);
        if parent.is_none() {
            let mean = |of: &[DVec3]| vertices.iter().map(|vertex| of[*vertex]).sum::<DVec3>() / vertices.len() as f64;
            let root = body.linkage.rest()[joint];
            pose.translation = mean(registration) - turned * (mean(template) - root) - root;
        }
        pose.rotations[joint] = above.transpose() * turned;
        turns.push(turned);
    }
    pose
}
