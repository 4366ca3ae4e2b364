//! One row of a joint regressor: non-negative weights of vertices, summing to 1, whose mean is the joint and follows it.
//!
//! minimise |6 (sum_v x_v T_v - J)|^2 + sum_k |c_k (sum_v x_v D_kv - d_k)|^2 + |sum_v x_v - 1|^2 over x >= 0 on the vertices nearest to the joint, with
//! the template T, directions D_k of vertices and what they do to the joint, d_k; metres.

use glam::DVec3;

use super::least_squares::non_negative;

/// How many of the candidates are tried.
const TRIED: usize = 350;
/// They are spread over the nearest so many of all vertices, so that they surround the joint on any mesh.
const NEAREST_SHARE: usize = 38;
/// How much more the joint at rest counts than how it moves.
const AT_REST: f64 = 6.0;
/// Smaller weights are none.
const NEGLIGIBLE: f64 = 1e-4;

/// A direction of the body and what it does to the joint.
pub struct Motion<'a> {
    /// What a unit moves the vertices by (V).
    pub offsets: &'a [DVec3],
    /// What it moves the joint by.
    pub joint: DVec3,
    /// How much it counts.
    pub weight: f64,
}

/// A joint and what its row may use.
pub struct JointFit<'a> {
    /// (V).
    pub template: &'a [DVec3],
    /// Where the joint is at rest.
    pub joint: DVec3,
    /// Vertices that follow it; all are tried if there are none.
    pub candidates: Vec<usize>,
    /// Directions.
    pub motions: Vec<Motion<'a>>,
}

impl JointFit<'_> {
    /// The joint's row (V).
    pub fn row(mut self) -> Vec<f64> {
        if self.candidates.is_empty() {
            self.candidates = (0..self.template.len()).collect();
        }
        let distance = |vertex: &usize| self.template[*vertex].distance_squared(self.joint);
        self.candidates.sort_by(|one, other| distance(one).total_cmp(&distance(other)));
        self.candidates.truncate(TRIED.max(self.template.len() / NEAREST_SHARE));
        let stride = self.candidates.len().div_ceil(TRIED).max(1);
        self.candidates = self.candidates.into_iter().step_by(stride).collect();
        let column = |vertex: &usize| -> Vec<f64> {
            let place = (self.template[*vertex] - self.joint) * AT_REST;
            let moves = self.motions.iter().flat_map(|motion| (motion.offsets[*vertex] * motion.weight).to_array());
            place.to_array().into_iter().chain(moves).chain([1.0]).collect()
        };
        let columns: Vec<Vec<f64>> = self.candidates.iter().map(column).collect();
        let goal: Vec<f64> = [0.0; 3]
            .into_iter()
            .chain(self.motions.iter().flat_map(|motion| (motion.joint * motion.weight).to_array()))
            .chain([1.0])
            .collect();
        let mut row = vec![0.0; self.template.len()];
        for (vertex, weight) in self.candidates.iter().zip(non_negative(&columns, &goal)) {
            row[*vertex] = if weight < NEGLIGIBLE { 0.0 } else { weight };
        }
        let sum: f64 = row.iter().sum();
        match self.candidates.first() {
            Some(nearest) if sum == 0.0 => row[*nearest] = 1.0,
            _ => row.iter_mut().for_each(|weight| *weight /= sum),
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_within_its_vertices_is_their_mean_and_follows_them() {
        let corners = [-1.0, 1.0].map(|x| [-1.0, 1.0].map(|y| [-1.0, 1.0].map(|z| DVec3::new(x, y, z))));
        let template: Vec<DVec3> = corners.as_flattened().as_flattened().iter().map(|corner| *corner * 0.1).collect();
        // Those above stretch up twice as far as the joint moves.
        let offsets: Vec<DVec3> =
            template.iter().map(|vertex| DVec3::Y * if vertex.y > 0.0 { 0.2 } else { 0.0 }).collect();
        let joint = DVec3::new(0.02, 0.0, -0.01);
        let motions = vec![Motion { offsets: &offsets, joint: DVec3::Y * 0.1, weight: 2.0 }];
        let row = JointFit { template: &template, joint, candidates: Vec::new(), motions }.row();
        let mean = |of: &[DVec3]| row.iter().zip(of).map(|(weight, place)| *place * *weight).sum::<DVec3>();
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12 && row.iter().all(|weight| *weight >= 0.0));
        assert!(mean(&template).distance(joint) < 1e-9, "{}", mean(&template));
        assert!(mean(&offsets).distance(DVec3::Y * 0.1) < 1e-9);
    }

    #[test]
    fn a_joint_out_of_reach_is_where_its_vertices_come_nearest() {
        let template = [DVec3::ZERO, DVec3::X * 0.1];
        let fit = JointFit { template: &template, joint: DVec3::X * 0.5, candidates: vec![0, 1], motions: Vec::new() };
        assert_eq!(fit.row(), [0.0, 1.0]);
    }
}
