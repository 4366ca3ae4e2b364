//! Arms that are rolled the wrong way, and forearms that point where no arm is: a forearm is round, and where the scan lacks a hand
//! nothing holds it, so that no small step leads from one to the other.
//!
//! Each arm is tried with its forearm rolled, then with its upper arm rolled and its elbow bent in several ways, refitted alone each time,
//! and the one kept that lies best: on the scan, on its landmarks, and with joints as they usually are. Left elbows bend to negative angles
//! about y; arms at rest lie along x.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use xavatar_formats::Result;

use super::schedule::{Freed, Stage};
use super::sequence::{Frame, Sequence};
use super::subject::Fitter;
use crate::landmarks::Site;
use crate::linear::{Besides, FramePose, NormalEquations, Unknowns, so3};
use crate::target::{IndexedTarget, Seekers};
use crate::terms::{LandmarkTerm, SurfaceTerm};

/// Rolls of the forearm that are tried, besides the one it has, radians.
const FOREARM_ROLLS: [f64; 3] = [-FRAC_PI_2, FRAC_PI_2, PI];
/// Rolls of the upper arm.
const ROLLS: [f64; 4] = [0.0, -FRAC_PI_2, FRAC_PI_2, PI];
/// Bends of the elbow with each of them.
const BENDS: [f64; 3] = [0.2, 1.0, 1.9];
/// Distances beyond count no more: of surfaces and of landmarks, metres.
const FARTHEST: [f64; 2] = [0.04, 0.08];
/// What is hidden lies worse than what is on the scan, and better than what is not.
const UNSEEN: f64 = 0.5 * FARTHEST[0];
/// What a landmark's distance counts, of a surface's.
const OF_LANDMARKS: f64 = 0.5;
/// What a joint counts that is a deviation from its usual turn, metres.
const UNUSUAL: f64 = 0.0003;
/// What turning a normal by a radian counts as in the search, metres.
const NORMAL_WEIGHT: f64 = 0.03;

/// How what is tried is refitted.
const STAGE: Stage = Stage {
    name: "arm",
    freed: Freed::Arms,
    besides: Besides { translation: false, expression: false, shape: false },
    steps: 5,
    surface: Some(SurfaceTerm {
        normal_weight: NORMAL_WEIGHT,
        reach: 0.06,
        deviation: 0.008,
        // A scan's point does not tell which limb it is of.
        seekers: Seekers::None,
        along: 0.1,
    }),
    landmarks: Some(LandmarkTerm { deviation: 0.02, reach: 0.1, with_vertices: true }),
    shape_prior: 0.0,
    expression_prior: 0.0,
    settled: None,
};

/// One arm of a body, to be fitted alone.
pub(super) struct Arm<'a> {
    fitter: Fitter<'a>,
    shoulder: usize,
    elbow: usize,
    /// Joints from the elbow on, which landmarks may be of.
    below: Vec<usize>,
    /// The sign of the angles by which the elbow bends.
    sign: f64,
    /// How far clothing stands off each of its vertices.
    clothing: Vec<f64>,
    own: Unknowns,
}

impl<'a> Fitter<'a> {
    /// The arms of the body, with clothing of this thickness over each vertex of its surface.
    pub(super) fn arms(&self, clothing: &[f64]) -> Vec<Arm<'a>> {
        let names = &self.model.skeleton().joints;
        let joint = |name: String| names.iter().position(|joint| *joint == name);
        let arm = |(side, sign): (&str, f64)| {
            let joints = ["shoulder", "elbow", "wrist"].map(|name| joint(format!("{side}_{name}")));
            let [shoulder, elbow, wrist] = [joints[0]?, joints[1]?, joints[2]?];
            let is_below = |joint: usize, top: usize| {
                std::iter::successors(Some(joint), |joint| self.linkage.parents()[*joint]).any(|joint| joint == top)
            };
            let is_of_arm = |vertex: &usize| {
                self.leading_joint(self.surface.vertices[*vertex]).is_some_and(|joint| is_below(joint, shoulder))
            };
            let vertices: Vec<usize> = (0..self.surface.len()).filter(is_of_arm).collect();
            let fitter = self.limb(&vertices, vec![shoulder, elbow, wrist]);
            (!vertices.is_empty()).then(|| Arm {
                clothing: vertices.iter().map(|vertex| clothing[*vertex]).collect(),
                below: (0..names.len()).filter(|joint| is_below(*joint, elbow)).collect(),
                own: fitter.unknowns(&STAGE),
                fitter,
                shoulder,
                elbow,
                sign,
            })
        };
        [("left", -1.0), ("right", 1.0)].into_iter().filter_map(arm).collect()
    }

    /// The joint that a vertex of the model follows most.
    fn leading_joint(&self, vertex: usize) -> Option<usize> {
        let joints = self.model.skeleton().joints.len();
        let weights = &self.model.skinning_weights()[vertex * joints..(vertex + 1) * joints];
        (0..joints).max_by(|one, other| weights[*one].total_cmp(&weights[*other]))
    }
}

