//! Part-aware correspondence search (thesis ch. 4.2.3, eq. 4.5; A.3.2).
//!
//! For a deformed point x_d with part label l, finds every canonical x_c with d_w(x_c, B) = x_d by Broyden's method,
//! started from B_i^-1 x_d for the bones i of l's group. N points; metres.
//!
//! Converged: |residual| < 1e-5 m within 50 updates. Starts that leave the 1 m ball are dropped, not clamped.
//! Roots closer than 1e-4 m are one root: the geometry network never sees a candidate twice.
//! Blocks of points are fixed by the points' starts alone, so results do not depend on the number of threads.

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use xavatar_network::Real;

use crate::affine::{apply, inverse, inverse_transform};
use crate::broyden::{ActiveSet, Limits, Outcome, Start, solve};
use crate::candidates::{Root, merge_roots};
use crate::error::expect_length;
use crate::{BoneTransform, Candidates, Error, Jacobian, Result, SearchStatistics, StartGroups, Warp};

/// Starts per block of points: enough to keep the active set full, few enough to share among threads.
const BLOCK_STARTS: usize = 2048;

/// When starts are given up and roots are the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchSettings {
    /// Residual below which a start has converged, metres.
    pub tolerance: f64,
    /// Updates of a start before it is given up.
    pub updates: u32,
    /// Residual above which a start is dropped, metres.
    pub divergence: f64,
    /// Distance below which two roots of a point are one, metres.
    pub merge_distance: f64,
    /// Residual that is good enough on a baked warp when the exact one polishes its roots, metres.
    pub baked_tolerance: f64,
    /// Exact updates that polish a baked warp's root.
    pub polish_updates: u32,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-5,
            updates: 50,
            divergence: 1.0,
            merge_distance: 1e-4,
            baked_tolerance: 1e-4,
            polish_updates: 3,
        }
    }
}

impl SearchSettings {
    fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("the search's tolerance", self.tolerance),
            ("the search's divergence", self.divergence),
            ("the search's merge distance", self.merge_distance),
            ("the search's baked tolerance", self.baked_tolerance),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                let expected = "a positive, finite number of metres".to_owned();
                return Err(Error::Value { name, found: value.to_string(), expected });
            }
        }
        Ok(())
    }
}

/// Finds the canonical candidates of deformed points (N). `labels` holds their parts (N); without, the full group starts.
///
/// # Errors
/// If bones, groups and labels do not fit together, a bone transform cannot be inverted, or a point is not finite.
pub fn search<T: Real, W: Warp<T>>(
    warp: &W,
    groups: &StartGroups,
    points: &[[T; 3]],
    labels: Option<&[u8]>,
    settings: &SearchSettings,
) -> Result<Candidates<T>> {
    let plan = Plan::new(warp.bones(), groups, points, labels, settings)?;
    plan.run(|thread: &mut Thread<T, W::Workspace, ()>, block| {
        plan.find(warp, settings.tolerance, thread, block);
    })
}

/// Finds candidates on a fast warp (a baked one), then brings each distinct root to the tolerance on the exact warp.
///
/// The first inverse Jacobian on the exact warp is that of the fast one, so that one to three evaluations usually do.
///
/// # Errors
/// Those of [`search`], and if the two warps have different bones.
pub fn search_and_polish<T: Real, W: Warp<T>, E: Warp<T>>(
    fast: &W,
    exact: &E,
    groups: &StartGroups,
    points: &[[T; 3]],
    labels: Option<&[u8]>,
    settings: &SearchSettings,
) -> Result<Candidates<T>> {
    if fast.bones() != exact.bones() {
        return Err(Error::Skeleton {
            name: "the baked warp's frame",
            found: "another than the exact warp's".to_owned(),
            expected: "the same bone transforms".to_owned(),
        });
    }
    let plan = Plan::new(fast.bones(), groups, points, labels, settings)?;
    plan.run(|thread: &mut Thread<T, W::Workspace, E::Workspace>, block| {
        plan.find(fast, settings.baked_tolerance, thread, block.clone());
        plan.polish(fast, exact, thread, block);
    })
}

