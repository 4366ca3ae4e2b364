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
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self { tolerance: 1e-5, updates: 50, divergence: 1.0, merge_distance: 1e-4 }
    }
}

impl SearchSettings {
    fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("the search's tolerance", self.tolerance),
            ("the search's divergence", self.divergence),
            ("the search's merge distance", self.merge_distance),
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
        plan.find(warp, thread, block);
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
        plan.find(fast, thread, block.clone());
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

    fn limits(&self) -> Limits<T> {
        let SearchSettings { tolerance, divergence, updates, .. } = *self.settings;
        Limits { tolerance: T::of(tolerance), divergence: T::of(divergence), updates }
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
    fn find<W: Warp<T>, E>(&self, warp: &W, thread: &mut Thread<T, W::Workspace, E>, block: Range<usize>) {
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
        statistics.evaluations = solve(warp, searched, active, &self.limits(), starts, |index, solution| {
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
            merge_roots(polished, T::of(self.settings.merge_distance), roots);
            *count = roots.len() - known;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::softmax_field::{generator, posed, vectors};
    use crate::{BakedWeights, ExactWarp, deform};

    const JOINTS: usize = 12;

    /// Deformed points and where they came from.
    fn deformed<T: Real>(warp: &impl Warp<T>, count: usize, seed: u64) -> (Vec<[T; 3]>, Vec<[T; 3]>) {
        let canonical: Vec<[T; 3]> = vectors(&mut generator(seed), count, 0.6);
        let mut transforms = vec![[T::zero(); 12]; count];
        let mut points = vec![[T::zero(); 3]; count];
        warp.transforms(&mut Default::default(), &canonical, &mut transforms);
        deform(&transforms, &canonical, &mut points).unwrap();
        (points, canonical)
    }

    fn distance<T: Real>(a: [T; 3], b: [T; 3]) -> f64 {
        (0..3).map(|axis| (a[axis].wide() - b[axis].wide()).powi(2)).sum::<f64>().sqrt()
    }

    fn share<T>(points: &[T], found: impl Fn(usize) -> bool) -> f64 {
        (0..points.len()).filter(|&point| found(point)).count() as f64 / points.len() as f64
    }

    #[test]
    fn candidates_deform_to_their_points_are_distinct_and_hold_the_truth() {
        let (field, bones) = posed::<f32>(31, JOINTS, 0.9);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let (points, canonical) = deformed(&warp, 500, 32);
        let found = search(&warp, &StartGroups::all(JOINTS).unwrap(), &points, None, &Default::default()).unwrap();
        let mut transforms = vec![[0.0; 12]; found.points.len()];
        warp.transforms(&mut Default::default(), &found.points, &mut transforms);
        for (index, &point) in points.iter().enumerate() {
            for candidate in found.range(index) {
                let there = apply(&transforms[candidate], found.points[candidate]);
                assert!(distance(there, point) < 1.1e-5);
                assert!((distance(there, point) - f64::from(found.residuals[candidate])).abs() < 1e-6);
                assert!(found.bones[candidate] < JOINTS);
                for other in found.range(index).filter(|&other| other != candidate) {
                    assert!(distance(found.points[other], found.points[candidate]) >= 0.99e-4);
                }
            }
        }
        let held = share(&points, |point| {
            found.range(point).any(|candidate| distance(found.points[candidate], canonical[point]) < 1e-3)
        });
        assert!(held > 0.98, "{held} of the true points are found");
        let s = found.statistics;
        assert_eq!((s.starts, s.converged + s.diverged + s.exhausted), (500 * JOINTS, s.starts));
        assert_eq!(s.points_without_root, (0..points.len()).filter(|&point| found.range(point).is_empty()).count());
        assert_eq!((found.len(), found.offsets[500]), (500, found.points.len()));
    }

    // d is equivariant: rotating the posed body, bones and points alike, leaves the canonical points where they are
    #[test]
    fn a_rotated_frame_has_the_same_candidates() {
        let (field, bones) = posed::<f64>(33, JOINTS, 0.7);
        let groups = StartGroups::all(JOINTS).unwrap();
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let (points, _) = deformed(&warp, 100, 34);
        let turn: [f64; 12] = [0.0, -1.0, 0.0, 0.3, 0.0, 0.0, -1.0, 2.0, 1.0, 0.0, 0.0, -0.7];
        let turned_bone = |bone: &[f64; 12]| {
            std::array::from_fn(|index| {
                let (r, c) = (index / 4, index % 4);
                let linear: f64 = (0..3).map(|k| turn[4 * r + k] * bone[4 * k + c]).sum();
                if c == 3 { linear + turn[4 * r + 3] } else { linear }
            })
        };
        let turned_bones: Vec<_> = bones.iter().map(turned_bone).collect();
        let turned_points: Vec<_> = points.iter().map(|&point| apply(&turn, point)).collect();
        let turned = ExactWarp::new(&field, &turned_bones).unwrap();
        let before = search(&warp, &groups, &points, None, &Default::default()).unwrap();
        let after = search(&turned, &groups, &turned_points, None, &Default::default()).unwrap();
        assert_eq!((&before.offsets, before.statistics), (&after.offsets, after.statistics));
        assert!(before.points.iter().zip(&after.points).all(|(&a, &b)| distance(a, b) < 1e-9));
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let (field, bones) = posed::<f32>(35, JOINTS, 0.9);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let (points, _) = deformed(&warp, 1500, 36);
        let groups = StartGroups::new(JOINTS, vec![vec![0, 1, 2], (3..JOINTS).collect()], vec![0]).unwrap();
        let labels: Vec<u8> = (0..points.len()).map(|index| u8::from(index % 3 == 0)).collect();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| search(&warp, &groups, &points, Some(&labels), &Default::default()).unwrap())
        };
        let alone = with(1);
        assert_eq!(alone.statistics.starts, 1000 * 3 + 500 * (JOINTS - 3));
        for threads in [2, 5] {
            assert_eq!(with(threads), alone);
        }
    }

    #[test]
    fn labels_choose_the_bones_that_start() {
        let (field, bones) = posed::<f64>(37, JOINTS, 0.5);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let (points, _) = deformed(&warp, 60, 38);
        let groups = StartGroups::new(JOINTS, vec![vec![4, 7], vec![9]], vec![0, 1]).unwrap();
        let labels: Vec<u8> = (0..60).map(|index| u8::from(index >= 20)).collect();
        let found = search(&warp, &groups, &points, Some(&labels), &Default::default()).unwrap();
        for (point, &label) in labels.iter().enumerate() {
            let allowed = groups.bones(Some(label)).unwrap();
            assert!(found.bones[found.range(point)].iter().all(|bone| allowed.contains(bone)));
        }
        let unlabelled = search(&warp, &groups, &points, None, &Default::default()).unwrap();
        assert!(unlabelled.bones.iter().all(|&bone| bone < 2) && unlabelled.statistics.starts == 120);
    }

    #[test]
    fn polished_roots_of_a_baked_warp_are_those_of_the_exact_one() {
        let (field, bones) = posed::<f32>(39, JOINTS, 0.9);
        let exact = ExactWarp::new(&field, &bones).unwrap();
        let (points, _) = deformed(&exact, 500, 40);
        let groups = StartGroups::all(JOINTS).unwrap();
        let baked = BakedWeights::sample(&field, [-1.2; 3], [1.2; 3], [33, 33, 33]).unwrap();
        let baked = baked.warp(&bones).unwrap();
        let settings = SearchSettings::default();
        let reference = search(&exact, &groups, &points, None, &settings).unwrap();
        let coarse = search(&baked, &groups, &points, None, &settings).unwrap();
        let polished = search_and_polish(&baked, &exact, &groups, &points, None, &settings).unwrap();
        let agree = |found: &Candidates<f32>, within: f64| {
            let near = |a: &Candidates<f32>, b: &Candidates<f32>, point: usize| {
                a.range(point).all(|i| b.range(point).any(|j| distance(a.points[i], b.points[j]) < within))
            };
            share(&points, |point| near(found, &reference, point) && near(&reference, found, point))
        };
        let (before, after) = (agree(&coarse, 1e-4), agree(&polished, 1e-4));
        assert!(after > 0.97 && before < 0.5, "agreement before {before} and after polishing {after}");
        assert!(polished.residuals.iter().all(|&residual| residual < 1e-5));
        let s = polished.statistics;
        assert_eq!(s.evaluations, coarse.statistics.evaluations);
        assert!(s.polish_evaluations < 5 * coarse.points.len(), "{s:?}");
        assert!(s.lost_in_polish * 100 < coarse.points.len(), "{s:?}");
    }

    #[test]
    fn what_does_not_fit_together_is_refused() {
        let (field, bones) = posed::<f64>(41, JOINTS, 0.5);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let groups = StartGroups::all(JOINTS).unwrap();
        let settings = SearchSettings::default();
        let message = |result: Result<Candidates<f64>>| result.expect_err("refused").to_string();
        let points = [[0.0; 3], [0.0, f64::NAN, 0.0]];
        assert!(message(search(&warp, &groups, &points, None, &settings)).contains("point 1"));
        assert!(message(search(&warp, &groups, &points[..1], Some(&[0, 0]), &settings)).contains("labels"));
        assert!(message(search(&warp, &groups, &points[..1], Some(&[0]), &settings)).contains("part label"));
        let other = StartGroups::all(JOINTS + 1).unwrap();
        assert!(message(search(&warp, &other, &points[..1], None, &settings)).contains("13"));
        for tolerance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let settings = SearchSettings { tolerance, ..settings.clone() };
            assert!(message(search(&warp, &groups, &points[..1], None, &settings)).contains("tolerance"));
        }
        let mut flat = bones.clone();
        flat[5] = [0.0; 12];
        let warp = ExactWarp::new(&field, &flat).unwrap();
        assert!(message(search(&warp, &groups, &points[..1], None, &settings)).contains("bone 5"));
        flat[5][3] = f64::NAN;
        assert!(ExactWarp::new(&field, &flat).is_err());
        assert!(ExactWarp::new(&field, &bones[1..]).is_err());
    }

    #[test]
    fn no_points_have_no_candidates() {
        let (field, bones) = posed::<f32>(43, JOINTS, 0.5);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let groups = StartGroups::all(JOINTS).unwrap();
        let found = search(&warp, &groups, &[], Some(&[]), &Default::default()).unwrap();
        assert!(found.is_empty() && found.offsets == [0] && found.points.is_empty());
    }
}
