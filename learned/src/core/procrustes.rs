//! A first pose of a registration: each joint turned as the vertices that follow it are, from the root down (weighted Kabsch).
//!
//! G_j = argmin sum w |G (T_v - T) - (r_v - r)|^2 over the vertices with w_vj > 1/2, T and r their means; R_j = G_parent^T G_j. A joint that
//! too few vertices follow turns with its parent. Metres.

use glam::{DMat3, DVec3};
use nalgebra::Matrix3;
use xavatar_register::linear::FramePose;

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
        let own = (vertices.len() >= FEWEST).then(|| turn(&vertices, template, registration));
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

/// The rotation that takes these vertices of one mesh nearest to those of the other, both about their means.
fn turn(vertices: &[usize], from: &[DVec3], to: &[DVec3]) -> DMat3 {
    let mean = |of: &[DVec3]| vertices.iter().map(|vertex| of[*vertex]).sum::<DVec3>() / vertices.len() as f64;
    let (centre, moved) = (mean(from), mean(to));
    let mut covariance = Matrix3::zeros();
    for vertex in vertices {
        let (a, b) = (to[*vertex] - moved, from[*vertex] - centre);
        covariance += nalgebra::Vector3::from(a.to_array()) * nalgebra::Vector3::from(b.to_array()).transpose();
    }
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return DMat3::IDENTITY };
    let handed = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, (u * v).determinant().signum()));
    // Singular values come in descending order: the last axis is the one that may flip.
    let rotation = u * handed * v;
    DMat3::from_cols_slice(rotation.as_slice())
}
