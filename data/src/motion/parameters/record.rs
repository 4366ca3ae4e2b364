//! One set of parameters, as frames.

use glam::Vec3;

use super::layout::{Layout, Model, is_vposer_code};
use super::names::{self, Name};
use super::place::Place;
use super::rows::Rows;
use super::tools::Tool;
use crate::fields::Fields;
use crate::motion::{Coordinates, Motion};
use xavatar_body::smplx::{self, joint};
use xavatar_body::{HandPose, PoseAxisAngle};
use xavatar_formats::{Array, Error, Result};

/// The parameters under one prefix.
pub(super) struct Record<'a> {
    pub(super) fields: &'a Fields<'a>,
    pub(super) place: &'a Place<'a>,
    pub(super) tool: &'static Tool,
    /// What its numbers are to be relative to, where it has them twice.
    pub(super) coordinates: Coordinates,
}

impl Record<'_> {
    /// The array with the body's rotations, and how they lie in it.
    pub(super) fn body(&self) -> Result<(String, &Array, Layout)> {
        let codes = |(_, array): &(String, &Array)| is_vposer_code(&array.shape);
        let body = self.find(names::BODY).filter(|body| !codes(body)).or_else(|| self.find(names::POSE));
        let Some((key, array)) = body.or_else(|| self.find(names::BODY)) else {
            let expected = format!("one of {}", names::quoted(names::BODY));
            return Err(self.fields.malformed(&self.key(names::BODY[0].0), "missing", expected));
        };
        if is_vposer_code(&array.shape) {
            return Err(Error::Mismatch {
                path: self.fields.path.into(),
                found: format!("`{key}` is {}, a code of VPoser", array.description()),
                expected: "rotations of joints".into(),
                remedy: "decode it before saving: body_pose = vposer.decode(code)[\"pose_body\"].reshape(-1, 63)"
                    .into(),
            });
        }
        let layout = Layout::of(&array.shape).ok_or_else(|| {
            let joints = Model::ALL.map(|model| model.joints());
            let expected = format!(
                "frames of {} joints (or one more, the root; of SMPL {}, of SMPL+H {}, of SMPL-X {}), as 3 numbers or rotation matrices each",
                joints[0], joints[1], joints[2], joints[3],
            );
            self.fields.malformed(&key, array.description(), expected)
        })?;
        Ok((key, array, layout))
    }

    /// The frames, what is missing of them, and what is left out.
    pub(super) fn motion(&self) -> Result<Motion> {
        let mut zeroed = Vec::new();
        let (key, array, layout) = self.body()?;
        let rows = Rows { record: self, people: layout.people, frames: layout.frames, rotations: layout.rotations };
        let rotations = rows.rotations(&key, array, layout.joints)?;
        let joints: Vec<&[PoseAxisAngle]> =
            rotations.chunks_exact(layout.joints).map(|row| &row[usize::from(layout.has_root())..]).collect();
        let mut missing = |names: &[Name]| zeroed.push(names::plain(names).to_owned());
        // Of arrays of their own, else of the whole pose, else neutral.
        let mut single = |names: &'static [Name], in_pose: Option<Vec<PoseAxisAngle>>| match (self.find(names), in_pose)
        {
            (Some((key, array)), _) => rows.rotations(&key, array, 1),
            (None, Some(in_pose)) => Ok(in_pose),
            (None, None) => {
                missing(names);
                Ok(vec![PoseAxisAngle::default(); rows.frames])
            }
        };
        // Rows are without the root.
        let column = |joint: usize| joints.iter().map(|row| row[joint - 1]).collect::<Vec<_>>();
        let of_face = |joint: usize| (layout.model == Model::SmplX).then(|| column(joint));
        let roots = layout.has_root().then(|| rotations.iter().step_by(layout.joints).copied().collect());
        let roots = single(names::ROOT, roots)?;
        let jaws = single(names::JAW, of_face(joint::JAW))?;
        let left_eyes = single(names::LEFT_EYE, of_face(joint::LEFT_EYE))?;
        let right_eyes = single(names::RIGHT_EYE, of_face(joint::RIGHT_EYE))?;
        let mut hands = |names: &'static [Name], side: usize| -> Result<Vec<HandPose>> {
            if let Some(hands) = rows.hands(names, side)? {
                return Ok(hands);
            }
            let Some(first) = layout.model.first_of_hands() else {
                missing(names);
                return Ok(vec![HandPose::default(); rows.frames]);
            };
            let first = first + joint::HAND * side;
            Ok(joints.iter().map(|row| rows.hand_in_pose(&row[first..first + joint::HAND])).collect())
        };
        let (left_hands, right_hands) = (hands(names::LEFT_HAND, 0)?, hands(names::RIGHT_HAND, 1)?);
        let mut coefficients = |names: &'static [Name], used: usize| -> Result<Vec<Vec<f32>>> {
            Ok(rows.coefficients(names, used)?.unwrap_or_else(|| {
                missing(names);
                vec![Vec::new(); rows.frames]
            }))
        };
        let expressions = coefficients(names::EXPRESSION, smplx::EXPRESSIONS)?;
        let betas = match layout.model {
            Model::Body | Model::SmplX => coefficients(names::BETAS, smplx::SHAPES)?,
            // Coefficients of SMPL and SMPL+H mean other shapes.
            Model::Smpl | Model::SmplH => vec![Vec::new(); rows.frames],
        };
        let translations = rows.translations(layout.model, &roots)?.unwrap_or_else(|| {
            missing(names::TRANSLATION);
            vec![Vec3::ZERO; rows.frames]
        });
        let frames = left_hands.into_iter().zip(right_hands).enumerate();
        let frames = frames.map(|(index, (left_hand_pose, right_hand_pose))| smplx::Parameters {
            betas: betas[index].clone(),
            expression: expressions[index].clone(),
            global_orient: roots[index],
            body_pose: std::array::from_fn(|joint| joints[index][joint]),
            jaw_pose: jaws[index],
            left_eye_pose: left_eyes[index],
            right_eye_pose: right_eyes[index],
            left_hand_pose,
            right_hand_pose,
            transl: translations[index],
        });
        let (frames, left_out) = self.of_one_person(frames.collect(), layout);
        let notes = layout.model.left_out().into_iter().chain(left_out).map(str::to_owned).collect();
        Ok(Motion { frames, zeroed, notes, ..Motion::default() })
    }

    /// Whether the rows of its arrays are the people of a picture; in ROMP's tracks they are frames.
    pub(super) fn rows_are_people(&self) -> bool {
        self.tool.rows_are_people && !self.place.prefix.starts_with("sequence_results")
    }

    /// The frames of the one person, where rows are people, and what is said of the others.
    fn of_one_person(
        &self,
        frames: Vec<smplx::Parameters>,
        layout: Layout,
    ) -> (Vec<smplx::Parameters>, Option<&'static str>) {
        if !self.rows_are_people() {
            return (frames, (layout.people > 1).then_some("of several people in its arrays the first is read"));
        }
        // The nearest is the largest in the picture: the camera's scale is the first of three numbers.
        let scales = self.fields.arrays.get(&self.key("cam")).and_then(Array::to_f32).unwrap_or_default();
        let scale = |person: usize| scales.get(3 * person).copied().unwrap_or(0.0);
        let count = frames.len();
        let largest = (0..count).rev().max_by(|one, other| scale(*one).total_cmp(&scale(*other)));
        let frames =
            frames.into_iter().enumerate().filter(|(person, _)| Some(*person) == largest).map(|(_, frame)| frame);
        (frames.collect(), (count > 1).then_some("of several people in a picture the largest is read"))
    }

    /// A parameter's key in the file.
    pub(super) fn key(&self, name: &str) -> String {
        format!("{}{name}", self.place.prefix)
    }

    /// The array under the first of the names that is there: of those relative to what is wanted, then of others.
    pub(super) fn find(&self, names: &[Name]) -> Option<(String, &Array)> {
        let array = |name: &str| Some((self.key(name), self.fields.arrays.get(&self.key(name))?));
        let is_wanted = |name: &&Name| name.1.is_none_or(|coordinates| coordinates == self.coordinates);
        let wanted = names.iter().filter(is_wanted).find_map(|(name, _)| array(name));
        wanted.or_else(|| names.iter().find_map(|(name, _)| array(name)))
    }
}
