//! Avatar + motion -> [`RiggedMesh`], and what that loses.
//!
//! Three approximations, each measured in the world over the whole clip: few influences a vertex; expressions as linear
//! shapes; and, for what remains of a pose (those two, and the body model's pose correctives), as many corrective morph
//! targets as the clip needs. V vertices, T frames; metres.

use glam::{Affine3A, Mat3, Vec3};
use rayon::prelude::*;

use super::correctives::Correctives;
use super::expressions::EXPRESSIONS;
use super::influences::Influences;
use super::reference::{Frame, Reference, skin};
use super::rig::{Animation, Morph, RiggedMesh, blend, morph, skinning_transforms};
use crate::avatar::Avatar;
use crate::body::{BodyModel, BodyParameters, JOINTS};
use crate::{Error, Result};

/// Largest displacement that is left uncorrected, metres: half of what a reader should be able to tell.
const TOLERANCE: f32 = 4e-5;
/// Memory for the displacements that correctives are fitted to, bytes. Of longer clips evenly spaced frames are taken.
const FIT_MEMORY: usize = 256 << 20;
/// Where skinning has flattened the body, a displacement is not worth more than this per unit of what it moves.
const DAMPING: f32 = 1e-4;

/// How an avatar is rigged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigging {
    /// Cells along the longest side of the box around the canonical body.
    pub resolution: usize,
    /// Joints that hold a vertex: 4 or 8.
    pub influences: usize,
    /// Most corrective morph targets.
    pub correctives: usize,
}

/// Distances between the rig's vertices and the exact ones, over all vertices of all frames, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// The mean.
    pub mean: f64,
    /// The largest.
    pub max: f32,
}

/// What a rig loses against the exact motion of the same surface.
#[derive(Clone, Debug, PartialEq)]
pub struct RigReport {
    /// Most joints that hold a vertex of the avatar.
    pub most_influences: usize,
    /// Share of the skinning weights that was cut, mean over the vertices.
    pub cut_weight_mean: f64,
    /// The same, of the vertex that lost most.
    pub cut_weight_max: f32,
    /// What the cut weights alone do.
    pub pruning: Deviation,
    /// The rig without correctives.
    pub uncorrected: Deviation,
    /// The rig with them.
    pub corrected: Deviation,
    /// How many corrective morph targets there are.
    pub correctives: usize,
    /// Smaller components of the canonical surface that were left out.
    pub dropped_components: usize,
}

impl Rigging {
    /// Rigs `avatar` to play `frames` (T), whose bodies take the avatar's shape. Without a body model what that would add is
    /// missing: pose correctives, and expressions other than those of the geometry field. `progress` hears of frames done
    /// and their number; every frame is visited twice.
    ///
    /// # Errors
    /// [`Error::Value`] for settings out of range, a motion without frames, or hands relative to a body model that is not given;
    /// [`Error::Mismatch`] for a body model that is not the avatar's; as [`Avatar::extract_canonical`].
    pub fn rig(
        &self,
        avatar: &Avatar,
        body: Option<&BodyModel>,
        frames: &[BodyParameters],
        frames_per_second: f32,
        mut progress: impl FnMut(usize, usize),
    ) -> Result<(RiggedMesh, RigReport)> {
        self.check(frames, frames_per_second)?;
        let reference = Reference::new(avatar, body, self.resolution)?;
        let influences = Influences::strongest(&reference.weights, JOINTS, self.influences);
        let expression = |(index, offsets)| Morph { name: format!("expression_{index}"), offsets };
        let mut builder = Builder {
            morphs: reference.expressions()?.into_iter().enumerate().map(expression).collect(),
            reference,
            influences,
        };
        let fitted = (FIT_MEMORY / (size_of::<Vec3>() * builder.reference.mesh.vertices.len()).max(1))
            .clamp(2, frames.len().max(2));
        let stride = frames.len().div_ceil(fitted);
        let total = frames.len().div_ceil(stride) + frames.len();
        let mut done = 0;
        let mut advance = || {
            done += 1;
            progress(done, total);
        };
        let correctives = match self.correctives {
            0 => Correctives::default(),
            most => {
                let mut displacements = Vec::new();
                for parameters in frames.iter().step_by(stride) {
                    let frame = builder.reference.frame(parameters)?;
                    displacements.push(builder.displacements(&frame));
                    advance();
                }
                Correctives::fit(displacements, most, TOLERANCE)
            }
        };
        let mut animation = Animation {
            name: "motion".into(),
            frames_per_second,
            rotations: Vec::new(),
            root_translations: Vec::new(),
            morph_weights: Vec::new(),
        };
        let (mut pruning, mut uncorrected) = (Sum::default(), Sum::default());
        let mut amounts: Vec<Vec<f32>> = Vec::new();
        for parameters in frames {
            let frame = builder.reference.frame(parameters)?;
            let transforms = builder.transforms(&frame);
            pruning.add(&skin(&builder.influences, &transforms, &frame.points), &frame.posed);
            uncorrected.add(&builder.expressive(&frame, &transforms), &frame.posed);
            amounts.push(correctives.weights(&builder.displacements(&frame)));
            animation.push(&frame);
            advance();
        }
        let count = amounts.first().map_or(0, Vec::len);
        builder.add_correctives(correctives, &mut amounts);
        for (parameters, amounts) in frames.iter().zip(amounts) {
            animation.morph_weights.extend(parameters.expression.iter().chain(&amounts));
        }
        let Builder { reference, influences, morphs } = builder;
        let cut = influences.kept.iter().map(|kept| (1.0 - kept).max(0.0));
        let mut report = RigReport {
            most_influences: reference.most_influences(),
            cut_weight_mean: cut.clone().map(f64::from).sum::<f64>() / influences.kept.len().max(1) as f64,
            cut_weight_max: cut.fold(0.0, f32::max),
            pruning: pruning.deviation(),
            uncorrected: uncorrected.deviation(),
            corrected: Deviation::default(),
            correctives: count,
            dropped_components: reference.dropped_components,
        };
        let rigged = RiggedMesh {
            mesh: reference.mesh.clone(),
            joints: reference.joints.clone(),
            influences: influences.count,
            skin_joints: influences.joints,
            skin_weights: influences.weights,
            morphs,
            animation,
        };
        // Of what is written, not of how it was made.
        let mut corrected = Sum::default();
        for (frame, parameters) in frames.iter().enumerate() {
            corrected.add(&rigged.posed(frame), &reference.frame(parameters)?.posed);
        }
        report.corrected = corrected.deviation();
        Ok((rigged, report))
    }

