//! A first guess from a scan's shape alone: the body in several poses, turned all ways, fitted coarsely; the one that lies best wins.
//!
//! The score is the mean distance between body and scan both ways, in place and normal, cut at 15 cm. It tells right from wrong:
//! [`GOOD`] lies between the two. Standing people are found, and what is like a pose that is given; who bends far or twists is not, and the score says so.

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use xavatar_formats::Result;

use super::clothing::Clothing;
use super::schedule::{COARSE, FROM_LANDMARKS};
use super::sequence::{Frame, Sequence};
use super::subject::Fitter;
use crate::linear::{FramePose, so3};
use crate::target::{IndexedTarget, OrientedIndex, Seekers};

/// Ways the body faces in the guesses.
const FACINGS: usize = 8;
/// Turns of the left shoulder and elbow, radians; right ones are mirrored.
const ARMS: [[[f64; 3]; 2]; 6] = [
    [[0.0, 0.0, -1.15], [0.0; 3]],
    [[0.0; 3], [0.0; 3]],
    [[0.0, 0.0, 0.9], [0.0; 3]],
    [[0.0, 0.0, -1.0], [0.0, -1.6, 0.0]],
    [[0.0, 0.0, -0.6], [0.0; 3]],
    [[0.0, -1.2, -0.3], [0.0, -0.3, 0.0]],
];
/// The left and the right arm of each guess.
const PAIRS: [[usize; 2]; 8] = [[0, 0], [1, 1], [2, 2], [3, 3], [4, 4], [5, 5], [2, 0], [0, 2]];
/// Guesses of each facing that are fitted, and of all that are fitted longer.
const KEPT: [usize; 2] = [2, 4];
/// What turning a normal by a radian counts as in the score, and where distances are cut, metres.
const SCORE: [f64; 2] = [0.06, 0.15];

/// Guesses that score less are right, metres.
pub const GOOD: f64 = 0.0615;

/// A pose found without landmarks.
#[derive(Clone, Debug)]
pub struct Guess {
    /// The pose.
    pub pose: FramePose,
    /// The shape that it was found with (S).
    pub shape: Vec<f64>,
    /// How far body and scan are apart, metres.
    pub score: f64,
}

impl Guess {
    /// Whether it is likely to be right.
    pub fn is_good(&self) -> bool {
        self.score <= GOOD
    }
}

