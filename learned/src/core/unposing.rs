//! Un-posing: what is left of a registration at rest, and the features that explain it (METHOD-BODY D3).
//!
//! y_v = M_v^-1 (r_v - v) + corrections_v, with the body's vertex v and its turn M_v = sum_j w_vj G_j: exact where M is invertible. Where it folds (its
//! condition is large) the frame says nothing of the vertex: y is what the body has now. x = q_j - (0, 0, 0, 1), x y z w, of every joint but the root.

use glam::{DMat3, DVec3};
use xavatar_register::linear::{FramePose, so3};

/// |M| |M^-1| of a rotation is 3; beyond this a vertex is not un-posed.
const FOLDED: f64 = 60.0;

/// What a registration (V) differs by at rest from the posed body, whose vertices are at `positions`, turned by `turns`, on top of the `corrections`
/// (V) that the body has already.
pub fn unposed(positions: &[DVec3], turns: &[DMat3], registration: &[DVec3], corrections: &[DVec3]) -> Vec<DVec3> {
    let vertices = positions.iter().zip(turns).zip(registration).zip(corrections);
    let left = |(((position, turn), target), correction): (((&DVec3, &DMat3), &DVec3), &DVec3)| {
        let inverse = turn.inverse();
        let condition = norm(turn) * norm(&inverse);
        // A comparison that a number that is none fails.
        if condition < FOLDED { inverse * (*target - *position) + *correction } else { *correction }
    };
    vertices.map(left).collect()
}

/// The quaternion features of a pose (4 (J - 1)).
pub fn features(pose: &FramePose) -> Vec<f64> {
    let of_joint = |rotation: &DMat3| {
        let [x, y, z, w] = so3::quaternion(rotation).to_array();
        [x, y, z, w - 1.0]
    };
    pose.rotations[1..].iter().flat_map(of_joint).collect()
}

fn norm(matrix: &DMat3) -> f64 {
    matrix.to_cols_array().iter().map(|value| value * value).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::SkinningRows;
    use crate::reference::{reference, vectors};

    #[test]
    fn the_residual_is_the_references() {
        let golden = reference("avatar_template");
        let parents = [None, Some(0), Some(1), Some(2), Some(1), Some(4), Some(0), Some(6)];
        let weights: Vec<Vec<(usize, f64)>> =
            golden["weights"].chunks_exact(8).map(|row| row.iter().copied().enumerate().collect()).collect();
        let rows = SkinningRows::new(&weights, &parents);
        let (template, joints) = (vectors(&golden["true_template"]), vectors(&golden["true_joints"]));
        let mut turns: Vec<DMat3> = Vec::new();
        let mut places: Vec<DVec3> = Vec::new();
        for (joint, turn) in vectors(&golden["pose"]).into_iter().enumerate() {
            let above = parents[joint];
            turns.push(above.map_or(DMat3::IDENTITY, |above| turns[above]) * so3::exp(turn));
            places.push(
                above.map_or(joints[joint], |above| places[above] + turns[above] * (joints[joint] - joints[above])),
            );
        }
        let place = |vertex: usize| -> DVec3 {
            let moved = |(joint, weight): &(usize, f64)| {
                (turns[*joint] * (template[vertex] - joints[*joint]) + places[*joint]) * *weight
            };
            weights[vertex].iter().map(moved).sum()
        };
        let positions: Vec<DVec3> = (0..40).map(place).collect();
        let blended: Vec<DMat3> = (0..40).map(|vertex| rows.turn(vertex, &turns)).collect();
        let found = unposed(&positions, &blended, &vectors(&golden["registration"]), &[DVec3::ZERO; 40]);
        for (found, expected) in found.iter().zip(vectors(&golden["unposed_residual"])) {
            assert!(found.distance(expected) < 1e-12, "{found} {expected}");
        }
    }
}
