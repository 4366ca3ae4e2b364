//! Fingers that are bent in the scan and straight in the fit, or the other way round: no small step leads from one to the other.
//!
//! Each hand is tried as its knuckles' landmarks have it turned, with every choice of fingers straight and bent, then with each finger half
//! bent, and refitted; what lies best is kept. Only the hand's own vertices and the scan around it are looked at. Fingers bend about z,
//! left ones to negative angles.

use std::sync::Arc;

use glam::DVec3;
use xavatar_body::{Part, PartGroup, Role, Skeleton};
use xavatar_formats::Result;

use super::schedule::{Freed, Stage};
use super::sequence::{Frame, Sequence};
use super::subject::Fitter;
use crate::landmarks::Site;
use crate::linear::{Besides, FramePose, rotation_between, so3};
use crate::target::{IndexedTarget, OrientedIndex, Seekers};
use crate::terms::{LandmarkTerm, SurfaceTerm};

/// How far the joints of a straight, a half bent and a bent finger are turned, radians each.
const BENDS: [f64; 3] = [0.05, 0.8, 1.45];
/// A hand and what it may touch are within this of its middle, metres.
const AROUND: f64 = 0.12;
/// Hands of which less is within reach of the scan are not there, metres.
const TOO_FAR: f64 = 0.03;
/// Distances beyond count no more: of surfaces and of landmarks, metres.
const FARTHEST: [f64; 2] = [0.015, 0.06];
/// What is hidden lies worse than what is on the scan, and better than what is not.
const UNSEEN: f64 = 0.5 * FARTHEST[0];
/// What a landmark's distance counts, of a surface's.
const OF_LANDMARKS: f64 = 0.5;

/// How what is tried is refitted.
const STAGE: Stage = Stage {
    name: "fingers",
    freed: Freed::Hands,
    besides: Besides { translation: false, expression: false, shape: false },
    steps: 5,
    surface: Some(SurfaceTerm {
        normal_weight: 0.02,
        reach: 0.02,
        deviation: 0.004,
        seekers: Seekers::All,
        along: 0.0,
    }),
    landmarks: Some(LandmarkTerm { deviation: 0.015, reach: 0.04, with_vertices: true }),
    shape_prior: 0.0,
    expression_prior: 0.0,
    settled: None,
};

/// The joints of a hand but for its wrist.
pub fn fingers<'a>(skeleton: &'a Skeleton, hand: &'a PartGroup) -> impl Iterator<Item = usize> + 'a {
    hand.joints.iter().copied().filter(|joint| !skeleton.joints[*joint].ends_with("wrist"))
}

/// One hand of a body, to be fitted alone.
pub(super) struct Hand<'a> {
    fitter: Fitter<'a>,
    part: Part,
    wrist: usize,
    /// The joints of each finger but the thumb, from the palm on.
    fingers: Vec<Vec<usize>>,
    /// The first joint of the thumb.
    thumb: Option<usize>,
    /// The sign of the angles by which they bend.
    sign: f64,
}

impl<'a> Fitter<'a> {
    /// The hands of the body that have fingers.
    pub(super) fn hands(&self) -> Vec<Hand<'a>> {
        let skeleton = self.model.skeleton();
        let hand = |part: Part| {
            let group = &skeleton.parts[part.index()];
            let named = |finger: &str| {
                let of_finger =
                    |joint: &&usize| skeleton.joints[**joint].trim_end_matches(['1', '2', '3']).ends_with(finger);
                group.joints.iter().filter(of_finger).copied().collect::<Vec<usize>>()
            };
            let fingers: Vec<Vec<usize>> = ["index", "middle", "ring", "pinky"]
                .map(named)
                .into_iter()
                .filter(|joints| joints.len() == 3)
                .collect();
            let sign = if group.name.starts_with("right") { 1.0 } else { -1.0 };
            let wrist = fingers.first().and_then(|joints| self.linkage.parents()[joints[0]])?;
            let vertices: Vec<usize> =
                (0..self.surface.len()).filter(|vertex| self.surface.parts[*vertex] == part).collect();
            let fitter = self.limb(&vertices, group.joints.clone());
            Some(Hand { fitter, part, wrist, thumb: named("thumb").first().copied(), fingers, sign })
        };
        let hands = skeleton.parts_of(Role::Hands).filter_map(hand);
        hands.filter(|hand| !hand.fitter.surface.is_empty()).collect()
    }
}

