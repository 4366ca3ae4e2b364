//! Levenberg-Marquardt over many frames: each with a pose of its own, one shape for all.
//!
//! With H_t = [A_t B_t; B_t^T C_t] of frame t and damping lambda, the shape's step solves
//! (sum C_t - B_t^T A_t^-1 B_t + prior) db = -(sum g_b - B_t^T A_t^-1 g_t + prior beta) and the frame's dx_t = -A_t^-1 (g_t + B_t db). Frames are linearised in
//! parallel and summed in order, so that the result does not depend on threads.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use xavatar_body::Part;
use xavatar_formats::Result;

use super::schedule::Stage;
use super::subject::Fitter;
use crate::landmarks::Seen;
use crate::linear::{Basis, FramePose, NormalEquations, Unknowns};
use crate::target::{IndexedTarget, ScanTarget};
use crate::terms::{Dressed, MotionTerm, add_expression};

/// Damping: share of the diagonal that is added to it.
const DAMPING: f64 = 1e-2;
/// Where equations cannot be solved, damping is raised by this, so many times.
const MORE_DAMPING: (f64, usize) = (10.0, 5);
/// Added to the diagonal of unknowns that nothing says anything about.
const FLOOR: f64 = 1e-6;
/// A shape coefficient changes by no more in a step.
const LARGEST_SHAPE_STEP: f64 = 0.5;

/// What there is of one frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The scan.
    pub scan: Arc<ScanTarget>,
    /// Landmarks that are believed; none without.
    pub landmarks: Vec<Seen>,
    /// What the frames before and after it say, if they are known and near in time.
    pub motion: Option<MotionTerm>,
    /// Parts of the body that the scan does not show: they are inside of it.
    pub unseen: Vec<Part>,
}

/// Frames while they are fitted.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// The poses of the frames.
    pub poses: Vec<FramePose>,
    /// The shape that they share (S).
    pub shape: Vec<f64>,
}

/// A frame with the index that a stage searches its scan by, if it looks at it.
struct IndexedFrame<'a> {
    scan: Option<IndexedTarget>,
    landmarks: &'a [Seen],
    motion: Option<&'a MotionTerm>,
    unseen: &'a [Part],
}

impl<'a> IndexedFrame<'a> {
    fn new(frame: &'a Frame, stage: &Stage) -> Result<Self> {
        let scan = stage.surface.map(|term| IndexedTarget::new(&frame.scan, term.normal_weight)).transpose()?;
        Ok(Self { scan, landmarks: &frame.landmarks, motion: frame.motion.as_ref(), unseen: &frame.unseen })
    }
}

/// Equations of one frame, solved for its own unknowns as far as the shape's are not needed.
struct Reduced {
    /// A^-1 [B | g]; none if the equations had no solution.
    solution: Option<DMatrix<f64>>,
    /// C - B^T A^-1 B.
    matrix: DMatrix<f64>,
    /// g_b - B^T A^-1 g.
    gradient: DVector<f64>,
}

impl Sequence {
    /// Takes the steps of a stage; `clothing` is how far cloth stands off each vertex of the fitter's surface.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if a pose stops being a number.
    pub fn run(&mut self, fitter: &Fitter<'_>, stage: &Stage, frames: &[Frame], clothing: &[f64]) -> Result<()> {
        let unknowns = fitter.unknowns(stage);
        let indexed: Vec<IndexedFrame<'_>> =
            frames.par_iter().map(|frame| IndexedFrame::new(frame, stage)).collect::<Result<_>>()?;
        for _ in 0..stage.steps {
            let reduced = |(pose, frame): (&FramePose, &IndexedFrame<'_>)| {
                let equations = fitter.equations(stage, &unknowns, pose, &self.shape, frame, clothing)?;
                Ok(Reduced::of(equations, &unknowns))
            };
            let reduced: Vec<Reduced> = self.poses.par_iter().zip(&indexed).map(reduced).collect::<Result<_>>()?;
            let shape_step = self.shape_step(stage, &unknowns, &reduced);
            for (pose, reduced) in self.poses.iter_mut().zip(&reduced) {
                let Some(solution) = &reduced.solution else { continue };
                let shapes = shape_step.len();
                let own = -(solution.columns(0, shapes) * &shape_step + solution.column(shapes));
                let whole: Vec<f64> = own.iter().chain(&shape_step).copied().collect();
                let moved = pose.moved(unknowns.extents(), &unknowns.spread(&whole));
                if moved.is_finite() {
                    *pose = moved;
                }
            }
            self.shape.iter_mut().zip(&shape_step).for_each(|(value, step)| *value += step);
        }
        Ok(())
    }

