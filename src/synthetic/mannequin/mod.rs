//! The built-in subject: a mannequin in the format of SMPL-X, dressed and in motion, made by code from a recipe.
//!
//! recipe -> flesh (signed distance) -> skin mesh -> rig -> model file arrays -> [`BodyModel`]; key poses -> parameters; finer
//! skin + clothes + colours -> scans. No file is read and nothing is random. Metres, radians, Y up, facing +Z.

mod clothing;
mod data_set;
mod directions;
mod filmed;
mod flesh;
mod model;
mod motion;
mod recipe;
mod rig;
mod surface;

use std::path::Path;

use glam::Vec3;

pub use self::filmed::FilmedTake;

use self::clothing::DressedSurface;
use self::flesh::Flesh;
use self::model::Mannequin;
use self::motion::{Take, joint_angles};
use self::recipe::Recipe;
use crate::body::{BodyModel, BodyParameters, PartLabels, Role, smplx};
use crate::data::{FrameId, ScanFrame, Split};
use crate::formats::ArrayMap;
use crate::formats::Result;

/// The name under which the model appears in messages.
const MODEL_NAME: &str = "the built-in SMPLX_NEUTRAL";

/// A dressed, coloured, moving person that needs no data.
pub struct BuiltInSubject {
    arrays: ArrayMap,
    model: BodyModel,
    part_labels: PartLabels,
    surface: DressedSurface,
    betas: Vec<f32>,
    takes: [Take; 2],
}

impl BuiltInSubject {
    /// Makes the subject: about a second.
    ///
    /// # Errors
    /// Only if the recipe in `assets/mannequin.toml`, which is part of the program, is broken.
    pub fn new() -> Result<Self> {
        let recipe = Recipe::embedded()?;
        let flesh = Flesh::of(&recipe)?;
        let mannequin = Mannequin::of(&recipe, &flesh)?;
        let arrays = mannequin.arrays(&recipe)?;
        let model = BodyModel::from_arrays(Path::new(MODEL_NAME), &arrays)?;
        Ok(Self {
            part_labels: part_labels(&recipe, &model, &mannequin.mesh.vertices),
            surface: DressedSurface::of(&recipe, &flesh, &mannequin)?,
            betas: recipe.motion.betas.clone(),
            takes: [Take::of(&recipe, &recipe.motion.train)?, Take::of(&recipe, &recipe.motion.test)?],
            arrays,
            model,
        })
    }

    /// The subject's body model.
    pub fn model(&self) -> &BodyModel {
        &self.model
    }

    /// The arrays of the model's file, to be written as `SMPLX_NEUTRAL.npz`.
    pub fn model_arrays(&self) -> &ArrayMap {
        &self.arrays
    }

    /// The part of each of the model's vertices; eyes and mouth with the skin around them.
    pub fn part_labels(&self) -> &PartLabels {
        &self.part_labels
    }

    /// The subject's shape.
    pub fn betas(&self) -> &[f32] {
        &self.betas
    }

    /// The registered parameters of frame `index` of a take that is filmed in `count` frames, evenly spaced.
    ///
    /// # Errors
    /// None for the embedded recipe; those of [`BodyModel::pose`].
    pub fn parameters(&self, split: Split, index: usize, count: usize) -> Result<smplx::Parameters> {
        let time = index as f32 / count.saturating_sub(1).max(1) as f32;
        let mut parameters = self.takes[split as usize].parameters(time);
        // Feet on the floor y = 0, and a slow walk through the room.
        let pose = self.model.resolve(&parameters.clone().into())?;
        let lowest = self.model.pose(&pose)?.vertices.iter().map(|vertex| vertex.y).fold(f32::MAX, f32::min);
        parameters.transl = Vec3::new(0.3 * (std::f32::consts::TAU * time).sin(), -lowest, 0.4 * time);
        Ok(parameters)
    }

    /// The scan of frame `index` of a take that is filmed in `count` frames: closed, with vertex colours.
    ///
    /// # Errors
    /// As [`parameters`](Self::parameters).
    pub fn frame(&self, split: Split, index: usize, count: usize) -> Result<ScanFrame> {
        let parameters = BodyParameters::from(self.parameters(split, index, count)?);
        let pose = self.model.resolve(&parameters)?;
        let transforms = self.model.pose(&pose)?.bone_transforms;
        let template = self.model.template();
        let rest = self.model.rest_vertices(&pose)?;
        let displacements: Vec<Vec3> = rest.iter().zip(template).map(|(shaped, mean)| *shaped - *mean).collect();
        let scan = self.surface.posed(&displacements, &joint_angles(&pose), &transforms, pose.translation);
        let (split, sequence) = match split {
            Split::Train => ("train", "Take1"),
            Split::Test => ("test", "Take2"),
        };
        let id = FrameId { split: split.into(), sequence: sequence.into(), number: index as u32 + 1 };
        Ok(ScanFrame { id, scan, parameters, unseen_parts: Vec::new(), notes: Vec::new() })
    }
}

fn part_labels(recipe: &Recipe, model: &BodyModel, vertices: &[Vec3]) -> PartLabels {
    let mut labels = PartLabels::from_skinning_weights(model);
    for (vertex, place) in vertices.iter().enumerate() {
        let left = Vec3::new(place.x.abs(), place.y, place.z);
        let near = recipe.rig.eyes_mouth.iter().any(|ball| left.distance(ball.centre.into()) < ball.radius);
        labels.detail[vertex] |= near && model.skeleton().role(labels.parts[vertex]) == Role::Face;
    }
    labels
}