impl Hand<'_> {
    /// The pose with this hand and its fingers as they lie best on the scan.
    pub(super) fn settled(&self, pose: FramePose, shape: &[f64], frame: &Frame) -> Result<FramePose> {
        let around = frame.scan.around(self.middle(&pose, shape), AROUND);
        let Some(around) = around.filter(|_| !frame.unseen.contains(&self.part)) else { return Ok(pose) };
        let frame = Frame { scan: Arc::new(around), ..frame.clone() };
        let index = IndexedTarget::new(&frame.scan, 0.02)?;
        let mut best = (self.misfit(&pose, shape, &frame, &index)?, pose);
        if let Some(turned) = self.turned_as_seen(&best.1, shape, &frame) {
            self.keep_better(&mut best, turned, shape, &frame, &index)?;
        }
        let posed = self.fitter.surface.posed(&self.fitter.linkage, &best.1, shape);
        let places = posed.points.positions.iter().zip(&posed.normals);
        let distances: Vec<f64> = places.filter_map(|(v, n)| index.distance(*v, *n)).collect();
        if distances.iter().filter(|distance| **distance < TOO_FAR).count() * 2 < distances.len().max(1) {
            return Ok(best.1);
        }
        for choice in 0..1_usize << self.fingers.len() {
            let bends = |finger: usize| Some(BENDS[if (choice >> finger) & 1 == 1 { 2 } else { 0 }]);
            let tried = self.with_bends(&best.1, bends);
            self.keep_better(&mut best, tried, shape, &frame, &index)?;
        }
        for half in 0..self.fingers.len() {
            let bends = |finger: usize| (finger == half).then_some(BENDS[1]);
            let tried = self.with_bends(&best.1, bends);
            self.keep_better(&mut best, tried, shape, &frame, &index)?;
        }
        Ok(best.1)
    }

    /// The middle of the hand's vertices.
    fn middle(&self, pose: &FramePose, shape: &[f64]) -> DVec3 {
        let places = self.fitter.surface.posed(&self.fitter.linkage, pose, shape).points.positions;
        places.iter().sum::<DVec3>() / places.len() as f64
    }

    /// The pose with the wrist turned so that wrist and knuckles lie as their landmarks do, whatever the turn; none without enough of them.
    fn turned_as_seen(&self, pose: &FramePose, shape: &[f64], frame: &Frame) -> Option<FramePose> {
        let Fitter { linkage, sites, .. } = &self.fitter;
        let palm: Vec<usize> =
            [self.wrist].into_iter().chain(self.thumb).chain(self.fingers.iter().map(|joints| joints[0])).collect();
        let chain = linkage.posed(pose, shape);
        let pairs = frame.landmarks.iter().filter_map(|seen| match sites.site(seen.site).at {
            Site::Joint(joint) if palm.contains(&joint) => Some((chain.joint(joint), seen.place, 1.0)),
            _ => None,
        });
        let turn = rotation_between(&pairs.collect::<Vec<_>>())?;
        let parent = linkage.parents()[self.wrist]?;
        let mut turned = pose.clone();
        turned.rotations[self.wrist] = chain.turns[parent].transpose() * turn * chain.turns[self.wrist];
        Some(turned)
    }

    /// The pose with some fingers bent otherwise.
    fn with_bends(&self, pose: &FramePose, bends: impl Fn(usize) -> Option<f64>) -> FramePose {
        let mut bent = pose.clone();
        for (finger, joints) in self.fingers.iter().enumerate() {
            if let Some(bend) = bends(finger) {
                joints.iter().for_each(|joint| bent.rotations[*joint] = so3::exp(self.bent(*joint, bend)));
            }
        }
        bent
    }

    /// Refits a pose that is tried, and keeps it if it lies better than the best.
    fn keep_better(
        &self,
        best: &mut (f64, FramePose),
        tried: FramePose,
        shape: &[f64],
        frame: &Frame,
        scan: &IndexedTarget,
    ) -> Result<()> {
        let mut sequence = Sequence { poses: vec![tried], shape: shape.to_vec() };
        let bare = vec![0.0; self.fitter.surface.len()];
        sequence.run(&self.fitter, &STAGE, std::slice::from_ref(frame), &bare)?;
        let fitted = sequence.poses.remove(0);
        let misfit = self.misfit(&fitted, shape, frame, scan)?;
        if misfit < best.0 {
            *best = (misfit, fitted);
        }
        Ok(())
    }

    /// The turn of a finger's joint that is bent, otherwise relaxed.
    fn bent(&self, joint: usize, bend: f64) -> DVec3 {
        let relaxed = self.fitter.prior.mean(joint);
        DVec3::new(relaxed.x, relaxed.y, self.sign * bend)
    }

    /// How badly hand and scan lie on each other, both ways, and on landmarks; metres.
    fn misfit(&self, pose: &FramePose, shape: &[f64], frame: &Frame, scan: &IndexedTarget) -> Result<f64> {
        let posed = self.fitter.surface.posed(&self.fitter.linkage, pose, shape);
        let own = OrientedIndex::new(&posed.points.positions, &posed.normals, 0.02)?;
        let mean = |sum: f64, count: usize| sum / count.max(1) as f64;
        let places = posed.points.positions.iter().zip(&posed.normals);
        let to_scan = places.map(|(v, n)| scan.distance(*v, *n).map_or(UNSEEN, |distance| distance.min(FARTHEST[0])));
        let to_scan = mean(to_scan.sum(), self.fitter.surface.len());
        let points = frame.scan.points().iter().zip(frame.scan.normals());
        let to_hand =
            mean(points.map(|(p, n)| own.nearest(*p, *n).1.min(FARTHEST[0])).sum(), frame.scan.points().len());
        let sites = &self.fitter.sites;
        let tips = sites.vertices().posed(&self.fitter.linkage, &posed.chain);
        let is_own = |joint: usize| self.fingers.iter().flatten().any(|own| *own == joint);
        let distances: Vec<f64> = (frame.landmarks.iter())
            .filter_map(|seen| match sites.site(seen.site).at {
                Site::Joint(joint) => is_own(joint).then(|| posed.chain.joint(joint).distance(seen.place)),
                Site::Vertex(tip) => {
                    let of_this = tips.positions[tip].distance(seen.place);
                    let name = &sites.site(seen.site).name;
                    self.fingers
                        .iter()
                        .any(|joints| self.fitter.model.skeleton().joints[joints[2]].starts_with(name.as_str()))
                        .then_some(of_this)
                }
            })
            .map(|distance| distance.min(FARTHEST[1]))
            .collect();
        Ok(to_scan + to_hand + OF_LANDMARKS * mean(distances.iter().sum(), distances.len()))
    }
}
