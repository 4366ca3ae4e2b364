//! Broyden's method on many starts at once: x with A(x) x~ = x_d (thesis ch. 4.2.3).
//!
//! x <- x - H g with the residual g = A x~ - x_d, then the rank-one update of the inverse Jacobian H (Sherman-Morrison),
//! damped after Powell (1970) so that its denominator never vanishes. A start without an H begins with the inverse of
//! the blended 3 x 3, which converges more often than the inverse of the full Jacobian.
//!
//! Only unfinished starts are evaluated: a finished one leaves the active set at once and the next waiting one takes
//! its place, so the field always sees full batches. A start's result does not depend on its companions.

use pulp::Arch;
use xavatar_network::Real;

use crate::affine::{apply, dot, inverse, multiply, multiply_transposed, rotation, subtract};
use crate::{BoneTransform, Jacobian, Warp};

/// How many starts are active at once: full matrix products for the field, small enough for the second-level cache.
const ACTIVE: usize = 256;

/// Powell's bound: the updated inverse Jacobian's denominator is at least this share of |step|^2.
const DAMPING: f64 = 0.1;

/// When a start is finished.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits<T> {
    /// |g| below which a start has converged, metres.
    pub tolerance: T,
    /// |g| above which an updated start is given up, metres.
    pub divergence: T,
    /// How many times x is updated.
    pub updates: u32,
}

/// Where one search begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start<T> {
    /// x_d.
    pub target: [T; 3],
    /// The first x.
    pub point: [T; 3],
    /// The first H; the inverse of the blended 3 x 3 if absent.
    pub inverse: Option<Jacobian<T>>,
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The residual fell below the tolerance.
    Converged,
    /// The residual rose above the bound or stopped being a number, or the first H does not exist.
    Diverged,
    /// All updates were used.
    Exhausted,
}

/// How one search ended: its best iterate, whatever came after it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution<T> {
    pub point: [T; 3],
    /// |g| at `point`; infinite if no residual was a number.
    pub residual: T,
    pub outcome: Outcome,
}

/// The active set of one thread, structure of arrays where the warp reads it.
#[derive(Debug)]
pub(crate) struct ActiveSet<T> {
    points: Vec<[T; 3]>,
    states: Vec<State<T>>,
    transforms: Vec<BoneTransform<T>>,
}

impl<T> Default for ActiveSet<T> {
    fn default() -> Self {
        Self { points: Vec::new(), states: Vec::new(), transforms: Vec::new() }
    }
}

#[derive(Clone, Copy, Debug)]
struct State<T> {
    index: usize,
    target: [T; 3],
    /// H, once the first residual is known.
    inverse: Option<Jacobian<T>>,
    step: [T; 3],
    residual: [T; 3],
    updates: u32,
    best_point: [T; 3],
    best_squared: T,
}

/// Solves every start and hands each solution over with the start's place in the sequence. Returns the evaluations.
pub(crate) fn solve<T: Real, W: Warp<T>>(
    warp: &W,
    workspace: &mut W::Workspace,
    active: &mut ActiveSet<T>,
    limits: &Limits<T>,
    starts: impl Iterator<Item = Start<T>>,
    mut finish: impl FnMut(usize, Solution<T>),
) -> usize {
    let ActiveSet { points, states, transforms } = active;
    points.clear();
    states.clear();
    transforms.resize(ACTIVE, [T::zero(); 12]);
    let mut waiting = starts.enumerate();
    let mut evaluations = 0;
    loop {
        for (index, start) in waiting.by_ref().take(ACTIVE - points.len()) {
            points.push(start.point);
            states.push(State::new(index, &start));
        }
        if points.is_empty() {
            return evaluations;
        }
        let transforms = &mut transforms[..points.len()];
        warp.transforms(workspace, points, transforms);
        evaluations += points.len();
        let kept = Arch::new().dispatch(
            #[inline(always)]
            || {
                let mut kept = 0;
                for (slot, transform) in transforms.iter().enumerate() {
                    let (mut point, mut state) = (points[slot], states[slot]);
                    match state.advance(&mut point, transform, limits) {
                        Some(outcome) => finish(state.index, state.solution(outcome)),
                        None => {
                            points[kept] = point;
                            states[kept] = state;
                            kept += 1;
                        }
                    }
                }
                kept
            },
        );
        points.truncate(kept);
        states.truncate(kept);
    }
}

impl<T: Real> State<T> {
    fn new(index: usize, start: &Start<T>) -> Self {
        let zero = [T::zero(); 3];
        Self {
            index,
            target: start.target,
            inverse: start.inverse,
            step: zero,
            residual: zero,
            updates: 0,
            best_point: start.point,
            best_squared: T::infinity(),
        }
    }

    /// Takes the blended transform at `point`; moves the point on, or says why the search has ended.
    #[inline(always)]
    fn advance(&mut self, point: &mut [T; 3], transform: &BoneTransform<T>, limits: &Limits<T>) -> Option<Outcome> {
        let residual = subtract(apply(transform, *point), self.target);
        let squared = dot(residual, residual);
        if squared < self.best_squared {
            self.best_squared = squared;
            self.best_point = *point;
        }
        if squared < limits.tolerance * limits.tolerance {
            return Some(Outcome::Converged);
        }
        let inverse = if self.updates == 0 {
            match self.inverse.or_else(|| inverse(&rotation(transform))) {
                Some(inverse) if squared.is_finite() => inverse,
                _ => return Some(Outcome::Diverged),
            }
        } else {
            // Negated so that a NaN ends the search too.
            if !(squared <= limits.divergence * limits.divergence) {
                return Some(Outcome::Diverged);
            }
            match self.inverse {
                Some(inverse) => updated_inverse(&inverse, self.step, subtract(residual, self.residual)),
                None => return Some(Outcome::Diverged),
            }
        };
        if self.updates == limits.updates {
            return Some(Outcome::Exhausted);
        }
        let step = multiply(&inverse, residual).map(|value| -value);
        *point = std::array::from_fn(|axis| point[axis] + step[axis]);
        self.inverse = Some(inverse);
        self.step = step;
        self.residual = residual;
        self.updates += 1;
        None
    }

    #[inline(always)]
    fn solution(&self, outcome: Outcome) -> Solution<T> {
        Solution { point: self.best_point, residual: self.best_squared.sqrt(), outcome }
    }
}

/// H + (s - H y) s^T H / (s^T H y) for the step s and the change y of the residual, damped.
#[inline(always)]
fn updated_inverse<T: Real>(inverse: &Jacobian<T>, step: [T; 3], change: [T; 3]) -> Jacobian<T> {
    let mut predicted = multiply(inverse, change);
    let squared = dot(step, step);
    let mut denominator = dot(step, predicted);
    let bound = T::of(DAMPING);
    if denominator.abs() < bound * squared {
        let ratio = denominator / squared;
        let share = (T::one() - bound.copysign(ratio)) / (T::one() - ratio);
        predicted = std::array::from_fn(|axis| share * predicted[axis] + (T::one() - share) * step[axis]);
        denominator = dot(step, predicted);
    }
    let scale = T::one() / denominator;
    if !scale.is_finite() {
        return *inverse;
    }
    let row = multiply_transposed(inverse, step);
    std::array::from_fn(|r| {
        let share = (step[r] - predicted[r]) * scale;
        std::array::from_fn(|c| inverse[r][c] + share * row[c])
    })
}
