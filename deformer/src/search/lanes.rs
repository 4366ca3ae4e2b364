//! The iteration of Broyden's method for sixteen starts side by side, one a lane.
//!
//! x <- x - H g with the residual g = d(x) - x_d, then the rank-one update of the inverse Jacobian H (Sherman-Morrison),
//! H + (s - H y) s^T H / (s^T H y) for the step s and the change y of g, damped after Powell (1970) so that its
//! denominator never vanishes. Every lane runs every line, what is not wanted is not selected, and no lane reads another.

use xavatar_network::Real;

use super::limits::Limits;
use crate::Jacobian;

/// Starts side by side: a vector of f32 on the widest machines.
pub(crate) const LANES: usize = 16;

/// Powell's bound: the updated inverse Jacobian's denominator is at least this share of |step|^2.
const DAMPING: f64 = 0.1;

/// Where a start stands after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Unfinished,
    Converged,
    Diverged,
    Exhausted,
}

type Lanes<T> = [T; LANES];

/// The states of sixteen starts.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct Pack<T> {
    point: [Lanes<T>; 3],
    target: [Lanes<T>; 3],
    step: [Lanes<T>; 3],
    residual: [Lanes<T>; 3],
    inverse: [Lanes<T>; 9],
    best_point: [Lanes<T>; 3],
    best_squared: Lanes<T>,
    /// Updates so far; negative if there is no first H.
    updates: Lanes<T>,
    /// 0 unfinished, 1 converged, 2 diverged, 3 exhausted.
    status: Lanes<T>,
}

impl<T: Real> Default for Pack<T> {
    fn default() -> Self {
        let zero = [T::zero(); LANES];
        Self {
            point: [zero; 3],
            target: [zero; 3],
            step: [zero; 3],
            residual: [zero; 3],
            inverse: [zero; 9],
            best_point: [zero; 3],
            best_squared: zero,
            updates: zero,
            status: zero,
        }
    }
}

impl<T: Real> Pack<T> {
    /// Puts a new start into a lane; its H follows with the first evaluation.
    #[inline(always)]
    pub(crate) fn begin(&mut self, lane: usize, point: [T; 3], target: [T; 3]) {
        for axis in 0..3 {
            self.point[axis][lane] = point[axis];
            self.target[axis][lane] = target[axis];
            self.step[axis][lane] = T::zero();
            self.residual[axis][lane] = T::zero();
            self.best_point[axis][lane] = point[axis];
        }
        self.best_squared[lane] = T::infinity();
        self.updates[lane] = T::zero();
        self.status[lane] = T::zero();
    }

    /// The first H of a lane; none ends its search, unless the start is a root.
    #[inline(always)]
    pub(crate) fn set_inverse(&mut self, lane: usize, inverse: Option<Jacobian<T>>) {
        match inverse {
            Some(inverse) => (0..9).for_each(|index| self.inverse[index][lane] = inverse[index / 3][index % 3]),
            None => self.updates[lane] = -T::one(),
        }
    }

    pub(crate) fn copy_lane(&mut self, lane: usize, other: &Self, from: usize) {
        for axis in 0..3 {
            self.point[axis][lane] = other.point[axis][from];
            self.target[axis][lane] = other.target[axis][from];
            self.step[axis][lane] = other.step[axis][from];
            self.residual[axis][lane] = other.residual[axis][from];
            self.best_point[axis][lane] = other.best_point[axis][from];
        }
        (0..9).for_each(|index| self.inverse[index][lane] = other.inverse[index][from]);
        self.best_squared[lane] = other.best_squared[from];
        self.updates[lane] = other.updates[from];
        self.status[lane] = other.status[from];
    }

    /// The point that a lane is to be evaluated at.
    #[inline(always)]
    pub(crate) fn point(&self, lane: usize) -> [T; 3] {
        [self.point[0][lane], self.point[1][lane], self.point[2][lane]]
    }

    /// A lane's best point and |g|^2 there.
    #[inline(always)]
    pub(crate) fn best(&self, lane: usize) -> ([T; 3], T) {
        let point = [self.best_point[0][lane], self.best_point[1][lane], self.best_point[2][lane]];
        (point, self.best_squared[lane])
    }

