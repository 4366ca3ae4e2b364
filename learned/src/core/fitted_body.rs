//! A body whose pose is fitted: its vertices with their derivatives, and a sample of them that says as much of every joint.

use std::collections::BTreeSet;

use glam::DVec3;
use xavatar_body::BodyModel;
use xavatar_register::linear::{BodyPoints, FramePose, Linkage, PosedChain, PosedPoints};

/// Vertices of the sample that follow each joint.
const OF_JOINT: usize = 48;
/// Such a weight, and they follow it.
const FOLLOWS: f64 = 0.3;

/// A body to be fitted. V vertices.
#[derive(Clone, Debug)]
pub struct FittedBody {
    /// Its skeleton.
    pub linkage: Linkage,
    /// All vertices (V).
    pub points: BodyPoints,
    /// Numbers of those that are fitted, ascending.
    pub sample: Vec<usize>,
    /// Those that are fitted.
    pub sampled: BodyPoints,
    /// The template (V), with the joints that each vertex follows.
    pub template: Vec<DVec3>,
    /// Weights that are not zero (V).
    pub weights: Vec<Vec<(usize, f64)>>,
}

impl FittedBody {
    /// A body, of which some vertices of each joint are fitted.
    pub fn of(model: &BodyModel) -> Self {
        let joints = model.skeleton().joints.len();
        let row = |row: &[f32]| {
            let entries = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            entries.map(|(joint, weight)| (joint, f64::from(*weight))).collect()
        };
        let weights: Vec<Vec<(usize, f64)>> = model.skinning_weights().chunks_exact(joints).map(row).collect();
        let linkage = Linkage::of(model);
        let points = BodyPoints::of(model, &linkage, &(0..model.vertex_count()).collect::<Vec<usize>>());
        let sample = sample(&weights, joints);
        let sampled = points.chosen(&sample);
        let template = model.template().iter().map(|vertex| vertex.as_dvec3()).collect();
        Self { linkage, points, sample, sampled, template, weights }
    }

    /// All vertices in a pose, with the chain that moved them.
    pub fn posed(&self, pose: &FramePose, shape: &[f64]) -> (PosedPoints, PosedChain) {
        let chain = self.linkage.posed(pose, shape);
        (self.points.posed(&self.linkage, &chain), chain)
    }
}

/// Of the vertices that follow each joint evenly many, in the order of their numbers.
fn sample(weights: &[Vec<(usize, f64)>], joints: usize) -> Vec<usize> {
    let mut chosen = BTreeSet::new();
    for joint in 0..joints {
        let follows = |row: &Vec<(usize, f64)>| row.iter().any(|(of, weight)| *of == joint && *weight > FOLLOWS);
        let following: Vec<usize> = (0..weights.len()).filter(|vertex| follows(&weights[*vertex])).collect();
        chosen.extend(following.iter().step_by(following.len().div_ceil(OF_JOINT).max(1)));
    }
    chosen.into_iter().collect()
}
