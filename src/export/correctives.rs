//! What a few influences and expressions leave of a clip, as morph targets: c_t ~ sum_m a_tm d_m.
//!
//! c_t (V) are the displacements in the bind pose that would make frame t exact. Greedy, for the worst vertex and not the
//! mean: the frame with the largest remaining displacement gives the next target, orthogonal to those before, until all are
//! below a tolerance or there are as many targets as allowed. T frames, V vertices; metres.

use glam::Vec3;
use rayon::prelude::*;

/// Vertices of one sum: partial sums are added in order, so that threads change nothing.
const BLOCK: usize = 4096;

/// Orthogonal displacement fields.
#[derive(Clone, Debug, Default)]
pub(super) struct Correctives {
    /// (M, V), of unit length over all vertices together.
    fields: Vec<Vec<Vec3>>,
}

impl Correctives {
    /// At most `most` fields that bring every vertex of every frame (T, V) below `tolerance`.
    pub(super) fn fit(mut frames: Vec<Vec<Vec3>>, most: usize, tolerance: f32) -> Self {
        let mut fields: Vec<Vec<Vec3>> = Vec::new();
        while fields.len() < most {
            let farthest: Vec<f32> = frames.iter().map(|frame| longest(frame)).collect();
            let Some(worst) = (0..frames.len()).max_by(|a, b| farthest[*a].total_cmp(&farthest[*b])) else { break };
            if farthest[worst] <= tolerance {
                break;
            }
            let scale = 1.0 / dot(&frames[worst], &frames[worst]).sqrt();
            let field: Vec<Vec3> = frames[worst].iter().map(|offset| *offset * scale as f32).collect();
            frames.iter_mut().for_each(|frame| {
                take(frame, &field);
            });
            fields.push(field);
        }
        Self { fields }
    }

    /// How much of each field (M) is in a frame (V).
    pub(super) fn weights(&self, frame: &[Vec3]) -> Vec<f32> {
        let mut rest = frame.to_vec();
        self.fields.iter().map(|field| take(&mut rest, field)).collect()
    }

    pub(super) fn fields(self) -> Vec<Vec<Vec3>> {
        self.fields
    }
}

/// Takes what a frame has of a field out of it; how much that was.
fn take(frame: &mut [Vec3], field: &[Vec3]) -> f32 {
    let amount = dot(frame, field) as f32;
    frame.par_iter_mut().zip(field).with_min_len(BLOCK).for_each(|(offset, part)| *offset -= *part * amount);
    amount
}

fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    let sum = |(a, b): (&[Vec3], &[Vec3])| a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum::<f64>();
    let partial: Vec<f64> = a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK)).map(sum).collect();
    partial.iter().sum()
}

fn longest(frame: &[Vec3]) -> f32 {
    frame.par_iter().with_min_len(BLOCK).map(|offset| offset.length_squared()).reduce(|| 0.0, f32::max).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    // Frames made of three fields need three, and come back from their weights.
    #[test]
    fn frames_of_three_fields_need_three() {
        let field = |k: usize| {
            move |v: usize| Vec3::new((v * k) as f32 % 7.0, (v + k) as f32 % 5.0, (v % (k + 2)) as f32) * 1e-3
        };
        let frame = |t: usize| -> Vec<Vec3> {
            let at = |v| (1..4).map(|k| field(k)(v) * ((t * k) as f32 * 0.7).sin()).sum::<Vec3>();
            (0..50).map(at).collect()
        };
        let frames: Vec<_> = (0..20).map(frame).collect();
        let correctives = Correctives::fit(frames.clone(), 10, 1e-5);
        assert_eq!(correctives.fields.len(), 3);
        for frame in &frames {
            let weights = correctives.weights(frame);
            for (vertex, offset) in frame.iter().enumerate() {
                let sum: Vec3 =
                    correctives.fields.iter().zip(&weights).map(|(field, weight)| field[vertex] * *weight).sum();
                assert!(sum.distance(*offset) < 2e-5);
            }
        }
        assert_eq!(Correctives::fit(frames, 2, 1e-5).fields.len(), 2);
        assert!(Correctives::fit(vec![vec![Vec3::ZERO; 9]; 4], 5, 1e-5).fields.is_empty());
    }
}
