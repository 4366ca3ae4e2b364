//! How one search is split into blocks of points, solved block by block, and joined.
//!
//! Blocks depend on the points' starts alone, never on the threads, and are joined in the order of the points: the same
//! input gives the same bits on any number of threads. A thread's memory is reused from block to block.

use std::ops::Range;

use rayon::prelude::*;
use xavatar_network::Real;

use super::broyden::{ActiveSet, Outcome, Start, solve};
use super::candidates::{Root, merge_roots};
use super::limits::Limits;
use super::{DIVERGENCE, MERGE_DISTANCE};
use crate::affine::{apply, inverse, inverse_transform};
use crate::error::expect_length;
use crate::{BoneTransform, Candidates, Error, Jacobian, Result, SearchSettings, SearchStatistics, StartGroups, Warp};

/// Starts per block of points: enough to keep the active set full, few enough to share among threads.
const BLOCK_STARTS: usize = 2048;

/// What all blocks of one search share.
pub(crate) struct Plan<'a, T> {
    inverse_bones: Vec<BoneTransform<T>>,
    points: &'a [[T; 3]],
    /// The bones that start the search, per point (N).
    bones: Vec<&'a [usize]>,
    labels: Option<&'a [u8]>,
    settings: &'a SearchSettings,
}

/// One thread's memory, and what it found for the block in hand.
#[derive(Default)]
pub(crate) struct Thread<T, W, E> {
    searched: W,
    exact: E,
    active: ActiveSet<T>,
    tried: Vec<Tried<T>>,
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

/// A start that is not left out.
#[derive(Clone, Copy, Debug)]
struct Tried<T> {
    /// The deformed point's place in the list.
    index: usize,
    bone: usize,
    target: [T; 3],
    point: [T; 3],
}

/// Whether a box, given by its lowest and highest corner, holds a point.
#[inline(always)]
fn holds<T: Real>([low, high]: &[[T; 3]; 2], point: [T; 3]) -> bool {
    (0..3).all(|axis| low[axis] <= point[axis] && point[axis] <= high[axis])
}

impl<'a, T: Real> Plan<'a, T> {
    pub(crate) fn new<W: Warp<T>>(
        warp: &W,
        groups: &'a StartGroups,
        points: &'a [[T; 3]],
        labels: Option<&'a [u8]>,
        settings: &'a SearchSettings,
    ) -> Result<Self> {
        settings.validate()?;
        let bones = warp.bones();
        if bones.len() != groups.joints() {
            return Err(Error::Skeleton {
                name: "the number of bone transforms",
                found: bones.len().to_string(),
                expected: format!("{}, as the start groups have", groups.joints()),
            });
        }
        if warp.start_boxes().is_some_and(|boxes| boxes.groups() != groups) {
            return Err(Error::Skeleton {
                name: "the start groups",
                found: "others than those that the warp prunes starts for".to_owned(),
                expected: "the same".to_owned(),
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
            labels,
            settings,
        })
    }

    fn limits(&self) -> Limits<T> {
        let SearchSettings { tolerance, updates } = *self.settings;
        Limits { tolerance: T::of(tolerance), divergence: T::of(DIVERGENCE), updates }
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
    pub(crate) fn run<W: Default + Send, E: Default + Send>(
        &self,
        solve_block: impl Fn(&mut Thread<T, W, E>, Range<usize>) + Sync,
    ) -> Candidates<T> {
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
        candidates
    }

    /// Searches from all starts of a block; leaves the distinct roots of its points in `thread`.
    pub(crate) fn find<W: Warp<T>, E>(&self, warp: &W, thread: &mut Thread<T, W::Workspace, E>, block: Range<usize>) {
        let Thread { searched, active, tried, solved, roots, counts, statistics, .. } = thread;
        let bones = &self.bones[block.clone()];
        let targets = &self.points[block.clone()];
        tried.clear();
        for ((index, &bones), &target) in block.clone().zip(bones).zip(targets) {
            let boxes = warp.start_boxes().map(|boxes| boxes.of_group(self.labels.map(|labels| labels[index])));
            for (place, &bone) in bones.iter().enumerate() {
                let point = apply(&self.inverse_bones[bone], target);
                if boxes.is_none_or(|boxes| holds(&boxes[place], point)) {
                    tried.push(Tried { index, bone, target, point });
                }
            }
        }
        statistics.starts = tried.len();
        statistics.pruned = bones.iter().map(|bones| bones.len()).sum::<usize>() - tried.len();
        solved.clear();
        solved.resize(tried.len(), None);
        let (mut ends, mut immaterial) = ([0; 3], 0);
        let starts = tried.iter().map(|start| Start { target: start.target, point: start.point, inverse: None });
        statistics.evaluations = solve(warp, searched, active, &self.limits(), starts, |index, solution| {
            ends[solution.outcome as usize] += 1;
            if solution.outcome == Outcome::Converged {
                if warp.matters(solution.point) {
                    let bone = tried[index].bone;
                    solved[index] = Some(Root { point: solution.point, residual: solution.residual, bone });
                } else {
                    immaterial += 1;
                }
            }
        });
        [statistics.converged, statistics.diverged, statistics.exhausted] = ends;
        statistics.immaterial = immaterial;

        roots.clear();
        counts.clear();
        let mut of_start = tried.iter().zip(solved.iter()).peekable();
        for index in block {
            let known = roots.len();
            let of_point = std::iter::from_fn(|| of_start.next_if(|(start, _)| start.index == index));
            merge_roots(of_point.filter_map(|(_, root)| *root), T::of(MERGE_DISTANCE), roots);
            counts.push(roots.len() - known);
        }
    }

    /// Brings the roots in `thread` to the tolerance on the exact warp; drops those that do not get there.
    pub(crate) fn polish<W: Warp<T>, E: Warp<T>>(
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
        let evaluations = solve(exact, exact_workspace, active, &self.limits(), starts, |index, solution| {
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
            merge_roots(polished, T::of(MERGE_DISTANCE), roots);
            *count = roots.len() - known;
        }
    }
}
