//! Broyden's method on many starts at once: x with A(x) x~ = x_d (thesis ch. 4.2.3).
//!
//! Only unfinished starts are evaluated: a finished one leaves the active set at once and the next waiting one takes
//! its place, so the field always sees full batches. A start's result does not depend on its companions.

use xavatar_network::Real;
use xavatar_vector::vectorised;

use super::lanes::{LANES, Pack, Status};
use super::limits::Limits;
use crate::affine::{apply, inverse, rotation};
use crate::{BoneTransform, Jacobian, Warp};

/// Where one search begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start<T> {
    /// x_d.
    pub target: [T; 3],
    /// The first x.
    pub point: [T; 3],
    /// The first H; the inverse of the blended 3 x 3 if absent, which converges more often than the full Jacobian's.
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

/// The active set of one thread.
#[derive(Debug)]
pub(crate) struct ActiveSet<T> {
    points: Vec<[T; 3]>,
    transforms: Vec<BoneTransform<T>>,
    packs: Vec<Pack<T>>,
    slots: Vec<Slot<T>>,
}

/// What belongs to a slot and is no part of the iteration.
#[derive(Clone, Copy, Debug)]
struct Slot<T> {
    index: usize,
    inverse: Option<Jacobian<T>>,
    fresh: bool,
}

impl<T> Default for ActiveSet<T> {
    fn default() -> Self {
        Self { points: Vec::new(), transforms: Vec::new(), packs: Vec::new(), slots: Vec::new() }
    }
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
    let mut waiting = starts.enumerate();
    let mut evaluations = 0;
    active.clear(W::BATCH);
    for (index, start) in waiting.by_ref().take(W::BATCH) {
        active.push(index, &start);
    }
    while !active.points.is_empty() {
        warp.transforms(workspace, &active.points, &mut active.transforms[..active.points.len()]);
        evaluations += active.points.len();
        active.advance(limits);
        let mut slot = 0;
        while slot < active.points.len() {
            let pack = &active.packs[slot / LANES];
            let outcome = match pack.status(slot % LANES) {
                Status::Unfinished => {
                    active.points[slot] = pack.point(slot % LANES);
                    slot += 1;
                    continue;
                }
                Status::Converged => Outcome::Converged,
                Status::Diverged => Outcome::Diverged,
                Status::Exhausted => Outcome::Exhausted,
            };
            let (point, squared) = pack.best(slot % LANES);
            finish(active.slots[slot].index, Solution { point, residual: squared.sqrt(), outcome });
            match waiting.next() {
                Some((index, start)) => {
                    active.place(slot, index, &start);
                    slot += 1;
                }
                None => active.remove(slot),
            }
        }
    }
    evaluations
}

impl<T: Real> ActiveSet<T> {
    fn clear(&mut self, batch: usize) {
        self.points.clear();
        self.slots.clear();
        self.transforms.resize(batch, [T::zero(); 12]);
        self.packs.resize(batch.div_ceil(LANES), Pack::default());
    }

    fn push(&mut self, index: usize, start: &Start<T>) {
        let slot = self.points.len();
        self.points.push(start.point);
        self.slots.push(Slot { index, inverse: start.inverse, fresh: true });
        self.place(slot, index, start);
    }

    fn place(&mut self, slot: usize, index: usize, start: &Start<T>) {
        self.points[slot] = start.point;
        self.slots[slot] = Slot { index, inverse: start.inverse, fresh: true };
        self.packs[slot / LANES].begin(slot % LANES, start.point, start.target);
    }

    /// Moves the last start into a slot.
    fn remove(&mut self, slot: usize) {
        let last = self.points.len() - 1;
        self.points.swap_remove(slot);
        self.slots.swap_remove(slot);
        if slot < last {
            let moved = self.packs[last / LANES].clone();
            self.packs[slot / LANES].copy_lane(slot % LANES, &moved, last % LANES);
        }
    }

    /// One iteration of every start, given the blended transforms at their points.
    fn advance(&mut self, limits: &Limits<T>) {
        let Self { points, transforms, packs, slots } = self;
        let packed = packs.iter_mut().zip(points.chunks(LANES)).zip(transforms.chunks(LANES));
        vectorised(
            #[inline(always)]
            || {
                for (((pack, points), transforms), slots) in packed.zip(slots.chunks_mut(LANES)) {
                    let mut images = [[T::zero(); LANES]; 3];
                    for (lane, ((&point, transform), slot)) in points.iter().zip(transforms).zip(slots).enumerate() {
                        let [x, y, z] = apply(transform, point);
                        (images[0][lane], images[1][lane], images[2][lane]) = (x, y, z);
                        if slot.fresh {
                            slot.fresh = false;
                            pack.set_inverse(lane, slot.inverse.or_else(|| inverse(&rotation(transform))));
                        }
                    }
                    pack.advance(&images, limits);
                }
            },
        );
    }
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
