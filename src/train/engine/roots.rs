//! From a frame's draws to canonical points: the search, and which of a point's roots it is trained through.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use xavatar_deformer::{Candidates, SearchStatistics};
use xavatar_network::Representation;

use crate::Result;
use crate::config::Assignment;
use crate::fields::{CERTAINLY_OUTSIDE, PosedField};
use crate::train::drawn::{Drawn, Origin};
use crate::train::losses::CanonicalBatch;
use crate::train::supervision::{Curve, DistanceGrid};

/// How much deeper in the canonical body than in the registered one a root of the surface may be, metres. Bones keep depths; a deeper root
/// is one of skin that folds over itself, and to train through it would hollow the body.
const DEPTH_SLACK: f32 = 0.002;

/// Finds and chooses roots.
#[derive(Debug)]
pub(super) struct RootFinder {
    pub assignment: Assignment,
    /// Signed distance to the canonical body.
    pub distances: Arc<DistanceGrid>,
}

/// A frame in canonical space.
pub(super) struct Roots {
    pub batch: CanonicalBatch<f32>,
    pub statistics: SearchStatistics,
    /// Points inside the body without any correspondence.
    pub inside_without_root: usize,
}

impl RootFinder {
    /// Finds the canonical correspondences of a frame's points.
    pub fn find(&self, drawn: Drawn, posed: &PosedField) -> Result<Roots> {
        let Drawn { condition, samples, anchors, pose, .. } = drawn;
        let representation = posed.evaluator.fields().geometry.representation;
        let inside = |target: f32| match representation {
            Representation::Occupancy => target > 0.5,
            Representation::SignedDistance => target < 0.0,
        };
        // One search for all kinds of points: the frame's warp is made once.
        let points = [samples.on_points.as_slice(), &samples.off_points].concat();
        let labels = [samples.on_labels.as_slice(), &samples.off_labels].concat();
        let found = posed.candidates(&points, &labels)?;
        // What was captured of a point: on the surface, outside, or inside.
        let on = samples.on_points.iter().map(|_| false);
        let off = samples.off_targets.iter().map(|target| inside(*target));
        let is_inside: Vec<bool> = on.chain(off).collect();
        let origins = [samples.on_origins.as_slice(), &samples.off_origins].concat();
        let assigned = self.assign(posed, &found, &is_inside, &origins);
        let (assigned_on, assigned_off) = assigned.split_at(samples.on_points.len());

        let mut batch = CanonicalBatch {
            condition,
            bones: pose.bones.clone(),
            anchors,
            implicit_gradient: true,
            ..CanonicalBatch::default()
        };
        let curve = Curve::over(posed.bounds);
        for (winner, index) in in_spatial_order(&curve, assigned_on, &found) {
            batch.on_points.push(found.points[winner]);
            batch.on_normals.push(samples.on_normals[index]);
            batch.on_colours.push(samples.on_colours[index]);
        }
        for (winner, index) in in_spatial_order(&curve, assigned_off, &found) {
            batch.off_points.push(found.points[winner]);
            batch.off_targets.push(samples.off_targets[index]);
        }
        let lost = assigned_off.iter().zip(&samples.off_targets).filter(|(winner, _)| winner.is_none());
        let inside_without_root = lost.filter(|(_, target)| inside(**target)).count();
        Ok(Roots { batch, statistics: found.statistics, inside_without_root })
    }

    /// The candidate that each point is trained through, given which points are inside, and where they come from.
    fn assign(
        &self,
        posed: &PosedField,
        candidates: &Candidates<f32>,
        is_inside: &[bool],
        origins: &[Origin],
    ) -> Vec<Option<usize>> {
        match self.assignment {
            Assignment::Field => {
                let values = posed.evaluator.values(&candidates.points);
                let representation = posed.evaluator.fields().geometry.representation;
                posed.winners(candidates, |index, best| representation.prefers(values[index], values[best]))
            }
            Assignment::Body => {
                let distances: Vec<f32> = candidates.points.par_iter().map(|point| self.distances.at(*point)).collect();
                let rank_of = |point: usize, index: usize| {
                    rank(origins[point], is_inside[point], candidates.points[index], distances[index])
                };
                let ranks: Vec<Option<f32>> = (0..candidates.len())
                    .flat_map(|point| candidates.range(point).map(move |index| rank_of(point, index)))
                    .collect();
                let is_possible = |_: usize, index: usize| ranks[index].is_some();
                posed.winners_among(candidates, is_possible, |index, best| ranks[index] < ranks[best])
            }
        }
    }
}

/// The candidates that points are trained through, with the points' places, neighbours in space near each other: a grid's
/// entries are then still in the cache when the next point needs them.
fn in_spatial_order(curve: &Curve, assigned: &[Option<usize>], found: &Candidates<f32>) -> Vec<(usize, usize)> {
    let key = |winner: usize| curve.place(Vec3::from_array(found.points[winner]));
    let places = assigned.iter().enumerate().filter_map(|(index, winner)| Some(((*winner)?, index)));
    let mut keyed: Vec<_> = places.map(|(winner, index)| (key(winner), winner, index)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, winner, index)| (winner, index)).collect()
}

/// The lower, the rather a point from `origin`, inside the captured body or not, is trained through a root this `distance` from the unclothed
/// body, metres; none if it must not be.
fn rank(origin: Origin, is_inside: bool, root: [f32; 3], distance: f32) -> Option<f32> {
    let (rank, is_possible) = match origin {
        Origin::Depth(depth) => (distance, is_inside || distance > -(depth + DEPTH_SLACK)),
        Origin::Place { place, within } => {
            let away = place.distance(Vec3::from_array(root));
            (away, away < within)
        }
    };
    (is_possible && distance < CERTAINLY_OUTSIDE).then_some(rank)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_surface_is_trained_deeper_in_the_body_than_it_is_and_nothing_far_from_it() {
        let may_train = |distance: f32, is_inside: bool, depth: f32| {
            rank(Origin::Depth(depth), is_inside, [0.0; 3], distance).is_some()
        };
        assert!(may_train(0.02, false, 0.0) && may_train(-0.001, false, 0.0) && !may_train(-0.005, false, 0.0));
        assert!(may_train(-0.005, false, 0.006) && !may_train(-0.03, false, 0.006));
        assert!(may_train(0.02, true, 0.0) && may_train(-0.03, true, 0.0) && !may_train(0.2, true, 0.0));
    }

    // A hand that rests in the hip has a root there, deeper in the body than its own.
    #[test]
    fn registered_surfaces_are_trained_at_their_own_place() {
        let of_hand = Origin::Place { place: Vec3::new(0.8, 0.1, 0.0), within: 0.02 };
        let hand = rank(of_hand, false, [0.8, 0.103, 0.001], 0.003).unwrap();
        let finger_beside = rank(of_hand, false, [0.8, 0.115, 0.0], -0.004).unwrap();
        assert!(hand < finger_beside, "{hand} {finger_beside}");
        assert_eq!(rank(of_hand, true, [0.13, -0.31, 0.03], -0.012), None);
    }
}