    fn shape_step(&self, stage: &Stage, unknowns: &Unknowns, reduced: &[Reduced]) -> DVector<f64> {
        let shapes = unknowns.count() - unknowns.of_frame();
        let (mut matrix, mut gradient) = (DMatrix::zeros(shapes, shapes), DVector::zeros(shapes));
        for one in reduced.iter().filter(|one| one.solution.is_some()) {
            matrix += &one.matrix;
            gradient += &one.gradient;
        }
        let prior = stage.shape_prior * reduced.len() as f64;
        for place in 0..shapes {
            matrix[(place, place)] = matrix[(place, place)] * (1.0 + DAMPING) + prior;
            gradient[place] += prior * self.shape[place];
        }
        let solved = matrix.cholesky().map(|factor| -factor.solve(&gradient));
        let step = solved.filter(|step| step.iter().all(|value| value.is_finite()));
        step.map_or_else(
            || DVector::zeros(shapes),
            |step| step.map(|value| value.clamp(-LARGEST_SHAPE_STEP, LARGEST_SHAPE_STEP)),
        )
    }
}

impl Reduced {
    fn of(mut equations: NormalEquations, unknowns: &Unknowns) -> Self {
        let (own, shapes) = (unknowns.of_frame(), unknowns.count() - unknowns.of_frame());
        equations.matrix.fill_upper_triangle_with_lower_triangle();
        let NormalEquations { matrix, gradient, .. } = equations;
        let coupling = matrix.view((0, own), (own, shapes)).into_owned();
        let mut right = DMatrix::zeros(own, shapes + 1);
        right.columns_mut(0, shapes).copy_from(&coupling);
        right.column_mut(shapes).copy_from(&gradient.rows(0, own));
        let mut damping = DAMPING;
        let mut solution = None;
        for _ in 0..MORE_DAMPING.1 {
            let mut damped = matrix.view((0, 0), (own, own)).into_owned();
            (0..own).for_each(|place| damped[(place, place)] += damping * damped[(place, place)] + FLOOR);
            solution = damped.cholesky().map(|factor| factor.solve(&right));
            solution = solution.filter(|solution| solution.iter().all(|value| value.is_finite()));
            if solution.is_some() {
                break;
            }
            damping *= MORE_DAMPING.0;
        }
        let eliminated =
            solution.as_ref().map_or_else(|| DMatrix::zeros(shapes, shapes + 1), |solved| coupling.tr_mul(solved));
        Self {
            solution,
            matrix: matrix.view((own, own), (shapes, shapes)) - eliminated.columns(0, shapes),
            gradient: gradient.rows(own, shapes) - eliminated.column(shapes),
        }
    }
}

impl Fitter<'_> {
    /// The equations of one frame in a stage.
    fn equations(
        &self,
        stage: &Stage,
        unknowns: &Unknowns,
        pose: &FramePose,
        shape: &[f64],
        frame: &IndexedFrame<'_>,
        clothing: &[f64],
    ) -> Result<NormalEquations> {
        let mut equations = NormalEquations::new(unknowns.count());
        let posed = self.surface.posed(&self.linkage, pose, shape);
        if let (Some(term), Some(scan)) = (&stage.surface, &frame.scan) {
            let body = Dressed { linkage: &self.linkage, model: &self.surface, clothing, unseen: frame.unseen };
            term.add(body, &posed, scan, unknowns, &mut equations)?;
        }
        if let Some(term) = &stage.landmarks {
            let basis = Basis { linkage: &self.linkage, chain: &posed.chain, unknowns };
            term.add(basis, &self.sites, frame.landmarks, &mut equations);
        }
        if let Some(motion) = frame.motion {
            motion.add(pose, unknowns, &mut equations);
        }
        self.prior.add(pose, unknowns, &mut equations);
        add_expression(pose, stage.expression_prior, unknowns, &mut equations);
        Ok(equations)
    }
}
