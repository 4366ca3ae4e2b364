//! What a body model's file holds, for people and for scripts.

use std::fmt;
use std::path::Path;

use serde::Serialize;
use xavatar::body::{BodyModel, Coefficients, Gender, PartLabels, mano};
use xavatar::formats::{ArrayMap, Result};
use xavatar::learned::feet::Feet;

/// A body model.
#[derive(Serialize)]
pub struct BodyDescription {
    family: String,
    gender: Option<Gender>,
    vertices: usize,
    faces: usize,
    joints: Vec<String>,
    parts: Vec<String>,
    /// Coefficients of the file, of which the first ten are used.
    shape_coefficients: usize,
    expression_coefficients: usize,
    pose_correctives: String,
    /// Vertices of feet that the ground presses, of a body whose feet were trained.
    feet: Option<usize>,
    /// Hands whose poses may be relative to a mean, and how many components each has.
    hand_components: Vec<usize>,
    /// From the lowest vertex of the template to the highest, metres.
    height: f32,
    part_labels: String,
    /// What is wrong with the file although it can be read.
    problems: Vec<String>,
}

impl BodyDescription {
    /// Of the arrays of a file.
    pub fn of(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        let body = BodyModel::from_arrays_with(path, arrays, Coefficients::All)?;
        let skeleton = body.skeleton();
        let heights = || body.template().iter().map(|vertex| vertex.y);
        let unmirrored = mano::has_unmirrored_shapes(&body).then(|| {
            "its shapes were not mirrored with the hand, as in many copies of MANO's left model: xavatar body convert --mirror-shapes"
                .to_owned()
        });
        Ok(Self {
            family: skeleton.family.clone(),
            gender: Gender::of_file_name(path),
            vertices: body.vertex_count(),
            faces: body.faces().len(),
            joints: skeleton.joints.clone(),
            parts: skeleton.parts.iter().map(|part| part.title()).collect(),
            shape_coefficients: body.shape_coefficients(),
            expression_coefficients: body.expression_coefficients(),
            pose_correctives: body.correctives().to_string(),
            feet: if Feet::are_in(arrays) {
                Some(Feet::from_arrays(path, arrays, &body)?.vertices().count())
            } else {
                None
            },
            hand_components: body.hands().iter().map(|hand| hand.components.len()).collect(),
            height: heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min),
            part_labels: PartLabels::find(&body)
                .map_or_else(|error| error.to_string(), |labels| labels.source.to_string()),
            problems: unmirrored.into_iter().collect(),
        })
    }
}

impl fmt::Display for BodyDescription {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gender = self.gender.map_or("of no stated gender".into(), |gender| gender.to_string());
        let Self { family, vertices, faces, height, .. } = self;
        writeln!(
            formatter,
            "{family} body model, {gender}: {vertices} vertices, {faces} faces, {height:.2} m high at rest"
        )?;
        writeln!(formatter, "{} joints: {}", self.joints.len(), self.joints.join(", "))?;
        writeln!(formatter, "parts: {}", self.parts.join(", "))?;
        let coefficients = (self.shape_coefficients, self.expression_coefficients);
        writeln!(formatter, "coefficients: {} of shape, {} of expression", coefficients.0, coefficients.1)?;
        writeln!(formatter, "pose correctives: {}", self.pose_correctives)?;
        if let Some(vertices) = self.feet {
            writeln!(formatter, "feet: {vertices} vertices that the ground presses, by networks")?;
        }
        for components in &self.hand_components {
            writeln!(formatter, "a hand with a mean pose and {components} components")?;
        }
        writeln!(formatter, "part labels: {}", self.part_labels)?;
        self.problems.iter().try_for_each(|problem| writeln!(formatter, "warning: {problem}"))
    }
}
