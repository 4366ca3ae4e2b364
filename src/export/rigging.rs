//! Avatar + motion -> [`RiggedMesh`], and what that loses.
//!
//! Three approximations, each measured in the world over the whole clip: few influences a vertex; expressions as linear
//! shapes; and, for what remains of a pose (those two, and the body model's pose correctives), as many corrective morph
//! targets as the clip needs. V vertices, T frames; metres.

use glam::{Affine3A, DMat3, DVec3, Mat3, Vec3};
use rayon::prelude::*;

use super::correctives::Correctives;
use super::influences::Influences;
use super::reference::{Frame, Motion, Reference, in_motion, skin};
use super::report::{RigReport, Sum};
use super::rig::{Animation, Morph, RiggedMesh, blend, morph, skinning_transforms};
use crate::avatar::Avatar;
use crate::body::{BodyModel, Pose};
use crate::{Error, InputError, Result};

/// Largest displacement that is left uncorrected, metres: half of what a reader should be able to tell.
const TOLERANCE: f32 = 4e-5;
/// Memory for the displacements that correctives are fitted to, bytes. Of longer clips evenly spaced frames are taken.
const FIT_MEMORY: usize = 256 << 20;
/// Shorter offsets of a morph are zero, metres: most of a body is not part of an expression.
const NEGLIGIBLE: f32 = 1e-6;
/// Where skinning has flattened the body to less than its root, 0.3 % of the thickness, a displacement would have to be hundreds
/// of times what it moves: there it stays shorter. At 3 % of the thickness 99 % of what is missing comes back.
const DAMPING: f64 = 1e-5;

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

impl Rigging {
    /// Rigs `avatar` to play `frames` (T), whose bodies take the avatar's shape. Without a body model what that would add is
    /// missing: pose correctives, and expressions other than those of the geometry field. `progress` hears of visits to
    /// frames done and their number, about three a frame.
    ///
    /// # Errors
    /// [`InputError::Value`] for settings out of range, a motion without frames, or of another skeleton; [`InputError::Mismatch`] for a body
    /// model that is not the avatar's; as [`Avatar::extract_canonical`].
    pub fn rig(
        &self,
        avatar: &Avatar,
        body: Option<&BodyModel>,
        frames: &[Pose],
        frames_per_second: f32,
        mut progress: impl FnMut(usize, usize),
    ) -> Result<(RiggedMesh, RigReport)> {
        self.check(frames, frames_per_second)?;
        let mut builder = Builder::new(avatar, body, self)?;
        let stride = builder.stride(frames.len());
        let fitted = if self.correctives == 0 { 0 } else { frames.len().div_ceil(stride) };
        let (mut done, total) = (0, fitted + 2 * frames.len());
        let mut advance = || {
            done += 1;
            progress(done, total);
        };
        let mut displacements = Vec::with_capacity(fitted);
        for (index, pose) in frames.iter().enumerate().step_by(stride).take(fitted) {
            displacements.push(builder.displacements(&builder.frame(index, pose)?));
            advance();
        }
        let correctives = Correctives::fit(displacements, self.correctives, TOLERANCE);

        let (mut pruning, mut uncorrected) = (Sum::default(), Sum::default());
        let mut animation = Animation::new(frames_per_second);
        let mut amounts: Vec<Vec<f32>> = Vec::with_capacity(frames.len());
        let mut expressions: Vec<Vec<f32>> = Vec::with_capacity(frames.len());
        for (index, pose) in frames.iter().enumerate() {
            let frame = builder.frame(index, pose)?;
            let transforms = builder.transforms(&frame);
            pruning.add(&skin(&builder.influences, &transforms, &frame.points), &frame.posed);
            uncorrected.add(&skin(&builder.influences, &transforms, &builder.expressed(&frame)), &frame.posed);
            amounts.push(correctives.weights(&builder.displacements(&frame)));
            animation.push(&frame.motion);
            expressions.push(frame.motion.expression);
            advance();
        }
        builder.add_correctives(correctives, &mut amounts);
        for (expression, amounts) in expressions.iter().zip(&amounts) {
            animation.morph_weights.extend(expression.iter().chain(amounts));
        }

        // Of what is written, not of how it was made.
        let rigged = builder.rigged(animation);
        let mut corrected = Sum::default();
        for (index, pose) in frames.iter().enumerate() {
            corrected.add(&rigged.posed(index), &builder.frame(index, pose)?.posed);
            advance();
        }
        let cut = builder.influences.kept.iter().map(|kept| (1.0 - kept).max(0.0));
        let report = RigReport {
            most_influences: builder.reference.most_influences(),
            cut_weight_mean: cut.clone().map(f64::from).sum::<f64>() / cut.len().max(1) as f64,
            cut_weight_max: cut.fold(0.0, f32::max),
            pruning: pruning.deviation(),
            uncorrected: uncorrected.deviation(),
            corrected: corrected.deviation(),
            correctives: builder.morphs.len() - builder.reference.expression_count(),
            dropped_components: builder.reference.dropped_components,
        };
        Ok((rigged, report))
    }