impl Fitter<'_> {
    /// The best guess for a scan, by a fitter of coarse density. A pose that is given is tried among the others, turned all ways.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if a body stops being a number.
    pub fn guess(&self, frame: &Frame, given: Option<&FramePose>) -> Result<Option<Guess>> {
        let clothing = Clothing::assumed(self, false).thickness;
        let scan = IndexedTarget::new(&frame.scan, SCORE[0])?;
        let shape = vec![0.0; self.linkage.extents().shapes];
        let scored = |pose: FramePose, shape: Vec<f64>| {
            let score = self.score(&pose, &shape, &scan, &clothing)?;
            Ok(Guess { pose, shape, score })
        };
        let mut first = Vec::new();
        for facing in 0..FACINGS {
            let yaw = std::f64::consts::TAU * facing as f64 / FACINGS as f64;
            let guesses = PAIRS.par_iter().map(|pair| scored(self.standing(*pair, yaw, frame), shape.clone()));
            let mut guesses: Vec<Guess> = guesses.collect::<Result<_>>()?;
            sort(&mut guesses);
            guesses.truncate(KEPT[0]);
            first.extend(guesses);
            if let Some(given) = given {
                let turned = FramePose { rotations: turned(given, yaw), ..given.clone() };
                first.push(scored(self.grounded(turned, frame), shape.clone())?);
            }
        }
        let fitted = |guess: Guess, steps: [usize; 2]| {
            let mut sequence = Sequence { poses: vec![guess.pose], shape: guess.shape };
            for (stage, steps) in COARSE.iter().zip(steps) {
                let stage = super::schedule::Stage { steps, ..*stage };
                sequence.run(self, &stage, std::slice::from_ref(frame), &clothing)?;
            }
            scored(sequence.poses.remove(0), sequence.shape)
        };
        let mut guesses: Vec<Guess> =
            first.into_par_iter().map(|guess| fitted(guess, [3, 2])).collect::<Result<_>>()?;
        sort(&mut guesses);
        guesses.truncate(KEPT[1]);
        let mut guesses: Vec<Guess> =
            guesses.into_par_iter().map(|guess| fitted(guess, [4, 8])).collect::<Result<_>>()?;
        sort(&mut guesses);
        Ok(guesses.into_iter().next())
    }

    /// Which of some poses, fitted to the landmarks, lies best on the scan; by a fitter of coarse density.
    ///
    /// # Errors
    /// As [`guess`](Self::guess).
    pub fn best_of(&self, poses: Vec<FramePose>, frame: &Frame) -> Result<Option<Guess>> {
        let clothing = Clothing::assumed(self, false).thickness;
        let scan = IndexedTarget::new(&frame.scan, SCORE[0])?;
        let shape = vec![0.0; self.linkage.extents().shapes];
        let scored = |pose: FramePose| {
            let mut sequence = Sequence { poses: vec![pose], shape: shape.clone() };
            for stage in FROM_LANDMARKS {
                sequence.run(self, &stage, std::slice::from_ref(frame), &clothing)?;
            }
            let pose = sequence.poses.remove(0);
            Ok(Guess { score: self.score(&pose, &sequence.shape, &scan, &clothing)?, pose, shape: sequence.shape })
        };
        let mut guesses: Vec<Guess> = poses.into_iter().map(scored).collect::<Result<_>>()?;
        sort(&mut guesses);
        Ok(guesses.into_iter().next())
    }

    /// How far body and scan are apart.
    fn score(&self, pose: &FramePose, shape: &[f64], scan: &IndexedTarget, clothing: &[f64]) -> Result<f64> {
        let posed = self.surface.posed(&self.linkage, pose, shape);
        let outside = |vertex: usize| posed.points.positions[vertex] + posed.normals[vertex] * clothing[vertex];
        let body: Vec<DVec3> = (0..self.surface.len()).map(outside).collect();
        let own = OrientedIndex::new(&body, &posed.normals, SCORE[0])?;
        let to_scan: Vec<f64> = body.iter().zip(&posed.normals).filter_map(|(v, n)| scan.distance(*v, *n)).collect();
        let to_scan = to_scan.iter().map(|distance| distance.min(SCORE[1])).sum::<f64>() / to_scan.len().max(1) as f64;
        let seekers = scan.target.seekers(Seekers::Few);
        let count = seekers.len() as f64;
        let to_body: f64 = seekers.map(|(point, normal)| own.nearest(point, normal).1.min(SCORE[1])).sum();
        Ok(to_scan + to_body / count)
    }

    /// Standing on the ground below the scan's middle.
    fn standing(&self, [left, right]: [usize; 2], yaw: f64, frame: &Frame) -> FramePose {
        let joints = &self.model.skeleton().joints;
        let joint = |name: &str| joints.iter().position(|joint| joint == name);
        let mirrored = DVec3::new(1.0, -1.0, -1.0);
        let arms = [
            (joint("left_shoulder"), DVec3::from(ARMS[left][0])),
            (joint("left_elbow"), DVec3::from(ARMS[left][1])),
            (joint("right_shoulder"), DVec3::from(ARMS[right][0]) * mirrored),
            (joint("right_elbow"), DVec3::from(ARMS[right][1]) * mirrored),
        ];
        let turns = arms.into_iter().filter_map(|(joint, turn)| Some((joint?, turn)));
        let mut pose = FramePose::turned(self.linkage.extents(), self.prior.means().chain(turns));
        pose.rotations[0] = so3::exp(DVec3::Y * yaw);
        self.grounded(pose, frame)
    }

    /// The pose moved onto the ground below the scan's middle.
    fn grounded(&self, mut pose: FramePose, frame: &Frame) -> FramePose {
        let shape = vec![0.0; self.linkage.extents().shapes];
        let body = self.surface.posed(&self.linkage, &pose, &shape).points.positions;
        pose.translation = ground(frame.scan.points()) - ground(&body);
        pose
    }
}

/// The rotations of a pose that is turned about the vertical as a whole.
fn turned(pose: &FramePose, yaw: f64) -> Vec<DMat3> {
    let root = so3::exp(DVec3::Y * yaw) * pose.rotations[0];
    [root].into_iter().chain(pose.rotations.iter().copied().skip(1)).collect()
}

/// The median of points over the ground, at the height of the lowest.
fn ground(points: &[DVec3]) -> DVec3 {
    let ascending = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let [x, y, z] = [0, 1, 2].map(ascending);
    DVec3::new(x[x.len() / 2], y[0], z[z.len() / 2])
}

fn sort(guesses: &mut [Guess]) {
    guesses.sort_by(|a, b| a.score.total_cmp(&b.score));
}