impl Arm<'_> {
    /// The pose with this arm as it lies best.
    pub(super) fn settled(&self, pose: FramePose, shape: &[f64], frame: &Frame) -> Result<FramePose> {
        let index = IndexedTarget::new(&frame.scan, NORMAL_WEIGHT)?;
        let found = pose.clone();
        let mut best = (self.misfit(&pose, shape, frame, &index)?, pose);
        for tried in self.others(&found) {
            let mut sequence = Sequence { poses: vec![tried], shape: shape.to_vec() };
            sequence.run(&self.fitter, &STAGE, std::slice::from_ref(frame), &self.clothing)?;
            let fitted = sequence.poses.remove(0);
            let misfit = self.misfit(&fitted, shape, frame, &index)?;
            if misfit < best.0 {
                best = (misfit, fitted);
            }
        }
        Ok(best.1)
    }

    /// The arm rolled and bent otherwise.
    fn others(&self, pose: &FramePose) -> Vec<FramePose> {
        let rolled = |joint: usize, roll: f64| {
            let mut pose = pose.clone();
            pose.rotations[joint] *= so3::exp(DVec3::X * roll);
            pose
        };
        let bent = |(roll, bend): (f64, f64)| {
            let mut pose = rolled(self.shoulder, roll);
            pose.rotations[self.elbow] = so3::exp(DVec3::Y * self.sign * bend);
            pose
        };
        let bends = ROLLS.into_iter().flat_map(|roll| BENDS.map(|bend| (roll, bend)));
        FOREARM_ROLLS.into_iter().map(|roll| rolled(self.elbow, roll)).chain(bends.map(bent)).collect()
    }

    /// How badly the arm lies on the scan, on its landmarks, and with its joints; metres.
    fn misfit(&self, pose: &FramePose, shape: &[f64], frame: &Frame, scan: &IndexedTarget) -> Result<f64> {
        let Fitter { linkage, surface, sites, prior, .. } = &self.fitter;
        let mean = |distances: Vec<f64>| distances.iter().sum::<f64>() / distances.len().max(1) as f64;
        let posed = surface.posed(linkage, pose, shape);
        let to_scan = |(vertex, normal): (usize, &DVec3)| {
            let outside = posed.points.positions[vertex] + *normal * self.clothing[vertex];
            scan.distance(outside, *normal).map_or(UNSEEN, |distance| distance.min(FARTHEST[0]))
        };
        let is_seen = |(vertex, _): &(usize, &DVec3)| !frame.unseen.contains(&surface.parts[*vertex]);
        let to_scan = mean(posed.normals.iter().enumerate().filter(is_seen).map(to_scan).collect());
        let to_landmark = |seen: &crate::landmarks::Seen| match sites.site(seen.site).at {
            Site::Joint(joint) if self.below.contains(&joint) => {
                Some(posed.chain.joint(joint).distance(seen.place).min(FARTHEST[1]))
            }
            _ => None,
        };
        let to_landmarks = mean(frame.landmarks.iter().filter_map(to_landmark).collect());
        let mut unusual = NormalEquations::new(self.own.count());
        prior.add(pose, &self.own, &mut unusual);
        Ok(to_scan + OF_LANDMARKS * to_landmarks + UNUSUAL * unusual.cost)
    }
}
