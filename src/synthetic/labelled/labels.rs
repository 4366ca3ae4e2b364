//! What is known of a picture, as its JSON file has it.
//!
//! Numbers are in double precision, so that p = (fx x / z + cx, fy y / z + cy) of (x, y, z) = R X + t is a joint's place to the last digit.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::body::{Pose, Skeleton, smplx};
use crate::mesh::camera::PinholeCamera;

/// All that is known of a picture beside its pixels' labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Labels {
    /// The picture's number in its data set.
    pub number: usize,
    /// Who, in which pose.
    pub person: String,
    /// The name of the picture behind.
    pub backdrop: String,
    /// The camera.
    pub camera: CameraLabels,
    /// Left, top, width and height of the box around the pixels of the person.
    pub bounds: [u32; 4],
    /// How many pixels are the person's.
    pub area: usize,
    /// Lengths of the runs of pixels, column by column, that are not the person's and that are, in turn.
    pub runs: Vec<u32>,
    /// Of every joint of the body.
    pub joints: Vec<JointLabel>,
    /// COCO-WholeBody's 133 points; none where the body has no such place.
    pub keypoints: Vec<Option<JointLabel>>,
    /// The body's pose.
    pub pose: PoseLabels,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraLabels {
    /// Columns and rows.
    pub size: [u32; 2],
    /// fx and fy, pixels.
    pub focal: [f64; 2],
    /// cx and cy from the upper left corner, pixels.
    pub centre: [f64; 2],
    /// R by rows, world to camera: x right, y down, z forward.
    pub rotation: [[f64; 3]; 3],
    /// t, metres.
    pub translation: [f64; 3],
}

/// A place of the body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointLabel {
    /// The joint's name; `left_index`, .. for the tips of fingers.
    pub name: String,
    /// In the world, metres.
    pub place: [f64; 3],
    /// In the picture, which it may be outside of.
    pub pixel: [f64; 2],
    /// Whether it is seen.
    pub visibility: Visibility,
}

/// COCO's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "u8", try_from = "u8")]
pub enum Visibility {
    /// Not in the picture.
    Outside = 0,
    /// In the picture, behind something else of the person.
    Hidden = 1,
    /// Seen.
    Seen = 2,
}

/// What the body is posed by: any program's that has the body model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseLabels {
    /// The family of the body's skeleton.
    pub family: String,
    /// Each joint's rotation relative to its parent, axis times angle, absolute (hands too).
    pub rotations: BTreeMap<String, [f64; 3]>,
    /// Shape coefficients.
    pub betas: Vec<f64>,
    /// Expression coefficients.
    pub expression: Vec<f64>,
    /// Added to every vertex, metres.
    pub translation: [f64; 3],
    /// The same as arguments of the `smplx` package with `flat_hand_mean=True`, `use_pca=False`; none for other skeletons.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub smplx: Option<BTreeMap<String, Vec<f64>>>,
}

impl From<Visibility> for u8 {
    fn from(visibility: Visibility) -> Self {
        visibility as Self
    }
}

impl TryFrom<u8> for Visibility {
    type Error = String;

    fn try_from(number: u8) -> Result<Self, String> {
        let known = [Self::Outside, Self::Hidden, Self::Seen];
        known.get(usize::from(number)).copied().ok_or_else(|| format!("visibility {number}, expected 0, 1 or 2"))
    }
}

impl CameraLabels {
    /// Of a camera.
    pub(super) fn of(camera: &PinholeCamera) -> Self {
        let rotation = camera.rotation.transpose().to_cols_array_2d().map(|row| row.map(f64::from));
        Self {
            size: [camera.width, camera.height],
            focal: [camera.fx, camera.fy].map(f64::from),
            centre: [camera.cx, camera.cy].map(f64::from),
            rotation,
            translation: camera.translation.to_array().map(f64::from),
        }
    }

    /// Where a place of the world is in the picture, and its depth z, metres.
    #[must_use]
    pub fn project(&self, place: [f64; 3]) -> ([f64; 2], f64) {
        let along = |axis: usize| {
            let row: f64 = self.rotation[axis].iter().zip(place).map(|(entry, coordinate)| entry * coordinate).sum();
            row + self.translation[axis]
        };
        let [x, y, z] = [0, 1, 2].map(along);
        ([self.focal[0] * x / z + self.centre[0], self.focal[1] * y / z + self.centre[1]], z)
    }
}

