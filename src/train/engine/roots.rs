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
                let mut distances: Vec<f32> =
                    candidates.points.par_iter().map(|point| self.distances.at(*point)).collect();
                let is_possible: Vec<bool> = (0..origins.len())
                    .flat_map(|point| candidates.range(point).map(move |index| (point, index)))
                    .map(|(point, index)| match origins[point] {
                        Origin::Depth(depth) => may_train(distances[index], is_inside[point], depth),
                        Origin::Place { place, within } => {
                            distances[index] = Vec3::from_array(candidates.points[index]).distance(place);
                            distances[index] < within
                        }
                    })
                    .collect();
                posed.winners_among(
                    candidates,
                    |_, index| is_possible[index],
                    |index, best| distances[index] < distances[best],
                )
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

/// Whether a point, inside the captured body or not and so deep in the registered one, may be trained through a root this far from the
/// unclothed body, metres.
fn may_train(distance: f32, is_inside: bool, depth: f32) -> bool {
    distance < CERTAINLY_OUTSIDE && (is_inside || distance > -(depth + DEPTH_SLACK))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_surface_is_trained_deeper_in_the_body_than_it_is_and_nothing_far_from_it() {
        assert!(may_train(0.02, false, 0.0) && may_train(-0.001, false, 0.0) && !may_train(-0.005, false, 0.0));
        assert!(may_train(-0.005, false, 0.006) && !may_train(-0.03, false, 0.006));
        assert!(may_train(0.02, true, 0.0) && may_train(-0.03, true, 0.0) && !may_train(0.2, true, 0.0));
    }
}