    fn check(&self, frames: &[BodyParameters], frames_per_second: f32) -> Result<()> {
        if ![4, 8].contains(&self.influences) {
            return Err(Error::Value {
                name: "influences".into(),
                found: self.influences.to_string(),
                expected: "4 or 8".into(),
            });
        }
        if frames.is_empty() || !(frames_per_second.is_finite() && frames_per_second > 0.0) {
            return Err(Error::Value {
                name: "the motion".into(),
                found: format!("{} frames at {frames_per_second} a second", frames.len()),
                expected: "at least one frame, at a positive rate".into(),
            });
        }
        Ok(())
    }
}

/// A rig in the making.
struct Builder<'a> {
    reference: Reference<'a>,
    influences: Influences,
    /// Expressions, then correctives.
    morphs: Vec<Morph>,
}

impl Builder<'_> {
    fn transforms(&self, frame: &Frame) -> Vec<Affine3A> {
        skinning_transforms(&self.reference.joints, &frame.rotations, frame.root)
    }

    /// Canonical vertices with the expression's morphs (V).
    fn expressed(&self, frame: &Frame) -> Vec<Vec3> {
        let mut points = self.reference.mesh.vertices.clone();
        morph(&mut points, &self.morphs[..EXPRESSIONS], &frame.expression);
        points
    }

    /// The rig without correctives (V).
    fn expressive(&self, frame: &Frame, transforms: &[Affine3A]) -> Vec<Vec3> {
        skin(&self.influences, transforms, &self.expressed(frame))
    }

    /// What has to be added to the canonical vertices (V) for the frame to be exact: with A the blended matrix and r what is
    /// missing in the world, (A^T A + damping)^-1 A^T r.
    fn displacements(&self, frame: &Frame) -> Vec<Vec3> {
        let transforms = self.transforms(frame);
        let points = self.expressed(frame);
        let displacement = |vertex: usize| {
            let (joints, weights) = self.influences.row(vertex);
            let transform = blend(&transforms, joints, weights);
            let missing = frame.posed[vertex] - transform.transform_point3(points[vertex]);
            let matrix = Mat3::from(transform.matrix3);
            let normal = matrix.transpose() * matrix + Mat3::from_diagonal(Vec3::splat(DAMPING));
            normal.inverse() * (matrix.transpose() * missing)
        };
        (0..points.len()).into_par_iter().with_min_len(512).map(displacement).collect()
    }

    /// Adds correctives as morphs that the clip drives to at most 1, and scales their amounts (T, M) to fit.
    fn add_correctives(&mut self, correctives: Correctives, amounts: &mut [Vec<f32>]) {
        for (index, mut offsets) in correctives.fields().into_iter().enumerate() {
            let largest = amounts.iter().map(|amounts| amounts[index].abs()).fold(f32::MIN_POSITIVE, f32::max);
            offsets.iter_mut().for_each(|offset| *offset *= largest);
            amounts.iter_mut().for_each(|amounts| amounts[index] /= largest);
            self.morphs.push(Morph { name: format!("corrective_{index}"), offsets });
        }
    }
}

impl Animation {
    fn push(&mut self, frame: &Frame) {
        let mut rotations = frame.rotations.to_vec();
        if let Some(before) = self.rotations.last() {
            for (rotation, before) in rotations.iter_mut().zip(before) {
                *rotation = if rotation.dot(*before) < 0.0 { -*rotation } else { *rotation };
            }
        }
        self.rotations.push(rotations);
        self.root_translations.push(frame.root);
    }
}

/// A deviation while it is summed.
#[derive(Default)]
struct Sum {
    sum: f64,
    count: usize,
    max: f32,
}

impl Sum {
    fn add(&mut self, vertices: &[Vec3], exact: &[Vec3]) {
        for (vertex, exact) in vertices.iter().zip(exact) {
            let distance = vertex.distance(*exact);
            self.sum += f64::from(distance);
            self.max = self.max.max(distance);
        }
        self.count += vertices.len();
    }

    fn deviation(&self) -> Deviation {
        Deviation { mean: self.sum / self.count.max(1) as f64, max: self.max }
    }
}
