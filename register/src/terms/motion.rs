//! How far a frame is from halfway between its neighbours: what people's joints and bodies accelerate, no more.
//!
//! r = log(M^T R) of every joint, M halfway between the same joint one frame before and after; t - (t_before + t_after) / 2. A motion with
//! acceleration a deviates by a dt^2 / 2: that costs 1, so the term means nothing where frames are far apart. Derivatives of r go
//! through Jr^-1(r). Radians, metres, seconds.

use glam::DVec3;

use crate::linear::{FramePose, NormalEquations, Row, Unknowns, so3};

/// What joints usually accelerate by, radians a second squared.
const TURNS: f64 = 10.0;
/// What bodies usually accelerate by, metres a second squared.
const MOVES: f64 = 3.0;

/// The term of one frame whose neighbours are known.
#[derive(Clone, Debug)]
pub struct MotionTerm {
    halfway: FramePose,
    /// Of dt^2 / 2.
    half_square: f64,
}

impl MotionTerm {
    /// Of a frame `seconds` after one and before another.
    pub fn of(before: &FramePose, after: &FramePose, seconds: f64) -> Self {
        Self { halfway: before.between(after, 0.5), half_square: seconds * seconds / 2.0 }
    }

    /// Adds the term to a frame's equations.
    pub fn add(&self, pose: &FramePose, unknowns: &Unknowns, equations: &mut NormalEquations) {
        let extents = unknowns.extents();
        let [turn_weight, move_weight] = [TURNS, MOVES].map(|usual| (usual * self.half_square).powi(-2));
        let mut row = Row::default();
        for (joint, (rotation, halfway)) in pose.rotations.iter().zip(&self.halfway.rotations).enumerate() {
            if unknowns.place(extents.turn(joint)).is_none() {
                continue;
            }
            let turn = so3::log(&(halfway.transpose() * *rotation));
            let slope = so3::right_jacobian_inverse(turn);
            for axis in 0..3 {
                row.clear();
                for column in 0..3 {
                    row.push(unknowns, extents.turn(joint) + column, slope.col(column)[axis]);
                }
                equations.add(&row, turn[axis], turn_weight);
            }
        }
        let way: DVec3 = pose.translation - self.halfway.translation;
        for (column, way) in extents.translation().zip(way.to_array()) {
            equations.add_single(unknowns.place(column), way, move_weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{Besides, Extents};

    // dE/dx of E = sum (r / (a dt^2 / 2))^2 is 2 g.
    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        const STEP: f64 = 1e-6;
        let extents = Extents { joints: 4, shapes: 2, expressions: 1 };
        let pose = |by: f64| {
            let turn = |joint: usize| DVec3::new(0.9, -0.7, 0.4) * (by + joint as f64).sin();
            FramePose {
                translation: DVec3::new(by, 0.3 * by * by, -by),
                ..FramePose::turned(extents, (0..4).map(|joint| (joint, turn(joint))))
            }
        };
        let term = MotionTerm::of(&pose(0.1), &pose(0.9), 0.4);
        let unknowns = Unknowns::new(extents, &[0, 1, 3], Besides { translation: true, ..Besides::default() });
        let equations = |pose: &FramePose| {
            let mut equations = NormalEquations::new(unknowns.count());
            term.add(pose, &unknowns, &mut equations);
            equations
        };
        let at = pose(0.7);
        let gradient = equations(&at).gradient;
        for column in (0..extents.count()).filter(|column| unknowns.place(*column).is_some()) {
            let cost = |by: f64| {
                let mut step = vec![0.0; extents.count()];
                step[column] = by;
                equations(&at.moved(extents, &step)).cost
            };
            let numeric = (cost(STEP) - cost(-STEP)) / (2.0 * STEP);
            let found = 2.0 * gradient[unknowns.place(column).unwrap()];
            assert!((numeric - found).abs() < 1e-6 * numeric.abs().max(1.0), "column {column}: {numeric} {found}");
        }
    }

    #[test]
    fn frames_that_are_far_apart_say_nothing_of_each_other() {
        let extents = Extents { joints: 1, shapes: 0, expressions: 0 };
        let pose = |angle: f64| FramePose::turned(extents, [(0, DVec3::Y * angle)]);
        let cost = |seconds: f64| {
            let unknowns = Unknowns::new(extents, &[0], Besides::default());
            let mut equations = NormalEquations::new(unknowns.count());
            MotionTerm::of(&pose(0.0), &pose(0.2), seconds).add(&pose(0.15), &unknowns, &mut equations);
            equations.cost
        };
        assert!((cost(1.0 / 30.0) - (0.05 * 1800.0 / TURNS).powi(2)).abs() < 1e-6);
        assert!(cost(0.5) < 0.01);
    }
}
