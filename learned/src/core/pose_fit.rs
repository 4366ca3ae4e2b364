//! The pose, and the shape if that is wanted, in which a body comes nearest to a registration (METHOD-BODY 3.1).
//!
//! minimise sum_v |v(R, t, psi, beta) - r_v|^2 over the sampled vertices by Levenberg-Marquardt: (H + mu diag H + epsilon) d = -g. Joints that nothing
//! follows stay where they were. Metres.

use glam::DVec3;
use nalgebra::DMatrix;
use xavatar_register::linear::{Basis, Besides, FramePose, NormalEquations, PosedChain, PosedPoints, Row, Unknowns};

use super::FittedBody;
use super::gathered::Gathered;
use super::procrustes::first_pose;

/// Steps at most.
const STEPS: usize = 40;
/// Tries of one step.
const TRIES: usize = 8;
/// Fits end when a step lowers the sum by a smaller share.
const CONVERGED: f64 = 3e-5;
/// What holds an unknown that nothing depends on, metres^2.
const EPSILON: f64 = 1e-9;

/// What is solved for: the pose always.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoseFit {
    /// The shape, too.
    pub shape: bool,
    /// The expression, too.
    pub expression: bool,
}

/// A pose that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Of the registration.
    pub pose: FramePose,
    /// beta (S).
    pub shape: Vec<f64>,
}

impl PoseFit {
    /// The pose nearest to a registration (V), from `start`, or from the joints' turns one by one.
    pub fn nearest(self, body: &FittedBody, registration: &[DVec3], start: Option<Fitted>) -> Fitted {
        let shapes = body.linkage.extents().shapes;
        let mut found = start.unwrap_or_else(|| Fitted {
            pose: first_pose(body, &body.template, registration),
            shape: vec![0.0; shapes],
        });
        let targets: Vec<DVec3> = body.sample.iter().map(|vertex| registration[*vertex]).collect();
        let joints: Vec<usize> = (0..body.linkage.extents().joints).collect();
        let besides = Besides { translation: true, expression: self.expression, shape: self.shape };
        let unknowns = Unknowns::new(body.linkage.extents(), &joints, besides);
        let mut damping = 1e-4;
        let (mut posed, mut chain) = sampled(body, &found);
        let mut cost = squared_distance(&posed, &targets);
        for _ in 0..STEPS {
            let equations = equations(body, &posed, &chain, &targets, &unknowns);
            let before = cost;
            for _ in 0..TRIES {
                let tried = step(&equations, damping).map(|step| found.moved(body, &unknowns.spread(&step)));
                if let Some(tried) = tried.filter(|tried| tried.pose.is_finite()) {
                    let (moved, its_chain) = sampled(body, &tried);
                    let its_cost = squared_distance(&moved, &targets);
                    if its_cost < cost {
                        (found, posed, chain, cost) = (tried, moved, its_chain, its_cost);
                        damping = (damping * 0.1).max(1e-9);
                        break;
                    }
                }
                damping *= 10.0;
            }
            if before - cost <= CONVERGED * before {
                break;
            }
        }
        found
    }
}

impl Fitted {
    /// Moved by a step in all columns.
    fn moved(&self, body: &FittedBody, step: &[f64]) -> Self {
        let extents = body.linkage.extents();
        let shape = self.shape.iter().zip(&step[extents.shape()]).map(|(value, step)| value + step).collect();
        Self { pose: self.pose.moved(extents, step), shape }
    }
}

fn sampled(body: &FittedBody, found: &Fitted) -> (PosedPoints, PosedChain) {
    let chain = body.linkage.posed(&found.pose, &found.shape);
    (body.sampled.posed(&body.linkage, &chain), chain)
}

fn squared_distance(posed: &PosedPoints, targets: &[DVec3]) -> f64 {
    posed.positions.iter().zip(targets).map(|(found, target)| found.distance_squared(*target)).sum()
}

fn equations(
    body: &FittedBody,
    posed: &PosedPoints,
    chain: &PosedChain,
    targets: &[DVec3],
    unknowns: &Unknowns,
) -> NormalEquations {
    let basis = Basis { linkage: &body.linkage, chain, unknowns };
    let (mut gathered, mut row) = (Gathered::default(), Row::default());
    for (index, target) in targets.iter().enumerate() {
        let residual = posed.positions[index] - *target;
        for axis in DVec3::AXES {
            body.sampled.row(basis, posed, index, axis, &mut row);
            gathered.add(&row, residual.dot(axis));
        }
    }
    gathered.equations(unknowns.count())
}

/// The damped step; none if the equations cannot be solved.
fn step(equations: &NormalEquations, damping: f64) -> Option<Vec<f64>> {
    let mut matrix: DMatrix<f64> = equations.matrix.clone();
    for place in 0..matrix.nrows() {
        matrix[(place, place)] += damping * matrix[(place, place)] + EPSILON;
    }
    let solved = matrix.cholesky()?.solve(&-&equations.gradient);
    Some(solved.as_slice().to_vec())
}
