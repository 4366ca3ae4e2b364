//! Arrays of a set of parameters, a row a frame: numbers, rotations, hands, coefficients, places.

use glam::{DMat3, DQuat, DVec3, Quat, Vec3};

use super::layout::{Model, Rotations};
use super::names::{self, Name};
use super::record::Record;
use crate::motion::amass::SMPL_PELVIS;
use crate::motion::{Coordinates, RestPose};
use xavatar_body::smplx::joint;
use xavatar_body::{HandPose, PoseAxisAngle};
use xavatar_formats::{Array, Result, element_count};

/// Entries of a matrix times its transpose differ from the identity's by less.
const ORTHONORMAL: f64 = 1e-2;

/// What the arrays of a set have in common.
pub(super) struct Rows<'a> {
    pub(super) record: &'a Record<'a>,
    /// Of whom each has as many frames; the first is read.
    pub(super) people: usize,
    pub(super) frames: usize,
    /// What the body's rotations are; others are so too, or vectors where there are too few numbers.
    pub(super) rotations: Rotations,
}

impl Rows<'_> {
    /// The numbers of an array with `width` a frame, finite.
    fn numbers(&self, key: &str, array: &Array, width: usize) -> Result<Vec<f32>> {
        let fields = self.record.fields;
        let own = width * self.frames;
        let wrong =
            || fields.malformed(key, array.description(), format_args!("{width} numbers a frame, {own} in all"));
        let mut values = array.to_f32().filter(|values| values.len() == own * self.people || values.len() == own);
        let values = values.as_mut().ok_or_else(wrong)?;
        values.truncate(own);
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(fields.malformed(key, value, "finite numbers")),
            None => Ok(std::mem::take(values)),
        }
    }

    /// How many numbers an array has for each frame.
    fn width(&self, array: &Array) -> usize {
        let elements = element_count(&array.shape).unwrap_or(0);
        let rows = self.frames * self.people;
        if elements.is_multiple_of(rows) { elements / rows } else { elements / self.frames }
    }

    /// Rotations of `joints` joints in each frame.
    pub(super) fn rotations(&self, key: &str, array: &Array, joints: usize) -> Result<Vec<PoseAxisAngle>> {
        let are_matrices = array.shape.ends_with(&[3, 3]) && self.width(array) == 9 * joints;
        if !are_matrices && (self.rotations == Rotations::Vectors || self.width(array) == 3 * joints) {
            let values = self.numbers(key, array, 3 * joints)?;
            let vectors = values.as_chunks::<3>().0.iter();
            return Ok(vectors.map(|vector| PoseAxisAngle(Vec3::from_array(*vector))).collect());
        }
        let values = self.numbers(key, array, 9 * joints)?;
        let rotation = |row_major: &[f32; 9]| {
            axis_angle(row_major).ok_or_else(|| {
                let found = format_args!("the matrix {row_major:?}").to_string();
                self.record.fields.malformed(key, found, "rotation matrices")
            })
        };
        values.as_chunks::<9>().0.iter().map(rotation).collect()
    }

    /// The hands of an array of their own, if there is one: of one side, or of both.
    pub(super) fn hands(&self, names: &'static [Name], side: usize) -> Result<Option<Vec<HandPose>>> {
        let (key, array, hands) = match (self.record.find(names), self.record.find(names::HANDS)) {
            (Some((key, array)), _) => (key, array, 1),
            (None, Some((key, array))) => (key, array, 2),
            (None, None) => return Ok(None),
        };
        let width = self.width(array);
        let own = |row: &[HandPose]| row[side * (hands - 1)].clone();
        if (self.rotations == Rotations::Matrices && width == 9 * joint::HAND * hands)
            || width == 3 * joint::HAND * hands
        {
            let is_flat = width == 9 * joint::HAND * hands || self.has_flat_hands()?;
            let joints = self.rotations(&key, array, joint::HAND * hands)?;
            let all: Vec<HandPose> = joints.chunks_exact(joint::HAND).map(|joints| hand(joints, is_flat)).collect();
            return Ok(Some(all.chunks_exact(hands).map(own).collect()));
        }
        let components = width / hands;
        if components == 0 || components > 3 * joint::HAND || !width.is_multiple_of(hands) {
            let (frames, joints) = (self.frames, joint::HAND);
            let expected =
                format!("{frames} frames of {joints} joints a hand, or of up to {} PCA coefficients", 3 * joints);
            return Err(self.record.fields.malformed(&key, array.description(), expected));
        }
        let values = self.numbers(&key, array, width)?;
        let all: Vec<HandPose> = values.chunks_exact(components).map(|row| HandPose::Pca(row.to_vec())).collect();
        Ok(Some(all.chunks_exact(hands).map(own).collect()))
    }

    /// A hand that is part of a whole pose.
    pub(super) fn hand_in_pose(&self, joints: &[PoseAxisAngle]) -> HandPose {
        hand(joints, self.rotations == Rotations::Matrices || self.record.tool.whole_poses_are_flat)
    }

    fn has_flat_hands(&self) -> Result<bool> {
        let keys = [self.record.key(names::FLAT_HANDS), names::FLAT_HANDS.to_owned()];
        match keys.iter().find(|key| self.record.fields.arrays.contains_key(*key)) {
            Some(key) => Ok(self.record.fields.number(key)? != 0.0),
            None => Ok(self.record.tool.flat_hands),
        }
    }

    /// The first `used` of at least as many coefficients a frame, or of all frames, if there are any.
    pub(super) fn coefficients(&self, names: &'static [Name], used: usize) -> Result<Option<Vec<Vec<f32>>>> {
        let Some((key, array)) = self.record.find(names) else { return Ok(None) };
        let elements = element_count(&array.shape).unwrap_or(0);
        let width = array.shape.last().copied().unwrap_or(0);
        let rows = elements.checked_div(width).unwrap_or(0);
        let fits = [1, self.people, self.frames, self.people * self.frames].contains(&rows);
        if width < used || !fits {
            let expected = format!("{used} or more coefficients, once or for {} frames", self.frames);
            return Err(self.record.fields.malformed(&key, array.description(), expected));
        }
        let whole = Rows { people: 1, frames: rows, ..*self };
        let values = whole.numbers(&key, array, width)?;
        let one_for_all = rows < self.frames || (rows == self.people && self.people > 1);
        let row = |index: usize| {
            let index = if one_for_all { 0 } else { index };
            values[index * width..][..used].to_vec()
        };
        Ok(Some((0..self.frames).map(row).collect()))
    }

    /// By how much SMPL-X's body is moved in each frame, if the file says where it is.
    ///
    /// A body is turned about its pelvis, J at rest, so that its pelvis is at J + t; or about the origin, at R J + t.
    pub(super) fn translations(&self, model: Model, roots: &[PoseAxisAngle]) -> Result<Option<Vec<Vec3>>> {
        let own = RestPose::default().pelvis();
        let at_rest = match model {
            Model::Smpl | Model::SmplH => SMPL_PELVIS,
            Model::Body | Model::SmplX => own,
        };
        let places = |key: &str, array: &Array| -> Result<Vec<Vec3>> {
            Ok(self.numbers(key, array, 3)?.as_chunks::<3>().0.iter().map(|place| Vec3::from_array(*place)).collect())
        };
        if let Some((key, array)) = self.record.find(names::PELVIS) {
            return Ok(Some(places(&key, array)?.into_iter().map(|pelvis| pelvis - own).collect()));
        }
        let Some((key, array)) = self.record.find(names::TRANSLATION) else { return self.of_picture(at_rest - own) };
        let scale = self.scale()?;
        let about_origin = key.ends_with("Th");
        let moved = places(&key, array)?.into_iter().zip(roots).map(|(moved, root)| {
            let pelvis = if about_origin { Quat::from_scaled_axis(root.0) * at_rest } else { at_rest };
            pelvis + moved / scale - own
        });
        Ok(Some(moved.collect()))
    }

    /// The size of the recorded person to the model's, by which places are too large.
    fn scale(&self) -> Result<f32> {
        let key = self.record.key("smpl_scaling");
        let Some(array) = self.record.fields.arrays.get(&key) else { return Ok(1.0) };
        match self.record.fields.number(&key)? {
            scale if scale > 0.0 => Ok(scale),
            _ => Err(self.record.fields.malformed(&key, array.description(), "a positive number")),
        }
    }

    /// Where the camera sees the person of a picture, if it is listed beside the people.
    fn of_picture(&self, shift: Vec3) -> Result<Option<Vec<Vec3>>> {
        let Some((picture, item)) = self.record.place.picture else { return Ok(None) };
        let cameras = self.record.fields.arrays.get(&format!("{picture}camera"));
        let place = cameras.and_then(Array::to_f32).and_then(|values| {
            let place = values.as_chunks::<3>().0.get(item)?;
            Some(Vec3::from_array(*place) + shift)
        });
        Ok(place
            .filter(|place| place.is_finite() && self.record.coordinates == Coordinates::Camera)
            .map(|place| vec![place; self.frames]))
    }
}

fn hand(joints: &[PoseAxisAngle], is_flat: bool) -> HandPose {
    let joints = std::array::from_fn(|joint| joints[joint]);
    if is_flat { HandPose::Flat(joints) } else { HandPose::RelativeToMean(joints) }
}

/// The rotation vector of a row-major matrix, if it is a rotation.
fn axis_angle(row_major: &[f32; 9]) -> Option<PoseAxisAngle> {
    let matrix = DMat3::from_cols_array(&row_major.map(f64::from)).transpose();
    let product = matrix * matrix.transpose();
    let is_orthonormal = product.abs_diff_eq(DMat3::IDENTITY, ORTHONORMAL);
    if !is_orthonormal || matrix.determinant() < 0.0 {
        return None;
    }
    let rotation = DQuat::from_mat3(&matrix).normalize();
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let vector: DVec3 = rotation.to_scaled_axis();
    Some(PoseAxisAngle(vector.as_vec3()))
}
