//! How well one frame's body lies on its scan, by what can be measured without knowing the truth.
//!
//! Of each part that was seen: the distance between the outside of its clothing and the scan, and the share of it that is far. Of each hand: how far its
//! joints are from their landmarks. Of the scan: the share of its points that are far from the body. Metres in, millimetres out.

use std::collections::BTreeMap;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use xavatar_body::{Part, PartGroup, Role};
use xavatar_formats::{Error, Result};

use super::hands::fingers;
use super::sequence::{Frame, Sequence};
use super::subject::Fitter;
use crate::landmarks::{Seen, Site};
use crate::linear::PosedChain;
use crate::view::Sight;

/// A vertex is far from the scan beyond this.
const FAR: f64 = 0.015;
/// A scan's point is far from the body beyond this.
const UNCOVERED: f64 = 0.025;
/// A part says nothing of which a camera sees a smaller share.
const SEEN: f64 = 0.2;

/// One part in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartQuality {
    /// Median distance of its vertices from the scan, clothing counted, millimetres.
    pub median_mm: f64,
    /// Share of its vertices farther than 15 mm.
    pub far: f64,
}

/// One frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameQuality {
    /// By the names of the parts that were seen.
    pub parts: BTreeMap<String, PartQuality>,
    /// Mean distance of the finger joints of each hand from their landmarks, millimetres; of hands that have some.
    #[serde(default)]
    pub landmarks_mm: BTreeMap<String, f64>,
    /// Share of the scan's points farther than 25 mm from the body.
    pub uncovered: f64,
    /// Components of joints that are beyond their limits.
    pub beyond_limits: usize,
    /// Limbs that are not where the scan has them, each with its distance, as `check` and `train` find them; none where that was not looked at.
    #[serde(default)]
    pub slipped: Vec<String>,
}

impl Fitter<'_> {
    /// Measures every frame.
    ///
    /// # Errors
    /// [`Error::Value`] if a body or a scan is not finite.
    pub fn qualities(&self, sequence: &Sequence, frames: &[Frame], clothing: &[f64]) -> Result<Vec<FrameQuality>> {
        let shape = &sequence.shape;
        let quality = |(pose, frame)| self.quality(pose, shape, frame, clothing);
        sequence.poses.par_iter().zip(frames).map(quality).collect()
    }

    fn quality(
        &self,
        pose: &crate::linear::FramePose,
        shape: &[f64],
        frame: &Frame,
        clothing: &[f64],
    ) -> Result<FrameQuality> {
        let posed = self.surface.posed(&self.linkage, pose, shape);
        let outside = |vertex: usize| posed.points.positions[vertex] + posed.normals[vertex] * clothing[vertex];
        let body: Vec<[f32; 3]> = (0..self.surface.len()).map(|vertex| outside(vertex).as_vec3().to_array()).collect();
        let scan: Vec<[f32; 3]> = frame.scan.points().iter().map(|point| point.as_vec3().to_array()).collect();
        let [of_body, of_scan] = [tree(&body)?, tree(&scan)?];
        let distance = |tree: &ImmutableKdTree<f32, 3>, point: &[f32; 3]| {
            f64::from(tree.query(point).nearest_one::<SquaredEuclidean<f32>>().execute().distance).sqrt()
        };
        let mut by_part: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for (vertex, part) in self.surface.parts.iter().enumerate() {
            let distance = match frame.scan.sight(outside(vertex), posed.normals[vertex]) {
                Sight::Seen(behind) if behind < FAR => distance(&of_scan, &body[vertex]),
                Sight::Open(way) => way.length(),
                Sight::Seen(_) | Sight::Hidden => continue,
            };
            by_part.entry(self.part_name(*part)).or_default().push(distance);
        }
        let vertices = |name: &str| self.surface.parts.iter().filter(|part| self.part_name(**part) == name).count();
        by_part.retain(|name, seen| seen.len() as f64 >= SEEN * vertices(name) as f64);
        // Vertices stand for their surroundings: a point between them is as far from the surface as it is from their plane, or less.
        let spacing = 0.5 * self.spacing();
        let uncovered = frame.scan.points().iter().zip(&scan).step_by(20);
        let count = uncovered.len().max(1) as f64;
        let uncovered =
            uncovered.filter(|(_, point)| distance(&of_body, point) > UNCOVERED + spacing).count() as f64 / count;
        let part = |(name, mut distances): (&str, Vec<f64>)| {
            distances.sort_by(f64::total_cmp);
            let far = distances.iter().filter(|distance| **distance > FAR).count() as f64 / distances.len() as f64;
            (name.to_owned(), PartQuality { median_mm: 1e3 * distances[distances.len() / 2], far })
        };
        Ok(FrameQuality {
            parts: by_part.into_iter().map(part).collect(),
            landmarks_mm: self.distances_to_landmarks(&posed.chain, frame),
            uncovered,
            beyond_limits: self.prior.beyond_limits(pose).len(),
            slipped: Vec::new(),
        })
    }

    fn part_name(&self, part: Part) -> &str {
        &self.model.skeleton().parts[part.index()].name
    }

    /// How far the fingers of each hand are from their landmarks.
    fn distances_to_landmarks(&self, chain: &PosedChain, frame: &Frame) -> BTreeMap<String, f64> {
        let skeleton = self.model.skeleton();
        let of_hand = |part: &PartGroup| {
            let fingers: Vec<usize> = fingers(skeleton, part).collect();
            let distance = |seen: &Seen| match self.sites.site(seen.site).at {
                Site::Joint(joint) if fingers.contains(&joint) => Some(chain.joint(joint).distance(seen.place)),
                _ => None,
            };
            let distances: Vec<f64> = frame.landmarks.iter().filter_map(distance).collect();
            (!distances.is_empty())
                .then(|| (part.name.clone(), 1e3 * distances.iter().sum::<f64>() / distances.len() as f64))
        };
        skeleton.parts_of(Role::Hands).filter_map(|part| of_hand(&skeleton.parts[part.index()])).collect()
    }

    /// Metres between neighbouring vertices of the body's surface.
    fn spacing(&self) -> f64 {
        crate::surface_model::Density::FINE.largest()
    }
}

fn tree(points: &[[f32; 3]]) -> Result<ImmutableKdTree<f32, 3>> {
    let wrong =
        |found: String| Error::Value { name: "points to measure".into(), found, expected: "finite points".into() };
    if points.is_empty() || points.as_flattened().iter().any(|value| !value.is_finite()) {
        return Err(wrong(format!("{} points, not all finite", points.len())));
    }
    ImmutableKdTree::new_from_slice(points).map_err(|failure| wrong(failure.to_string()))
}
