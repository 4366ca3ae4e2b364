//! A subject's fit from first to last: stages on some frames for shape and clothing, then every other frame with both known.

use rayon::prelude::*;
use xavatar_body::{BodyModel, PartLabels};
use xavatar_formats::Result;

use super::clothing::Clothing;
use super::schedule::{COARSE, DRESSED, DRESSED_IN_PART, FROM_LANDMARKS, Freed, Limbs, ROUNDS, STAGES, Stage};
use super::sequence::{Frame, Sequence};
use crate::landmarks::Sites;
use crate::linear::{Besides, FramePose, Linkage, Unknowns};
use crate::surface_model::{Density, SurfaceModel};
use crate::terms::PosePrior;

/// What a body model is to a fit.
pub struct Fitter<'a> {
    /// The model.
    pub model: &'a BodyModel,
    /// Its skeleton.
    pub linkage: Linkage,
    /// Its vertices.
    pub surface: SurfaceModel,
    /// Places that landmarks may be of.
    pub sites: Sites,
    /// What is known of its poses.
    pub prior: PosePrior,
    /// The joints that may be turned, of those that a stage turns; of a limb that is fitted alone.
    own_joints: Option<Vec<usize>>,
}

/// What all frames of a subject share.
#[derive(Clone, Debug)]
pub struct Shaped {
    /// beta (S).
    pub shape: Vec<f64>,
    /// Its clothing.
    pub clothing: Clothing,
}

/// What of a subject is known before.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// beta, if it is held fixed.
    pub shape: Option<Vec<f64>>,
    /// Whether no clothes are worn.
    pub bare: bool,
}

/// Where the fit of one frame begins.
#[derive(Clone, Debug)]
pub enum Start {
    /// At the guess that its landmarks gave.
    FromLandmarks(FramePose),
    /// At another frame's pose, or at a guess from the scan's shape.
    FromElsewhere(FramePose),
}

impl Start {
    /// The pose.
    pub fn into_pose(self) -> FramePose {
        match self {
            Self::FromLandmarks(pose) | Self::FromElsewhere(pose) => pose,
        }
    }
}

impl<'a> Fitter<'a> {
    /// Prepares a body model with its parts.
    pub fn new(model: &'a BodyModel, labels: &PartLabels, density: Density) -> Self {
        let linkage = Linkage::of(model);
        Self {
            surface: SurfaceModel::of(model, &linkage, labels, density),
            sites: Sites::of(model, &linkage),
            prior: PosePrior::of(model),
            linkage,
            model,
            own_joints: None,
        }
    }

    /// A fitter of some of the vertices, which turns some of the joints alone.
    pub(super) fn limb(&self, vertices: &[usize], joints: Vec<usize>) -> Self {
        Self {
            surface: self.surface.chosen(vertices),
            sites: self.sites.clone(),
            prior: self.prior.clone(),
            linkage: self.linkage.clone(),
            model: self.model,
            own_joints: Some(joints),
        }
    }

    /// What a stage solves for on this body.
    pub fn unknowns(&self, stage: &Stage) -> Unknowns {
        let names = &self.model.skeleton().joints;
        let is_own = |joint: &usize| self.own_joints.as_ref().is_none_or(|own| own.contains(joint));
        let is_freed = |joint: &usize| {
            let name = names[*joint].as_str();
            let is_eye = name.ends_with("_eye");
            let is_jaw = name == "jaw";
            let is_finger = name.ends_with(['1', '2', '3']) && !name.starts_with("spine");
            match stage.freed {
                Freed::Body => !is_eye && !is_jaw && !is_finger,
                Freed::Arms => ["shoulder", "elbow", "wrist"].iter().any(|joint| name.ends_with(joint)),
                Freed::Hands => is_finger || name.ends_with("wrist"),
                Freed::Face => is_jaw || matches!(name, "neck" | "head"),
                Freed::All => !is_eye,
            }
        };
        let joints: Vec<usize> = (0..names.len()).filter(is_freed).filter(is_own).collect();
        Unknowns::new(self.linkage.extents(), &joints, stage.besides)
    }