    #[inline(always)]
    pub(crate) fn status(&self, lane: usize) -> Status {
        let code = self.status[lane];
        if code == T::zero() {
            Status::Unfinished
        } else if code == T::one() {
            Status::Converged
        } else if code == T::of(2.0) {
            Status::Diverged
        } else {
            Status::Exhausted
        }
    }

    /// Takes d(x) of each lane and moves the lane on, or says why its search has ended.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "one lane of many arrays; iterators hide it from the vectoriser")]
    pub(crate) fn advance(&mut self, images: &[Lanes<T>; 3], limits: &Limits<T>) {
        let (zero, one, bound) = (T::zero(), T::one(), T::of(DAMPING));
        let tolerance = limits.tolerance * limits.tolerance;
        let divergence = limits.divergence * limits.divergence;
        let most = T::of(f64::from(limits.updates));
        for lane in 0..LANES {
            let point = self.point(lane);
            let g = [
                images[0][lane] - self.target[0][lane],
                images[1][lane] - self.target[1][lane],
                images[2][lane] - self.target[2][lane],
            ];
            let squared = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];
            let better = squared < self.best_squared[lane];
            for axis in 0..3 {
                self.best_point[axis][lane] = if better { point[axis] } else { self.best_point[axis][lane] };
            }
            self.best_squared[lane] = if better { squared } else { self.best_squared[lane] };

            let updates = self.updates[lane];
            let exhausted = if updates >= most { T::of(3.0) } else { zero };
            let finite = if squared < T::infinity() { exhausted } else { T::of(2.0) };
            let near = if (squared > divergence) & (updates > zero) { T::of(2.0) } else { finite };
            let possible = if updates < zero { T::of(2.0) } else { near };
            self.status[lane] = if squared < tolerance { one } else { possible };

            let y = [g[0] - self.residual[0][lane], g[1] - self.residual[1][lane], g[2] - self.residual[2][lane]];
            let s = [self.step[0][lane], self.step[1][lane], self.step[2][lane]];
            let h = |r: usize, c: usize| self.inverse[3 * r + c][lane];
            let h = [[h(0, 0), h(0, 1), h(0, 2)], [h(1, 0), h(1, 1), h(1, 2)], [h(2, 0), h(2, 1), h(2, 2)]];
            let hy = |r: usize| h[r][0] * y[0] + h[r][1] * y[1] + h[r][2] * y[2];
            let hy = [hy(0), hy(1), hy(2)];
            let length = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
            let denominator = s[0] * hy[0] + s[1] * hy[1] + s[2] * hy[2];
            let ratio = denominator / length;
            let damped = (one - bound.copysign(ratio)) / (one - ratio);
            let share = if denominator.abs() < bound * length { damped } else { one };
            let predicted = |r: usize| share * hy[r] + (one - share) * s[r];
            let predicted = [predicted(0), predicted(1), predicted(2)];
            let scale = one / (s[0] * predicted[0] + s[1] * predicted[1] + s[2] * predicted[2]);
            // The first iteration has no step, and an update that is not finite is none.
            let scale = if scale.abs() < T::infinity() { scale } else { zero };
            let row = |c: usize| h[0][c] * s[0] + h[1][c] * s[1] + h[2][c] * s[2];
            let row = [row(0), row(1), row(2)];
            for r in 0..3 {
                let share = (s[r] - predicted[r]) * scale;
                let share = if updates > zero { share } else { zero };
                let new = [h[r][0] + share * row[0], h[r][1] + share * row[1], h[r][2] + share * row[2]];
                let step = -(new[0] * g[0] + new[1] * g[1] + new[2] * g[2]);
                for c in 0..3 {
                    self.inverse[3 * r + c][lane] = new[c];
                }
                self.step[r][lane] = step;
                self.point[r][lane] = point[r] + step;
                self.residual[r][lane] = g[r];
            }
            self.updates[lane] = updates + one;
        }
    }
}