impl PoseLabels {
    /// Of a pose of a skeleton.
    pub(super) fn of(pose: &Pose, skeleton: &Skeleton) -> Self {
        let turn = |joint: usize| pose.rotations[joint].0.to_array().map(f64::from);
        let all = |numbers: &[f32]| numbers.iter().map(|number| f64::from(*number)).collect::<Vec<f64>>();
        let is_smplx = skeleton.joints == smplx::skeleton().joints;
        let several = |range: std::ops::Range<usize>| range.flat_map(turn).collect::<Vec<f64>>();
        let arguments = [
            ("global_orient", 0..1),
            ("body_pose", 1..22),
            ("jaw_pose", 22..23),
            ("leye_pose", 23..24),
            ("reye_pose", 24..25),
            ("left_hand_pose", 25..40),
            ("right_hand_pose", 40..55),
        ];
        let smplx = is_smplx.then(|| {
            let of_pose = arguments.into_iter().map(|(name, joints)| (name.to_owned(), several(joints)));
            let others = [("betas", all(&pose.shape)), ("expression", all(&pose.expression))];
            let translation = ("transl".to_owned(), all(&pose.translation.to_array()));
            of_pose.chain(others.map(|(name, numbers)| (name.to_owned(), numbers))).chain([translation]).collect()
        });
        Self {
            family: skeleton.family.clone(),
            rotations: skeleton.joints.iter().enumerate().map(|(joint, name)| (name.clone(), turn(joint))).collect(),
            betas: all(&pose.shape),
            expression: all(&pose.expression),
            translation: pose.translation.to_array().map(f64::from),
            smplx,
        }
    }
}

/// The lengths of runs of false and true in turn, column by column, as COCO has masks.
pub(super) fn runs(mask: &[bool], [width, height]: [u32; 2]) -> Vec<u32> {
    let (mut runs, mut last) = (vec![0], false);
    for place in (0..width as usize).flat_map(|column| (0..height as usize).map(move |row| (row, column))) {
        let is_in = mask[place.0 * width as usize + place.1];
        if is_in != last {
            runs.push(0);
            last = is_in;
        }
        if let Some(run) = runs.last_mut() {
            *run += 1;
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_go_down_the_columns_and_begin_outside() {
        let mask = [false, true, true, false, true, false];
        assert_eq!(runs(&mask, [3, 2]), [2, 3, 1]);
        assert_eq!(runs(&[true; 4], [2, 2]), [0, 4]);
        assert_eq!(runs(&[false; 4], [2, 2]), [4]);
    }

    #[test]
    fn every_rotation_of_smplx_is_among_its_arguments_in_order() {
        let skeleton = smplx::skeleton();
        let mut pose = skeleton.rest_pose();
        for (joint, rotation) in pose.rotations.iter_mut().enumerate() {
            rotation.0.x = joint as f32;
        }
        let labels = PoseLabels::of(&pose, skeleton);
        let arguments = labels.smplx.unwrap();
        let first = |name: &str| (arguments[name][0], arguments[name].len());
        assert_eq!(first("body_pose"), (1.0, 63));
        assert_eq!(first("jaw_pose"), (labels.rotations["jaw"][0], 3));
        assert_eq!(first("left_hand_pose"), (labels.rotations["left_index1"][0], 45));
        assert_eq!(first("right_hand_pose"), (labels.rotations["right_index1"][0], 45));
        let read: Labels = serde_json::from_str(&serde_json::to_string(&example()).unwrap()).unwrap();
        assert_eq!(read, example());
    }

    fn example() -> Labels {
        let joint = JointLabel {
            name: "neck".into(),
            place: [0.1, 0.2, 0.3],
            pixel: [1.0 / 3.0, 7.25],
            visibility: Visibility::Hidden,
        };
        let camera = PinholeCamera::looking_at(glam::Vec3::Z, glam::Vec3::ZERO, 0.5, [20, 30]).unwrap();
        Labels {
            number: 3,
            person: "7".into(),
            backdrop: "room.png".into(),
            camera: CameraLabels::of(&camera),
            bounds: [1, 2, 3, 4],
            area: 12,
            runs: vec![600],
            joints: vec![joint.clone()],
            keypoints: vec![None, Some(joint)],
            pose: PoseLabels::of(&smplx::skeleton().rest_pose(), smplx::skeleton()),
        }
    }
}