    /// Finds shape, clothing and poses of frames together, from first guesses; `done` is told of every stage.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if a body stops being a number.
    pub fn fit(
        &self,
        starts: Vec<FramePose>,
        frames: &[Frame],
        known: &Known,
        mut done: impl FnMut(&str, f64),
    ) -> Result<(Shaped, Vec<FramePose>)> {
        let shape = known.shape.clone().unwrap_or_else(|| vec![0.0; self.linkage.extents().shapes]);
        let mut sequence = Sequence { poses: starts, shape };
        let mut clothing = Clothing::assumed(self, known.bare);
        let stages = self.stages(frames, known.shape.is_none());
        let total = (stages.len() + ROUNDS) as f64;
        for (index, stage) in stages.iter().enumerate() {
            done(stage.name, index as f64 / total);
            sequence.run(self, stage, frames, &clothing.thickness)?;
            self.settle(stage.settled, &mut sequence, frames, &clothing.thickness)?;
        }
        let dressed = shape_freed(dressed(frames), known.shape.is_none());
        for round in 0..ROUNDS {
            done(dressed.name, (stages.len() + round) as f64 / total);
            clothing.learn(self, &sequence, frames)?;
            sequence.run(self, &dressed, frames, &clothing.thickness)?;
        }
        Ok((Shaped { shape: sequence.shape, clothing }, sequence.poses))
    }

    /// Finds the pose of one frame, shape and clothing being known.
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub fn fit_pose(&self, start: Start, frame: &Frame, shaped: &Shaped) -> Result<FramePose> {
        let (pose, first): (_, &[Stage]) = match start {
            Start::FromLandmarks(pose) => (pose, &FROM_LANDMARKS),
            Start::FromElsewhere(pose) => (pose, &COARSE),
        };
        let mut sequence = Sequence { poses: vec![pose], shape: shaped.shape.clone() };
        let frames = std::slice::from_ref(frame);
        let mut stages: Vec<Stage> = first.iter().chain(&STAGES).map(|stage| shape_freed(*stage, false)).collect();
        let dressed = dressed(frames);
        stages.push(shape_freed(Stage { steps: 4 * dressed.steps, ..dressed }, false));
        for stage in &stages {
            sequence.run(self, stage, frames, &shaped.clothing.thickness)?;
            self.settle(stage.settled, &mut sequence, frames, &shaped.clothing.thickness)?;
        }
        Ok(sequence.poses.remove(0))
    }

    /// Fits the pose of one frame that lies on its scan again, to what its neighbours say.
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub fn fit_between(&self, pose: FramePose, frame: &Frame, shaped: &Shaped) -> Result<FramePose> {
        let mut sequence = Sequence { poses: vec![pose], shape: shaped.shape.clone() };
        let frames = std::slice::from_ref(frame);
        sequence.run(self, &shape_freed(dressed(frames), false), frames, &shaped.clothing.thickness)?;
        Ok(sequence.poses.remove(0))
    }

    /// Has limbs of every frame tried in ways that no small step leads to.
    fn settle(&self, limbs: Option<Limbs>, sequence: &mut Sequence, frames: &[Frame], clothing: &[f64]) -> Result<()> {
        let shape = &sequence.shape;
        let in_all = |settled: &(dyn Fn(&FramePose, &Frame) -> Result<FramePose> + Sync)| {
            sequence.poses.par_iter().zip(frames).map(|(pose, frame)| settled(pose, frame)).collect::<Result<_>>()
        };
        sequence.poses = match limbs {
            None => return Ok(()),
            Some(Limbs::Arms) => {
                let arms = self.arms(clothing);
                in_all(&|pose, frame| arms.iter().try_fold(pose.clone(), |pose, arm| arm.settled(pose, shape, frame)))?
            }
            Some(Limbs::Hands) => {
                let hands = self.hands();
                in_all(&|pose, frame| {
                    hands.iter().try_fold(pose.clone(), |pose, hand| hand.settled(pose, shape, frame))
                })?
            }
        };
        Ok(())
    }

    fn stages(&self, frames: &[Frame], shape: bool) -> Vec<Stage> {
        let has_landmarks = frames.iter().any(|frame| !frame.landmarks.is_empty());
        let first: &[Stage] = if has_landmarks { &FROM_LANDMARKS } else { &COARSE };
        first.iter().chain(&STAGES).map(|stage| shape_freed(*stage, shape)).collect()
    }
}

/// The last stage.
fn dressed(frames: &[Frame]) -> Stage {
    if frames.iter().any(|frame| frame.scan.is_partial()) { DRESSED_IN_PART } else { DRESSED }
}

/// The stage, with the shape held fixed unless it may be solved for.
fn shape_freed(stage: Stage, freed: bool) -> Stage {
    Stage { besides: Besides { shape: stage.besides.shape && freed, ..stage.besides }, ..stage }
}