/// What all blocks of one search share.
struct Plan<'a, T> {
    inverse_bones: Vec<BoneTransform<T>>,
    points: &'a [[T; 3]],
    /// The bones that start the search, per point (N).
    bones: Vec<&'a [usize]>,
    settings: &'a SearchSettings,
}

/// One thread's memory, and what it found for the block in hand.
#[derive(Default)]
struct Thread<T, W, E> {
    searched: W,
    exact: E,
    active: ActiveSet<T>,
    /// One entry per start or root that was solved for; none if it did not converge.
    solved: Vec<Option<Root<T>>>,
    transforms: Vec<BoneTransform<T>>,
    jacobians: Vec<Jacobian<T>>,
    canonical: Vec<[T; 3]>,
    roots: Vec<Root<T>>,
    /// Candidates per point of the block.
    counts: Vec<usize>,
    statistics: SearchStatistics,
}

impl<'a, T: Real> Plan<'a, T> {
    fn new(
        bones: &[BoneTransform<T>],
        groups: &'a StartGroups,
        points: &'a [[T; 3]],
        labels: Option<&[u8]>,
        settings: &'a SearchSettings,
    ) -> Result<Self> {
        settings.validate()?;
        if bones.len() != groups.joints() {
            return Err(Error::Skeleton {
                name: "the number of bone transforms",
                found: bones.len().to_string(),
                expected: format!("{}, as the start groups have", groups.joints()),
            });
        }
        if let Some(labels) = labels {
            expect_length("part labels", labels.len(), points.len())?;
        }
        if let Some(index) = points.iter().position(|point| point.iter().any(|value| !value.is_finite())) {
            return Err(Error::Value {
                name: "a deformed point",
                found: format!("{:?} (point {index})", points[index]),
                expected: "finite metres".to_owned(),
            });
        }
        let inverse_bones = bones.iter().enumerate().map(|(bone, transform)| {
            inverse_transform(transform).ok_or_else(|| Error::Skeleton {
                name: "a bone transform",
                found: format!("singular or not finite (bone {bone}: {transform:?})"),
                expected: "invertible, as rotations are".to_owned(),
            })
        });
        let group = |index| groups.bones(labels.map(|labels| labels[index]));
        Ok(Self {
            inverse_bones: inverse_bones.collect::<Result<_>>()?,
            points,
            bones: (0..points.len()).map(group).collect::<Result<_>>()?,
            settings,
        })
    }

    fn limits(&self, tolerance: f64, updates: u32) -> Limits<T> {
        Limits { tolerance: T::of(tolerance), divergence: T::of(self.settings.divergence), updates }
    }

    /// Consecutive points with about as many starts each.
    fn blocks(&self) -> Vec<Range<usize>> {
        let (mut blocks, mut first, mut starts) = (Vec::new(), 0, 0);
        for (point, bones) in self.bones.iter().enumerate() {
            starts += bones.len();
            if starts >= BLOCK_STARTS || point + 1 == self.points.len() {
                blocks.push(first..point + 1);
                (first, starts) = (point + 1, 0);
            }
        }
        blocks
    }

    /// Solves all blocks in parallel and joins what they found in the order of the points.
    fn run<W: Default + Send, E: Default + Send>(
        &self,
        solve_block: impl Fn(&mut Thread<T, W, E>, Range<usize>) + Sync,
    ) -> Result<Candidates<T>> {
        let found: Vec<_> = self
            .blocks()
            .into_par_iter()
            .map_init(Thread::default, |thread, block| {
                thread.statistics = SearchStatistics::default();
                solve_block(thread, block);
                thread.statistics.points_without_root = thread.counts.iter().filter(|&&count| count == 0).count();
                (thread.counts.clone(), thread.roots.clone(), thread.statistics)
            })
            .collect();
        let total = found.iter().map(|(_, roots, _)| roots.len()).sum();
        let mut candidates = Candidates {
            offsets: Vec::with_capacity(self.points.len() + 1),
            points: Vec::with_capacity(total),
            residuals: Vec::with_capacity(total),
            bones: Vec::with_capacity(total),
            statistics: SearchStatistics::default(),
        };
        let mut end = 0;
        candidates.offsets.push(end);
        for (counts, roots, statistics) in found {
            candidates.offsets.extend(counts.into_iter().map(|count| {
                end += count;
                end
            }));
            candidates.points.extend(roots.iter().map(|root| root.point));
            candidates.residuals.extend(roots.iter().map(|root| root.residual));
            candidates.bones.extend(roots.iter().map(|root| root.bone));
            candidates.statistics = candidates.statistics.and(statistics);
        }
        Ok(candidates)
    }

