//! The joint regressor of the imported body: fitted, as every one here, on the vertices near each joint.

use glam::DVec3;

use super::{COUNT, Direction, Directions};
use crate::joint_regressor::{JointFit, Motion};
use crate::smplx;

/// Vertices that an expression moves further are no support of a joint, metres.
const QUIET: f64 = 4e-3;

/// The regressor (55, V), and how far the farthest regressed joint is from its place, metres.
pub(super) fn fitted(
    template: &[DVec3],
    weights: &[Vec<f64>],
    joints: &[DVec3],
    directions: &Directions,
) -> (Vec<Vec<f64>>, f64) {
    let eyes = [smplx::joint::LEFT_EYE, smplx::joint::RIGHT_EYE];
    let moves =
        |vertex: usize| directions.expressions.iter().any(|action| action.offsets[vertex].abs().max_element() > QUIET);
    let is_quiet: Vec<bool> = (0..template.len()).map(|vertex| !moves(vertex)).collect();
    let motion = |direction: &Direction, joint: usize| (direction.joints[joint], 1.0);
    let fit = |joint: usize| {
        let is_eye = eyes.contains(&joint);
        let near = |vertex: &usize| match is_eye {
            // An eyeball's centre is its own affair.
            true => weights[*vertex][joint] > 0.05,
            false => is_quiet[*vertex] && relevance(&weights[*vertex], joint) > 0.05,
        };
        let candidates: Vec<usize> = (0..template.len()).filter(near).collect();
        let motions = directions.all().map(|direction| {
            let (joint, weight) = motion(direction, joint);
            Motion { offsets: &direction.offsets, joint, weight }
        });
        JointFit { template, joint: joints[joint], candidates, motions: motions.collect() }.row()
    };
    let rows: Vec<Vec<f64>> = (0..COUNT).map(fit).collect();
    let error =
        applied(&rows, template).iter().zip(joints).map(|(found, joint)| found.distance(*joint)).fold(0.0, f64::max);
    (rows, error)
}

/// The joints of vertices.
pub(super) fn applied(regressor: &[Vec<f64>], vertices: &[DVec3]) -> Vec<DVec3> {
    regressor.iter().map(|row| row.iter().zip(vertices).map(|(weight, vertex)| *vertex * *weight).sum()).collect()
}

/// How much a vertex follows a joint or those beside it.
fn relevance(weights: &[f64], joint: usize) -> f64 {
    let parents = &smplx::skeleton().parents;
    let above = parents[joint].map_or(0.0, |parent| weights[parent]);
    let below: f64 =
        (0..parents.len()).filter(|child| parents[*child] == Some(joint)).map(|child| weights[child]).sum();
    weights[joint] + above + 0.5 * below
}
