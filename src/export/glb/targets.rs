//! Morph targets as programs take them: every weight of the clip is within [0, 1].
//!
//! Blender clamps weights to the range of its sliders. A morph d whose weights a_t leave it, l <= a_t <= h, is written as
//!
//! ```text
//! a_t d = b_t (h - l) d + 1 (l d),   b_t = (a_t - l) / (h - l) in [0, 1]
//! ```
//!
//! with l d of all such morphs as one target that the clip holds at 1. Linear in a_t, so nothing changes between frames either.
//! Expressions, which people move by hand, stay there in units of their coefficients, and the clip moves a copy. V vertices,
//! M morphs, N targets, T frames.

use std::borrow::Cow;

use glam::Vec3;

use crate::export::{Morph, RiggedMesh};

/// Morph targets (N) and what the clip makes of them.
pub(super) struct Targets<'a> {
    pub(super) names: Vec<Cow<'a, str>>,
    /// (N, V)
    pub(super) offsets: Vec<Cow<'a, [Vec3]>>,
    /// (N, T)
    weights: Vec<Vec<f32>>,
    frames: usize,
}

impl<'a> Targets<'a> {
    pub(super) fn of(rigged: &'a RiggedMesh) -> Self {
        let frames = rigged.animation.frames();
        let mut targets = Self { names: Vec::new(), offsets: Vec::new(), weights: Vec::new(), frames };
        let mut constant = vec![Vec3::ZERO; rigged.mesh.vertices.len()];
        let mut copies = Vec::new();
        for (index, morph) in rigged.morphs.iter().enumerate() {
            let weights = rigged.animation.morph_weights.iter().skip(index).step_by(rigged.morphs.len());
            let weights: Vec<f32> = weights.copied().collect();
            let low = weights.iter().copied().fold(0.0, f32::min);
            let high = weights.iter().copied().fold(0.0, f32::max);
            if low >= 0.0 && high <= 1.0 {
                targets.push(morph.name.as_str().into(), morph.offsets.as_slice().into(), weights);
                continue;
            }
            constant.iter_mut().zip(&morph.offsets).for_each(|(sum, offset)| *sum += *offset * low);
            let offsets: Vec<Vec3> = morph.offsets.iter().map(|offset| *offset * (high - low)).collect();
            let shares: Vec<f32> = weights.iter().map(|weight| (weight - low) / (high - low)).collect();
            if morph.is_expression() {
                targets.push(morph.name.as_str().into(), morph.offsets.as_slice().into(), vec![0.0; frames]);
                copies.push((format!("clip_{}", morph.name), offsets, shares));
            } else {
                targets.push(morph.name.as_str().into(), offsets.into(), shares);
            }
        }
        for (name, offsets, shares) in copies {
            targets.push(name.into(), offsets.into(), shares);
        }
        if constant.iter().any(|offset| *offset != Vec3::ZERO) {
            let constant = Morph::new("clip_constant".into(), constant);
            targets.push(constant.name.into(), constant.offsets.into(), vec![1.0; frames]);
        }
        targets
    }

    fn push(&mut self, name: Cow<'a, str>, offsets: Cow<'a, [Vec3]>, weights: Vec<f32>) {
        self.names.push(name);
        self.offsets.push(offsets);
        self.weights.push(weights);
    }

    /// What the clip makes of the targets, frame by frame (T, N).
    pub(super) fn keys(&self) -> Vec<f32> {
        (0..self.frames).flat_map(|frame| self.weights.iter().map(move |weights| weights[frame])).collect()
    }
}