    /// The same to look at: without correctives, and without measuring what is lost, which take most of the time.
    ///
    /// # Errors
    /// As [`rig`](Self::rig).
    pub fn rig_to_look_at(
        &self,
        avatar: &Avatar,
        body: Option<&BodyModel>,
        frames: &[Pose],
        frames_per_second: f32,
    ) -> Result<RiggedMesh> {
        self.check(frames, frames_per_second)?;
        let builder = Builder::new(avatar, body, self)?;
        let mut animation = Animation::new(frames_per_second);
        for (index, pose) in frames.iter().enumerate() {
            let motion = builder.reference.motion(pose).map_err(|error| in_motion(error, index))?;
            animation.push(&motion);
            animation.morph_weights.extend(motion.expression);
        }
        Ok(builder.rigged(animation))
    }

    fn check(&self, frames: &[Pose], frames_per_second: f32) -> Result<()> {
        if ![4, 8].contains(&self.influences) {
            return Err(Error::from(InputError::Value {
                name: "influences".into(),
                found: self.influences.to_string(),
                expected: "4 or 8".into(),
            }));
        }
        if frames.is_empty() || !(frames_per_second.is_finite() && frames_per_second > 0.0) {
            return Err(Error::from(InputError::Value {
                name: "the motion".into(),
                found: format!("{} frames at {frames_per_second} a second", frames.len()),
                expected: "at least one frame, at a positive rate".into(),
            }));
        }
        Ok(())
    }
}

/// A rig in the making.
struct Builder {
    reference: Reference,
    influences: Influences,
    /// Expressions, then correctives.
    morphs: Vec<Morph>,
}

impl Builder {
    fn new(avatar: &Avatar, body: Option<&BodyModel>, rigging: &Rigging) -> Result<Self> {
        let reference = Reference::new(avatar, body, rigging.resolution)?;
        let influences = Influences::strongest(&reference.weights, reference.joint_count(), rigging.influences);
        let expression = |(index, offsets)| Morph::new(format!("expression_{index}"), offsets);
        let morphs = reference.expressions()?.into_iter().enumerate().map(expression).collect();
        Ok(Self { reference, influences, morphs })
    }

    /// Every how many of `count` frames correctives are fitted to.
    fn stride(&self, count: usize) -> usize {
        let fit = FIT_MEMORY / (size_of::<Vec3>() * self.reference.mesh.vertices.len()).max(1);
        count.div_ceil(fit.max(2))
    }

    fn frame(&self, index: usize, pose: &Pose) -> Result<Frame> {
        self.reference.frame(pose).map_err(|error| in_motion(error, index))
    }

    fn transforms(&self, frame: &Frame) -> Vec<Affine3A> {
        skinning_transforms(&self.reference.joints, &frame.motion.rotations, frame.motion.root)
    }

    /// Canonical vertices with the expression's morphs (V).
    fn expressed(&self, frame: &Frame) -> Vec<Vec3> {
        let mut points = self.reference.mesh.vertices.clone();
        morph(&mut points, &self.morphs[..self.reference.expression_count()], &frame.motion.expression);
        points
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
            // In f64: a flattened body's matrix is squared.
            let matrix = Mat3::from(transform.matrix3).as_dmat3();
            let normal = matrix.transpose() * matrix + DMat3::from_diagonal(DVec3::splat(DAMPING));
            (normal.inverse() * (matrix.transpose() * missing.as_dvec3())).as_vec3()
        };
        (0..points.len()).into_par_iter().with_min_len(512).map(displacement).collect()
    }

    /// Adds correctives as morphs that the clip drives to at most 1, and scales their amounts (T, M) to fit.
    fn add_correctives(&mut self, correctives: Correctives, amounts: &mut [Vec<f32>]) {
        for (index, mut offsets) in correctives.fields().into_iter().enumerate() {
            let largest = amounts.iter().map(|amounts| amounts[index].abs()).fold(f32::MIN_POSITIVE, f32::max);
            offsets.iter_mut().for_each(|offset| *offset *= largest);
            amounts.iter_mut().for_each(|amounts| amounts[index] /= largest);
            self.morphs.push(Morph::new(format!("corrective_{index}"), offsets));
        }
    }

    fn rigged(&self, animation: Animation) -> RiggedMesh {
        RiggedMesh {
            mesh: self.reference.mesh.clone(),
            joints: self.reference.joints.clone(),
            parts: self.reference.parts(),
            influences: self.influences.count,
            skin_joints: self.influences.joints.clone(),
            skin_weights: self.influences.weights.clone(),
            morphs: self.morphs.clone(),
            animation,
            root: None,
        }
    }
}

impl Morph {
    pub(super) fn new(name: String, mut offsets: Vec<Vec3>) -> Self {
        let negligible = offsets.iter_mut().filter(|offset| offset.length_squared() < NEGLIGIBLE * NEGLIGIBLE);
        negligible.for_each(|offset| *offset = Vec3::ZERO);
        Self { name, offsets }
    }
}

impl Animation {
    pub(super) fn new(frames_per_second: f32) -> Self {
        Self {
            name: "motion".into(),
            frames_per_second,
            rotations: Vec::new(),
            root_translations: Vec::new(),
            morph_weights: Vec::new(),
        }
    }

    fn push(&mut self, motion: &Motion) {
        let mut rotations = motion.rotations.clone();
        if let Some(before) = self.rotations.last() {
            for (rotation, before) in rotations.iter_mut().zip(before) {
                *rotation = if rotation.dot(*before) < 0.0 { -*rotation } else { *rotation };
            }
        }
        self.rotations.push(rotations);
        self.root_translations.push(motion.root);
    }
}
