//! Broyden's method on many starts at once: x with A(x) x~ = x_d (thesis ch. 4.2.3).
//!
//! x <- x - H g with the residual g = A x~ - x_d, then the rank-one update of the inverse Jacobian H (Sherman-Morrison),
//! damped after Powell (1970) so that its denominator never vanishes. A start without an H begins with the inverse of
//! the blended 3 x 3, which converges more often than the inverse of the full Jacobian.
//!
//! Only unfinished starts are evaluated: a finished one leaves the active set at once and the next waiting one takes
//! its place, so the field always sees full batches. A start's result does not depend on its companions.

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
        let left = self.updates > 0 && squared > limits.divergence * limits.divergence;
        if left || !squared.is_finite() {
            return Some(Outcome::Diverged);
        }
        let inverse = match self.inverse {
            Some(inverse) if self.updates > 0 => {
                updated_inverse(&inverse, self.step, subtract(residual, self.residual))
            }
            given => match given.or_else(|| inverse(&rotation(transform))) {
                Some(inverse) => inverse,
                None => return Some(Outcome::Diverged),
            },
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

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    const LIMITS: Limits<f64> = Limits { tolerance: 1e-5, divergence: 1.0, updates: 50 };

    /// Remembers where it was evaluated.
    struct Recorded<F> {
        transform: F,
        visited: Mutex<Vec<[f64; 3]>>,
    }

    impl<F: Fn([f64; 3]) -> BoneTransform<f64> + Sync> Warp<f64> for Recorded<F> {
        type Workspace = ();

        fn bones(&self) -> &[BoneTransform<f64>] {
            &[]
        }

        fn transforms(&self, _: &mut (), points: &[[f64; 3]], transforms: &mut [BoneTransform<f64>]) {
            self.visited.lock().unwrap().extend(points);
            points.iter().zip(transforms).for_each(|(&point, transform)| *transform = (self.transform)(point));
        }

        fn transforms_and_jacobians(
            &self,
            _: &mut (),
            _: &[[f64; 3]],
            _: &mut [BoneTransform<f64>],
            _: &mut [Jacobian<f64>],
        ) {
            unreachable!("Broyden's method needs no Jacobian")
        }
    }

    /// A rigid translation by t(x): d(x) = x + t(x).
    fn shift(t: [f64; 3]) -> BoneTransform<f64> {
        [1.0, 0.0, 0.0, t[0], 0.0, 1.0, 0.0, t[1], 0.0, 0.0, 1.0, t[2]]
    }

    fn solve_all(
        transform: impl Fn([f64; 3]) -> BoneTransform<f64> + Sync,
        limits: &Limits<f64>,
        starts: Vec<Start<f64>>,
    ) -> (Vec<Solution<f64>>, Vec<[f64; 3]>, usize) {
        let warp = Recorded { transform, visited: Mutex::default() };
        let mut solutions = vec![None; starts.len()];
        let evaluations =
            solve(&warp, &mut (), &mut ActiveSet::default(), limits, starts.into_iter(), |index, solution| {
                assert!(solutions[index].replace(solution).is_none(), "start {index} finished twice");
            });
        (
            solutions.into_iter().map(|s| s.expect("every start ends")).collect(),
            warp.visited.into_inner().unwrap(),
            evaluations,
        )
    }

    fn start(point: [f64; 3]) -> Start<f64> {
        Start { target: [0.0; 3], point, inverse: None }
    }

    #[test]
    fn an_affine_warp_takes_one_update_and_more_starts_than_slots_all_finish() {
        let starts: Vec<_> = (0..1000).map(|index| start([f64::from(index) * 1e-4 + 0.1, 0.0, 0.0])).collect();
        let (solutions, _, evaluations) = solve_all(|_| shift([0.1, 0.2, -0.3]), &LIMITS, starts);
        assert_eq!(evaluations, 2000);
        for solution in solutions {
            assert_eq!(solution.outcome, Outcome::Converged);
            assert!(solution.residual < 1e-12);
            assert!(solution.point.iter().zip([-0.1, -0.2, 0.3]).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    // g = (x^2 + 0.1, y, z) has no root, so the iterates wander; the best of them is reported, not the last
    #[test]
    fn the_best_iterate_is_kept() {
        let rootless = |x: [f64; 3]| shift([x[0] * x[0] + 0.1 - x[0], 0.0, 0.0]);
        let residual = |x: [f64; 3]| ((x[0] * x[0] + 0.1).powi(2) + x[1] * x[1] + x[2] * x[2]).sqrt();
        let mut worse_at_last = 0;
        for updates in 1..50 {
            let limits = Limits { divergence: 1e9, updates, ..LIMITS };
            let (solutions, visited, evaluations) = solve_all(rootless, &limits, vec![start([0.7, 0.2, 0.1])]);
            assert_eq!((solutions[0].outcome, evaluations), (Outcome::Exhausted, updates as usize + 1));
            let best = visited.iter().map(|&point| residual(point)).fold(f64::INFINITY, f64::min);
            assert!(
                (solutions[0].residual - best).abs() < 1e-15 && (residual(solutions[0].point) - best).abs() < 1e-15
            );
            worse_at_last += usize::from(residual(visited[visited.len() - 1]) > best + 1e-3);
        }
        assert!(worse_at_last > 5, "the test needs iterates that get worse, {worse_at_last} did");
    }

    #[test]
    fn hopeless_starts_end_without_harm_to_their_neighbours() {
        let warp = |x: [f64; 3]| match x[1] {
            1.0 => [f64::NAN; 12],
            2.0 => [0.0; 12],
            3.0 => shift([f64::INFINITY; 3]),
            _ => shift([0.0; 3]),
        };
        let at = |y| Start { target: [0.3, y, 0.0], point: [0.0, y, 0.0], inverse: None };
        let (solutions, _, _) = solve_all(warp, &LIMITS, vec![at(1.0), at(0.0), at(2.0), at(3.0), at(-0.5)]);
        let outcomes: Vec<_> = solutions.iter().map(|solution| solution.outcome).collect();
        let (bad, good) = (Outcome::Diverged, Outcome::Converged);
        assert_eq!(outcomes, [bad, good, bad, bad, good]);
    }

    #[test]
    fn a_start_beyond_the_bound_may_come_back_but_an_update_may_not_leave() {
        let far = Start { target: [0.0; 3], point: [5.0, 0.0, 0.0], inverse: None };
        let (solutions, _, _) = solve_all(|_| shift([0.0; 3]), &LIMITS, vec![far]);
        assert_eq!(solutions[0].outcome, Outcome::Converged);
        let wrong = [[-40.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let misled = Start { target: [0.0; 3], point: [0.5, 0.0, 0.0], inverse: Some(wrong) };
        let (solutions, visited, _) = solve_all(|_| shift([0.0; 3]), &LIMITS, vec![misled]);
        assert_eq!((solutions[0].outcome, visited.len()), (Outcome::Diverged, 2));
        assert_eq!(solutions[0].point, [0.5, 0.0, 0.0]);
    }
}