    /// Searches from all starts of a block; leaves the distinct roots of its points in `thread`.
    fn find<W: Warp<T>, E>(
        &self,
        warp: &W,
        tolerance: f64,
        thread: &mut Thread<T, W::Workspace, E>,
        block: Range<usize>,
    ) {
        let Thread { searched, active, solved, roots, counts, statistics, .. } = thread;
        let bones = &self.bones[block.clone()];
        let starts = self.points[block].iter().zip(bones).flat_map(|(&target, bones)| {
            bones.iter().map(move |&bone| Start {
                target,
                point: apply(&self.inverse_bones[bone], target),
                inverse: None,
            })
        });
        statistics.starts = bones.iter().map(|bones| bones.len()).sum();
        solved.clear();
        solved.resize(statistics.starts, None);
        let mut ends = [0; 3];
        let limits = self.limits(tolerance, self.settings.updates);
        statistics.evaluations = solve(warp, searched, active, &limits, starts, |index, solution| {
            ends[solution.outcome as usize] += 1;
            if solution.outcome == Outcome::Converged {
                solved[index] = Some(Root { point: solution.point, residual: solution.residual, bone: 0 });
            }
        });
        [statistics.converged, statistics.diverged, statistics.exhausted] = ends;

        roots.clear();
        counts.clear();
        let mut solved = solved.iter();
        for &bones in bones {
            let known = roots.len();
            let named =
                bones.iter().zip(solved.by_ref()).filter_map(|(&bone, root)| root.map(|root| Root { bone, ..root }));
            merge_roots(named, T::of(self.settings.merge_distance), roots);
            counts.push(roots.len() - known);
        }
    }

    /// Brings the roots in `thread` to the tolerance on the exact warp; drops those that do not get there.
    fn polish<W: Warp<T>, E: Warp<T>>(
        &self,
        fast: &W,
        exact: &E,
        thread: &mut Thread<T, W::Workspace, E::Workspace>,
        block: Range<usize>,
    ) {
        let Thread {
            searched, exact: exact_workspace, active, solved, transforms, jacobians, canonical, roots, ..
        } = thread;
        canonical.clear();
        canonical.extend(roots.iter().map(|root| root.point));
        transforms.resize(roots.len(), [T::zero(); 12]);
        jacobians.resize(roots.len(), [[T::zero(); 3]; 3]);
        fast.transforms_and_jacobians(searched, canonical, transforms, jacobians);
        let targets = self.points[block].iter().zip(&thread.counts);
        let targets = targets.flat_map(|(&target, &count)| std::iter::repeat_n(target, count));
        let starts = targets.zip(roots.iter().zip(jacobians.iter()));
        let starts =
            starts.map(|(target, (root, jacobian))| Start { target, point: root.point, inverse: inverse(jacobian) });
        solved.clear();
        solved.resize(roots.len(), None);
        let limits = self.limits(self.settings.tolerance, self.settings.polish_updates);
        let evaluations = solve(exact, exact_workspace, active, &limits, starts, |index, solution| {
            if solution.outcome == Outcome::Converged {
                let bone = roots[index].bone;
                solved[index] = Some(Root { point: solution.point, residual: solution.residual, bone });
            }
        });
        thread.statistics.polish_evaluations = evaluations;
        thread.statistics.lost_in_polish = solved.iter().filter(|root| root.is_none()).count();

        roots.clear();
        let mut solved = solved.iter();
        for count in &mut thread.counts {
            let known = roots.len();
            let polished = solved.by_ref().take(*count).flatten().copied();
            merge_roots(polished, T::of(self.settings.merge_distance), roots);
            *count = roots.len() - known;
        }
    }
}
