//! Bones and shape that the frames of one person share.
//!
//! A posed vertex is linear in c_b and c_s, so at fixed poses they are one least-squares problem over all frames; poses and coefficients are
//! found in turn.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fit::{BlsmFit, Free};
use super::{BlsmParameters, Columns};

/// How often poses and coefficients are found in turn.
const TURNS: usize = 3;

impl BlsmFit<'_> {
    /// The parameters of a person's registrations (F, V), with the same bones and shape in all; from `starts` or from nothing.
    pub fn person(&self, frames: &[Vec<DVec3>], starts: Option<&[BlsmParameters]>) -> Vec<BlsmParameters> {
        let own =
            |(index, frame): (usize, &Vec<DVec3>)| self.nearest(frame, Free::All, starts.map(|starts| &starts[index]));
        let mut found: Vec<BlsmParameters> = frames.par_iter().enumerate().map(own).collect();
        let mean = |of: fn(&BlsmParameters) -> &Vec<f64>| -> Vec<f64> {
            let count = found.first().map_or(0, |first| of(first).len());
            let sum = |at: usize| found.iter().map(|parameters| of(parameters)[at]).sum::<f64>();
            (0..count).map(|at| sum(at) / found.len() as f64).collect()
        };
        let (mut bones, mut shape) = (mean(|of| &of.bones), mean(|of| &of.shape));
        for _ in 0..TURNS {
            let posed = |(frame, parameters): (&Vec<DVec3>, &BlsmParameters)| {
                let start = BlsmParameters { bones: bones.clone(), shape: shape.clone(), ..parameters.clone() };
                self.nearest(frame, Free::Pose, Some(&start))
            };
            found = frames.par_iter().zip(&found).map(posed).collect();
            (bones, shape) = self.coefficients(frames, &found);
        }
        for parameters in &mut found {
            (parameters.bones, parameters.shape) = (bones.clone(), shape.clone());
        }
        found
    }

    /// The coefficients of all frames at these poses.
    fn coefficients(&self, frames: &[Vec<DVec3>], posed: &[BlsmParameters]) -> (Vec<f64>, Vec<f64>) {
        let columns = Columns::of(self.body());
        let solved: Vec<usize> = (columns.bones().start..columns.count()).collect();
        let zero = (DMatrix::zeros(solved.len(), solved.len()), DVector::zeros(solved.len()));
        let mut sums = zero;
        let equations: Vec<_> =
            frames.par_iter().zip(posed).map(|(frame, parameters)| self.of_frame(frame, parameters, &solved)).collect();
        for (matrix, gradient) in equations {
            sums = (sums.0 + matrix, sums.1 + gradient);
        }
        let before = posed.first().map_or_else(Vec::new, |first| [&first.bones[..], &first.shape].concat());
        let held = self.held().max(f64::EPSILON);
        for (place, value) in before.iter().enumerate() {
            sums.0[(place, place)] += held;
            sums.1[place] += held * value;
        }
        let step = sums.0.cholesky().map(|factor| factor.solve(&-sums.1));
        let after = |at: usize| before[at] + step.as_ref().map_or(0.0, |step| step[at]);
        let split = columns.bones;
        ((0..split).map(after).collect(), (split..before.len()).map(after).collect())
    }
}
