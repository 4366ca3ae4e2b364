//! Sums over frames that correctives are found from: nothing of a frame is kept.
//!
//! Per subject the means are taken out of features x and residuals y, which is what solving for every subject's template at the same time comes to:
//! G = sum x x^T, C = sum x y^T, Y_v = sum |y_v|^2 of the differences from the subject's means. F features, V vertices; metres.

use super::group_lasso::GroupProblem;
use glam::DVec3;
use rayon::prelude::*;
use xavatar_vector::{Matrix, MatrixMut, Write, product};

/// Vertices of one task.
const BLOCK: usize = 512;

/// The sums over n frames.
#[derive(Clone, Debug)]
pub struct Moments {
    /// F.
    pub features: usize,
    /// n.
    pub frames: usize,
    /// G (F, F).
    pub gram: Vec<f64>,
    /// Y (V).
    pub squares: Vec<f64>,
    /// C, vertex by vertex (V) of (F, 3).
    crossed: Vec<f64>,
}

/// The frames of a subject.
pub struct SubjectFrames<'a> {
    /// Of each frame (F).
    pub features: &'a [Vec<f64>],
    /// Of each frame (V).
    pub residuals: &'a [Vec<DVec3>],
}

/// What a subject's frames have in common.
pub struct Means {
    features: Vec<f64>,
    residuals: Vec<DVec3>,
}

impl SubjectFrames<'_> {
    /// Their means; none if there are no frames.
    pub fn means(&self) -> Option<Means> {
        let count = self.features.len();
        let (mut features, mut residuals) = (self.features.first()?.clone(), self.residuals.first()?.clone());
        for frame in 1..count {
            features.iter_mut().zip(&self.features[frame]).for_each(|(sum, value)| *sum += value);
            residuals.iter_mut().zip(&self.residuals[frame]).for_each(|(sum, value)| *sum += *value);
        }
        features.iter_mut().for_each(|sum| *sum /= count as f64);
        residuals.iter_mut().for_each(|sum| *sum /= count as f64);
        Some(Means { features, residuals })
    }
}

impl Moments {
    /// Of no frames.
    pub fn new(features: usize, vertices: usize) -> Self {
        let crossed = vec![0.0; vertices * features * 3];
        Self { features, frames: 0, gram: vec![0.0; features * features], squares: vec![0.0; vertices], crossed }
    }

    /// Adds frames of a subject with these means.
    pub fn add(&mut self, frames: &SubjectFrames<'_>, means: &Means) {
        let (count, width) = (frames.features.len(), self.features);
        let centred: Vec<f64> = frames
            .features
            .iter()
            .flat_map(|row| row.iter().zip(&means.features).map(|(value, mean)| value - mean))
            .collect();
        let features = || Matrix::new(&centred, count, width, width);
        product(MatrixMut::new(&mut self.gram, width, width, width), Write::Add, features().transposed(), features());
        let blocks = self.crossed.par_chunks_mut(BLOCK * width * 3).zip(self.squares.par_chunks_mut(BLOCK)).enumerate();
        blocks.for_each(|(block, (crossed, squares))| {
            let first = block * BLOCK;
            let difference =
                |frame: usize, vertex: usize| frames.residuals[frame][first + vertex] - means.residuals[first + vertex];
            for (vertex, sum) in squares.iter_mut().enumerate() {
                let own: Vec<f64> = (0..count).flat_map(|frame| difference(frame, vertex).to_array()).collect();
                *sum += own.iter().map(|value| value * value).sum::<f64>();
                product(
                    MatrixMut::new(&mut crossed[vertex * width * 3..(vertex + 1) * width * 3], width, 3, 3),
                    Write::Add,
                    features().transposed(),
                    Matrix::new(&own, count, 3, 3),
                );
            }
        });
        self.frames += count;
    }

    /// A vertex's group lasso, at these prices of groups.
    pub fn problem<'a>(&'a self, vertex: usize, prices: &'a [f64]) -> GroupProblem<'a> {
        GroupProblem { crossed: self.crossed(vertex), frames: self.frames, prices }
    }

    /// C of a vertex (F).
    pub fn crossed(&self, vertex: usize) -> &[[f64; 3]] {
        self.crossed[vertex * self.features * 3..(vertex + 1) * self.features * 3].as_chunks::<3>().0
    }
}
