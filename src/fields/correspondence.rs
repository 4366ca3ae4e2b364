//! A posed avatar as a field: deformed points to canonical correspondences and their geometry (thesis eq. 4.4-4.6).
//!
//! Every valid candidate of the search is a point of the body; their union wins: maximum occupancy, minimum distance.
//! N points; canonical and deformed coordinates in metres, the registration's translation subtracted.

use glam::Vec3;
use xavatar_deformer::{Candidates, SearchSettings, StartGroups};

use super::{FieldEvaluator, PosedWarp};
use crate::Result;

/// The winning correspondence of a deformed point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// x_c.
    pub canonical: [f32; 3],
    /// Occupancy logit or signed distance there.
    pub value: f32,
}

/// One pose of an avatar; [`Poser::pose`](super::Poser::pose) makes it.
#[derive(Debug)]
pub struct PosedField<'a> {
    /// The avatar's fields under the pose's condition.
    pub evaluator: FieldEvaluator<'a>,
    /// The pose's warp.
    pub warp: PosedWarp<'a>,
    /// Which bones start the search.
    pub groups: &'a StartGroups,
    /// When starts are given up.
    pub settings: &'a SearchSettings,
    /// The canonical box; what is outside it is no part of the body.
    pub bounds: (Vec3, Vec3),
    /// How the pose moves the nodes of a skinning field that is a grid (R).
    pub(super) node_offsets: Option<Vec<[f32; 3]>>,
}

impl PosedField<'_> {
    /// The winning correspondence of each point (N) with its part's label (N); none where the search found no root.
    ///
    /// # Errors
    /// Those of the search: a point that is not finite, bones that cannot be inverted.
    pub fn correspondences(&self, points: &[[f32; 3]], labels: &[u8]) -> Result<Vec<Option<Correspondence>>> {
        let candidates = self.candidates(points, labels)?;
        let values = self.evaluator.values(&candidates.points);
        let representation = self.evaluator.fields().geometry.representation;
        let winners = self.winners(&candidates, |index, best| representation.prefers(values[index], values[best]));
        let correspondence =
            |index: usize| Correspondence { canonical: candidates.points[index], value: values[index] };
        Ok(winners.into_iter().map(|winner| winner.map(correspondence)).collect())
    }

    /// All candidates of each point (N) with its part's label (N).
    ///
    /// # Errors
    /// As [`PosedField::correspondences`].
    pub fn candidates(&self, points: &[[f32; 3]], labels: &[u8]) -> Result<Candidates<f32>> {
        self.warp.candidates(self.groups, self.settings, points, labels)
    }

    /// The candidate of each point that is in the canonical box and that no other is preferred to.
    pub fn winners(
        &self,
        candidates: &Candidates<f32>,
        is_preferred: impl Fn(usize, usize) -> bool,
    ) -> Vec<Option<usize>> {
        self.winners_among(candidates, |_, _| true, is_preferred)
    }

    /// As [`PosedField::winners`], of those candidates that `is_possible` for (point, candidate).
    pub fn winners_among(
        &self,
        candidates: &Candidates<f32>,
        is_possible: impl Fn(usize, usize) -> bool,
        is_preferred: impl Fn(usize, usize) -> bool,
    ) -> Vec<Option<usize>> {
        let (low, high) = self.bounds;
        let in_bounds = |index: usize| {
            let point = Vec3::from_array(candidates.points[index]);
            point.cmpge(low).all() && point.cmple(high).all()
        };
        let better = |best: usize, index: usize| if is_preferred(index, best) { index } else { best };
        let winner = |point: usize| {
            let possible = candidates.range(point).filter(|&index| in_bounds(index) && is_possible(point, index));
            possible.reduce(better)
        };
        (0..candidates.len()).map(winner).collect()
    }

    /// Adds what cotangents of roots (K) pull back to on a skinning field that is a grid, to the gradient of its logits.
    ///
    /// # Errors
    /// As [`Skinning::pull_back_roots`](super::Skinning::pull_back_roots).
    pub fn pull_back_roots(
        &self,
        roots: &[[f32; 3]],
        cotangents: impl FnOnce() -> Vec<[f32; 3]>,
        gradient: &mut [f32],
    ) -> Result<()> {
        let skinning = &self.evaluator.fields().skinning;
        skinning.pull_back_roots(&self.warp, self.node_offsets.as_deref(), roots, cotangents, gradient)
    }
}
