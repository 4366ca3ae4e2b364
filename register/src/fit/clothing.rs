//! Clothing as one distance a vertex, the same in all frames: how far the scan stands off the body there.
//!
//! D_i = median over frames of n_i . (q - v_i), q the scan's nearest to v_i + D_i n_i, of matches that are near, face the same way and miss the normal by
//! little; smoothed over neighbours of the same part. Skin is where the body is, so that hands and face say how large
//! people are; what stands far off a face is hair or a beard. Metres.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use xavatar_body::Role;
use xavatar_formats::Result;

use super::sequence::{Frame, Sequence};
use super::subject::Fitter;
use crate::target::IndexedTarget;
use crate::view::Sight;

/// Assumed before anything is known.
const ASSUMED: f64 = 0.008;
/// Cloth is no thinner and no thicker.
const THICKNESS: [f64; 2] = [-0.005, 0.06];
/// What stands farther off a face is hair, not skin.
const HAIR: f64 = 0.004;
/// Matches count that miss the normal by less.
const MISS: f64 = 0.02;
/// Matches count that are nearer.
const FARTHEST: f64 = 0.06;
/// Cosine between normals from which matches count.
const SAME_WAY: f64 = 0.5;
/// Share of the frames that have to see a vertex.
const SEEN: f64 = 0.2;
/// Neighbours that are smoothed over, the vertex itself among them; the distance to the middle one is the scale.
const NEIGHBOURS: usize = 9;
/// What turning a normal by a radian counts as in the search.
const NORMAL_WEIGHT: f64 = 0.03;

/// How far clothing stands off each vertex of a fitter's surface.
#[derive(Clone, Debug)]
pub struct Clothing {
    /// D (N), metres.
    pub thickness: Vec<f64>,
    /// Half the range that holds half of the frames' distances (N); NaN where no frame sees the vertex.
    pub spread: Vec<f64>,
    bare: bool,
    neighbours: Arc<Vec<Vec<(usize, f64)>>>,
}

impl Clothing {
    /// What is assumed before anything is known: thin clothes on the body, or none anywhere.
    pub fn assumed(fitter: &Fitter<'_>, bare: bool) -> Self {
        let surface = &fitter.surface;
        let thickness =
            surface.roles.iter().map(|role| if *role == Role::Body && !bare { ASSUMED } else { 0.0 }).collect();
        let neighbours = (0..surface.len()).into_par_iter().map(|vertex| fitter.neighbours(vertex)).collect();
        Self { thickness, spread: vec![f64::NAN; surface.len()], bare, neighbours: Arc::new(neighbours) }
    }

    /// The same of known thickness and spread (N).
    #[must_use]
    pub fn measured(self, thickness: Vec<f64>, spread: Vec<f64>) -> Self {
        Self { thickness, spread, ..self }
    }

    /// What the frames show, given their poses.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if a body stops being a number.
    pub fn learn(&mut self, fitter: &Fitter<'_>, sequence: &Sequence, frames: &[Frame]) -> Result<()> {
        let distances: Vec<Vec<f64>> = (sequence.poses.par_iter().zip(frames))
            .map(|(pose, frame)| {
                let scan = IndexedTarget::new(&frame.scan, NORMAL_WEIGHT)?;
                let posed = fitter.surface.posed(&fitter.linkage, pose, &sequence.shape);
                let distance = |vertex: usize| {
                    let (v, n) = (posed.points.positions[vertex], posed.normals[vertex]);
                    self.distance(&scan, v, n, self.thickness[vertex])
                };
                Ok((0..fitter.surface.len()).map(distance).collect())
            })
            .collect::<Result<_>>()?;
        let enough = ((frames.len() as f64 * SEEN).ceil() as usize).max(2.min(frames.len()));
        let (raw, spread): (Vec<f64>, Vec<f64>) = (0..fitter.surface.len())
            .map(|vertex| {
                let mut seen: Vec<f64> =
                    distances.iter().map(|frame| frame[vertex]).filter(|d| d.is_finite()).collect();
                seen.sort_by(f64::total_cmp);
                if seen.len() < enough {
                    return (f64::NAN, f64::NAN);
                }
                let at = |share: f64| quantile(&seen, share);
                (at(0.5), (at(0.75) - at(0.25)) / 2.0)
            })
            .unzip();
        self.spread = spread;
        for (vertex, role) in fitter.surface.roles.iter().enumerate() {
            let known = self.neighbours[vertex].iter().filter(|(other, _)| raw[*other].is_finite());
            let (sum, weights) = known
                .fold((0.0, 0.0), |(sum, weights), (other, weight)| (sum + weight * raw[*other], weights + weight));
            let smooth = if weights > 0.0 { sum / weights } else { 0.0 };
            self.thickness[vertex] = worn(*role, smooth, self.bare);
        }
        Ok(())
    }

    /// How far the scan is off a vertex along its normal; NaN where it does not say.
    fn distance(&self, scan: &IndexedTarget, v: DVec3, n: DVec3, thickness: f64) -> f64 {
        let outside = v + n * thickness;
        if !matches!(scan.target.sight(outside, n), Sight::Seen(_)) {
            return f64::NAN;
        }
        let (nearest, _) = scan.index.nearest(outside, n);
        let way = scan.target.points()[nearest] - v;
        let along = way.dot(n);
        let is_match = (way - n * along).length() <= MISS
            && along.abs() <= FARTHEST
            && n.dot(scan.target.normals()[nearest]) >= SAME_WAY;
        if is_match { along } else { f64::NAN }
    }
}

/// What is worn over a vertex that the scan stands off by this distance.
fn worn(role: Role, distance: f64, bare: bool) -> f64 {
    match role {
        Role::Body if !bare => distance.clamp(THICKNESS[0], THICKNESS[1]),
        Role::Face if distance > HAIR => distance.min(THICKNESS[1]),
        _ => 0.0,
    }
}

/// The value below which a share of ascending values is, linearly between them.
pub(super) fn quantile(ascending: &[f64], share: f64) -> f64 {
    let place = share * (ascending.len() - 1) as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    ascending[low] + (ascending[high] - ascending[low]) * (place - place.floor())
}

impl Fitter<'_> {
    /// The vertices of the same part around one, with weights that fall with their distance at rest.
    fn neighbours(&self, vertex: usize) -> Vec<(usize, f64)> {
        let surface = &self.surface;
        let distance = |other: usize| surface.rest[other].distance(surface.rest[vertex]);
        let mut nearest: Vec<(usize, f64)> = (0..surface.len()).map(|other| (other, distance(other))).collect();
        nearest.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        nearest.truncate(NEIGHBOURS);
        let scale = nearest.get(NEIGHBOURS / 2).map_or(1.0, |(_, distance)| distance.max(1e-9));
        let same_part = nearest.into_iter().filter(|(other, _)| surface.parts[*other] == surface.parts[vertex]);
        same_part.map(|(other, distance)| (other, (-(distance / scale).powi(2)).exp())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_wear_hair_and_hands_nothing() {
        assert_eq!(worn(Role::Body, 0.012, false), 0.012);
        assert_eq!([worn(Role::Body, 0.012, true), worn(Role::Hands, 0.012, false)], [0.0, 0.0]);
        assert_eq!([worn(Role::Face, 0.012, false), worn(Role::Face, 0.012, true)], [0.012, 0.012]);
        assert_eq!([worn(Role::Face, 0.003, false), worn(Role::Face, -0.02, false)], [0.0, 0.0]);
    }
}
