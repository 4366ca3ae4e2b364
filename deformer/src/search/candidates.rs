//! What the search finds: for each deformed point, the canonical points that deform to it.
//!
//! N points, K candidates in all. Roots of one point closer than a given distance are one candidate.

use std::ops::Range;

use xavatar_network::Real;

/// The candidates of N deformed points, grouped by point in the order of the points, as compressed sparse rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidates<T> {
    /// Point n's candidates are `offsets[n]..offsets[n + 1]` of the lists below (N + 1).
    pub offsets: Vec<usize>,
    /// Canonical points x_c (K, 3), metres.
    pub points: Vec<[T; 3]>,
    /// |d(x_c) - x_d| (K), metres.
    pub residuals: Vec<T>,
    /// The bone whose start found the candidate (K); of several, the one with the smallest residual.
    pub bones: Vec<usize>,
    /// How the search went.
    pub statistics: SearchStatistics,
}

/// Counts of one search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SearchStatistics {
    /// Starts tried.
    pub starts: usize,
    /// Starts left out because no root that matters could be near them.
    pub pruned: usize,
    /// Roots dropped because they are where nothing matters.
    pub immaterial: usize,
    /// Starts that converged.
    pub converged: usize,
    /// Starts that left the ball of allowed residuals, or met a singular or non-finite matrix.
    pub diverged: usize,
    /// Starts that used up their updates.
    pub exhausted: usize,
    /// Points at which the searched warp was evaluated.
    pub evaluations: usize,
    /// Points at which the exact warp was evaluated to polish roots of another.
    pub polish_evaluations: usize,
    /// Roots that polishing could not bring below the tolerance; they are no candidates.
    pub lost_in_polish: usize,
    /// Deformed points without any candidate.
    pub points_without_root: usize,
}

impl<T> Candidates<T> {
    /// How many deformed points were searched for: N.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether no point was searched for.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the candidates of deformed point `point` stand in the lists. Panics if there is no such point.
    pub fn range(&self, point: usize) -> Range<usize> {
        self.offsets[point]..self.offsets[point + 1]
    }
}

impl SearchStatistics {
    /// The counts of two disjoint sets of points together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            starts: self.starts + other.starts,
            pruned: self.pruned + other.pruned,
            immaterial: self.immaterial + other.immaterial,
            converged: self.converged + other.converged,
            diverged: self.diverged + other.diverged,
            exhausted: self.exhausted + other.exhausted,
            evaluations: self.evaluations + other.evaluations,
            polish_evaluations: self.polish_evaluations + other.polish_evaluations,
            lost_in_polish: self.lost_in_polish + other.lost_in_polish,
            points_without_root: self.points_without_root + other.points_without_root,
        }
    }
}

/// A root that one start reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Root<T> {
    pub point: [T; 3],
    pub residual: T,
    pub bone: usize,
}

/// Appends the distinct ones of `roots` to `merged`: of those closer than `distance`, the one with the least residual.
pub(crate) fn merge_roots<T: Real>(roots: impl Iterator<Item = Root<T>>, distance: T, merged: &mut Vec<Root<T>>) {
    let first = merged.len();
    for root in roots {
        let twin = merged[first..].iter_mut().find(|known| {
            let gap = crate::affine::subtract(known.point, root.point);
            crate::affine::dot(gap, gap) < distance * distance
        });
        match twin {
            None => merged.push(root),
            Some(known) if root.residual < known.residual => *known = root,
            Some(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root(x: f64, residual: f64, bone: usize) -> Root<f64> {
        Root { point: [x, 0.0, 0.0], residual, bone }
    }

    #[test]
    fn close_roots_become_the_best_of_them() {
        let mut merged = vec![root(0.0, 1e-9, 7)];
        let roots = [root(0.0, 3e-6, 0), root(1.0, 1e-6, 1), root(5e-5, 1e-6, 2), root(1.00001, 2e-6, 3)];
        merge_roots(roots.into_iter(), 1e-4, &mut merged);
        assert_eq!(merged, [root(0.0, 1e-9, 7), root(5e-5, 1e-6, 2), root(1.0, 1e-6, 1)]);
    }
}
