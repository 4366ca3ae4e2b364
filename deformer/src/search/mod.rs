//! Part-aware correspondence search (thesis ch. 4.2.3, eq. 4.5; A.3.2).
//!
//! For a deformed point x_d with part label l, finds every canonical x_c with d_w(x_c, B) = x_d by Broyden's method,
//! started from B_i^-1 x_d for the bones i of l's group. N points; metres.
//!
//! [`SearchSettings`] says when a start has converged (thesis: |residual| < 1e-5 m within 50 updates). Starts that leave the ball are
//! dropped, not clamped. Roots close to each other are one: the geometry network never sees a candidate twice.

mod broyden;
mod candidates;
mod groups;
mod lanes;
mod limits;
mod plan;
mod regions;

pub use candidates::{Candidates, SearchStatistics};
pub use groups::StartGroups;
pub use regions::{StartBoxes, StartRegions};

use serde::{Deserialize, Serialize};
use xavatar_network::Real;

use self::plan::{Plan, Thread};
use crate::{Error, Result, Warp};

/// More updates than any start that still converges needs; keeps a mistyped setting from running for hours.
const MOST_UPDATES: u32 = 1000;
/// Residual above which a start is dropped, metres: it has left the canonical body's surroundings (thesis A.3.2).
const DIVERGENCE: f64 = 1.0;
/// Distance below which two roots of a point are one, metres: above the tolerances that are searched to, below what a scan resolves.
const MERGE_DISTANCE: f64 = 1e-4;

/// How exact a root is, and when a start is given up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchSettings {
    /// Residual below which a start has converged, metres.
    pub tolerance: f64,
    /// Updates of a start before it is given up.
    pub updates: u32,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self { tolerance: 1e-5, updates: 50 }
    }
}

impl SearchSettings {
    pub(crate) fn validate(&self) -> Result<()> {
        if !(self.tolerance > 0.0 && self.tolerance.is_finite()) {
            let (name, found) = ("the search's tolerance", self.tolerance.to_string());
            return Err(Error::Value { name, found, expected: "a positive, finite number of metres".to_owned() });
        }
        if !(1..=MOST_UPDATES).contains(&self.updates) {
            let (name, found) = ("the search's number of updates", self.updates.to_string());
            return Err(Error::Value { name, found, expected: format!("1 to {MOST_UPDATES}") });
        }
        Ok(())
    }
}

/// Finds the canonical candidates of deformed points (N). `labels` holds their parts (N); without, the full group starts.
///
/// ```
/// # use glam::Affine3A;
/// # use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
/// # use xavatar_deformer::{ExactWarp, SearchSettings, StartGroups, bone_transform, search};
/// # use xavatar_network::{KinematicTree, SkinningField};
/// let mut field = SkinningField::<f32>::new(KinematicTree::new(&[None, Some(0)])?, 2, 16, 0, 20.0)?;
/// field.initialise(&mut ChaCha8Rng::seed_from_u64(1));
/// let bones = [Affine3A::IDENTITY, Affine3A::from_rotation_z(0.4)].map(|bone| bone_transform(&bone));
/// let warp = ExactWarp::new(&field, &bones)?;
/// let found = search(&warp, &StartGroups::all(2)?, &[[0.1, 0.9, 0.0]], None, &SearchSettings::default())?;
/// assert!(found.range(0).all(|candidate| found.residuals[candidate] < 1e-5));
/// assert_eq!(found.statistics.starts, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    let plan = Plan::new(warp, groups, points, labels, settings)?;
    Ok(plan.run(|thread: &mut Thread<T, W::Workspace, ()>, block| {
        plan.find(warp, thread, block);
    }))
}

/// Finds candidates on a fast warp (a baked one), then brings each distinct root to the tolerance on the exact warp.
///
/// The first inverse Jacobian on the exact warp is that of the fast one, so that two or three evaluations a root do.
/// A root that the fast warp does not have is not found; a finer grid has more of them.
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
    let plan = Plan::new(fast, groups, points, labels, settings)?;
    Ok(plan.run(|thread: &mut Thread<T, W::Workspace, E::Workspace>, block| {
        plan.find(fast, thread, block.clone());
        plan.polish(fast, exact, thread, block);
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::affine::apply;
    use crate::warp::softmax_field::{generator, posed, vectors};
    use crate::{BakedWeights, ExactWarp, Grid, deform};

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
        let baked = BakedWeights::sample(&field, Grid::regular([-1.2; 3], [1.2; 3], [33; 3]).unwrap()).unwrap();
        let baked = baked.warp(&bones, None).unwrap();
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
        for updates in [0, u32::MAX] {
            let settings = SearchSettings { updates, ..settings.clone() };
            assert!(message(search(&warp, &groups, &points[..1], None, &settings)).contains("updates"));
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
