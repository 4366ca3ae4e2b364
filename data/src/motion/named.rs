//! SMPL-X parameters by name, as pose estimators and fitting tools store them (SMPLer-X, PyMAF-X, SMPLify-X; docs/motion.md).
//!
//! Each parameter goes by several names, and may be of one frame, of all, or of a batch; rotations are vectors (3) or matrices
//! (3, 3), told apart by the array's shape. Names may have a prefix, common to one person's parameters (`smplx_params.body_pose`),
//! and the prefix may number a list's items (`results[3].smplx.body_pose`): its frames, in order.
//!
//! Matrices are absolute rotations. Hand vectors are relative to the mean hand, as smplx takes them by default, unless
//! `flat_hand_mean` says otherwise. Estimators work in camera coordinates, Y down, and seldom know a frame rate.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3, Vec3};

use super::{Motion, UpAxis};
use crate::fields::Fields;
use xavatar_body::{HandPose, PoseAxisAngle, smplx};
use xavatar_formats::{Array, ArrayMap, Error, Result, element_count};

const FORMAT: &str = "SMPL-X parameters";
/// Entries of a matrix times its transpose differ from the identity's by less.
const ORTHONORMAL: f64 = 1e-2;

const BODY: &[&str] = &["body_pose", "smplx_body_pose", "pose_body"];
const ROOT: &[&str] =
    &["global_orient", "smplx_global_orient", "smplx_root_pose", "root_pose", "root_orient", "global_orientation"];
const LEFT_HAND: &[&str] = &["left_hand_pose", "smplx_lhand_pose", "lhand_pose", "left_hand"];
const RIGHT_HAND: &[&str] = &["right_hand_pose", "smplx_rhand_pose", "rhand_pose", "right_hand"];
const JAW: &[&str] = &["jaw_pose", "smplx_jaw_pose", "pose_jaw"];
const LEFT_EYE: &[&str] = &["leye_pose", "left_eye_pose", "smplx_leye_pose"];
const RIGHT_EYE: &[&str] = &["reye_pose", "right_eye_pose", "smplx_reye_pose"];
const EXPRESSION: &[&str] = &["expression", "smplx_expr", "smplx_expression", "expr", "exp"];
const BETAS: &[&str] = &["betas", "smplx_shape", "smplx_betas", "shape"];
const TRANSLATION: &[&str] = &["transl", "trans", "smplx_transl", "cam_trans", "translation"];
const RATE: &[&str] = &["frames_per_second", "fps", "mocap_frame_rate", "mocap_framerate"];
const FLAT_HANDS: &str = "flat_hand_mean";

pub(crate) fn recognised(arrays: &ArrayMap) -> std::result::Result<(), String> {
    let found = arrays.keys().any(|key| BODY.contains(&leaf(key)));
    found.then_some(()).ok_or_else(|| format!("no {}, alone or under a prefix", quoted(BODY)))
}

pub(crate) fn read(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    let fields = Fields { path, format: FORMAT, arrays };
    // One person's parameters have one prefix, but for the numbers in it.
    let mut people: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for key in arrays.keys().filter(|key| BODY.contains(&leaf(key))) {
        let prefix = &key[..key.len() - leaf(key).len()];
        people.entry(unnumbered(prefix)).or_default().push(prefix);
    }
    let mut motions = Vec::new();
    for (person, mut prefixes) in people {
        prefixes.sort_by_key(|prefix| numbers(prefix));
        prefixes.dedup();
        let mut motion = Motion::default();
        for prefix in prefixes {
            let chunk = Chunk { fields: &fields, prefix }.motion()?;
            motion.zeroed.extend(chunk.zeroed);
            motion.frames.extend(chunk.frames);
        }
        motions.push((person, motion));
    }
    // The longest is the one that is meant; the first of several.
    motions.sort_by_key(|(_, motion)| std::cmp::Reverse(motion.frames.len()));
    let others: Vec<String> =
        motions.iter().skip(1).map(|(person, motion)| format!("{person} ({} frames)", motion.frames.len())).collect();
    let (_, mut motion) = motions.swap_remove(0);
    if !others.is_empty() {
        motion.notes.push(format!("the file's longest motion; others in it are left out: {}", others.join(", ")));
    }
    let rate = RATE.iter().find(|name| arrays.contains_key(**name));
    motion.frames_per_second = match rate {
        Some(name) => Some(fields.number(name)?),
        None => None,
    };
    if let Some(rate) = motion.frames_per_second.filter(|rate| *rate <= 0.0) {
        return Err(fields.malformed(rate_name(arrays), rate, "a positive number of frames a second"));
    }
    motion.zeroed.sort();
    motion.zeroed.dedup();
    motion.up = UpAxis::MinusY;
    motion.source = format!("{} ({FORMAT})", path.display());
    Ok(motion)
}

fn rate_name(arrays: &ArrayMap) -> &'static str {
    RATE.iter().find(|name| arrays.contains_key(**name)).copied().unwrap_or(RATE[0])
}

/// The parameters under one prefix.
struct Chunk<'a> {
    fields: &'a Fields<'a>,
    prefix: &'a str,
}

/// Rotations are the same in all of a chunk's arrays, or vectors where there are too few numbers for matrices.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rotations {
    Vectors,
    Matrices,
}

impl Chunk<'_> {
    fn motion(&self) -> Result<Motion> {
        let mut zeroed = Vec::new();
        let (body_key, body) = self.find(BODY).ok_or_else(|| self.missing(BODY))?;
        let layout = layout(&body.shape);
        let (count, joints, kind) = layout.filter(|(count, ..)| *count > 0).ok_or_else(|| {
            let expected = "frames of 21 joints (22 with the root), as 3 numbers or 3 x 3 matrices each";
            self.fields.malformed(&body_key, body.description(), expected)
        })?;
        let rotations = self.rotations(&body_key, body, count, joints, kind)?;
        let with_root = joints == 22;
        let bodies: Vec<&[PoseAxisAngle]> = rotations.chunks_exact(joints).map(|row| &row[joints - 21..]).collect();
        let roots: Vec<PoseAxisAngle> = match self.find(ROOT) {
            Some((key, array)) => self.rotations(&key, array, count, 1, kind)?,
            None if with_root => rotations.iter().step_by(22).copied().collect(),
            None => {
                zeroed.push("global_orient".to_owned());
                vec![PoseAxisAngle::default(); count]
            }
        };
        let mut single = |names: &'static [&'static str]| match self.find(names) {
            Some((key, array)) => self.rotations(&key, array, count, 1, kind),
            None => {
                zeroed.push(names[0].to_owned());
                Ok(vec![PoseAxisAngle::default(); count])
            }
        };
        let (jaws, left_eyes, right_eyes) = (single(JAW)?, single(LEFT_EYE)?, single(RIGHT_EYE)?);
        let left_hands = self.hands(LEFT_HAND, count, kind, &mut zeroed)?;
        let right_hands = self.hands(RIGHT_HAND, count, kind, &mut zeroed)?;
        let expressions = self.coefficients(EXPRESSION, smplx::EXPRESSIONS, count, &mut zeroed)?;
        let betas = self.coefficients(BETAS, smplx::SHAPES, count, &mut zeroed)?;
        let translations = match self.find(TRANSLATION) {
            Some((key, array)) => self.numbers(&key, array, 3 * count)?,
            None => {
                zeroed.push(TRANSLATION[0].to_owned());
                vec![0.0; 3 * count]
            }
        };
        let hands = left_hands.into_iter().zip(right_hands).enumerate();
        let frames = hands.map(|(index, (left_hand_pose, right_hand_pose))| smplx::Parameters {
            betas: betas[index].clone(),
            expression: expressions[index].clone(),
            global_orient: roots[index],
            body_pose: std::array::from_fn(|joint| bodies[index][joint]),
            jaw_pose: jaws[index],
            left_eye_pose: left_eyes[index],
            right_eye_pose: right_eyes[index],
            left_hand_pose,
            right_hand_pose,
            transl: Vec3::from_slice(&translations[3 * index..]),
        });
        let frames = frames.collect();
        Ok(Motion { frames, zeroed, ..Motion::default() })
    }

    /// The array under the first of the names that is there.
    fn find(&self, names: &[&str]) -> Option<(String, &Array)> {
        names.iter().find_map(|name| {
            let key = format!("{}{name}", self.prefix);
            let array = self.fields.arrays.get(&key)?;
            Some((key, array))
        })
    }

    fn missing(&self, names: &[&str]) -> Error {
        self.fields.malformed(
            &format!("{}{}", self.prefix, names[0]),
            "missing",
            format_args!("one of {}", quoted(names)),
        )
    }

    /// All numbers of an array, finite, `count` of them.
    fn numbers(&self, key: &str, array: &Array, count: usize) -> Result<Vec<f32>> {
        let wrong = || self.fields.malformed(key, array.description(), format_args!("{count} numbers in all"));
        let values = array.to_f32().filter(|values| values.len() == count).ok_or_else(wrong)?;
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(self.fields.malformed(key, value, "finite numbers")),
            None => Ok(values),
        }
    }

    /// Rotations of `joints` joints in each of `count` frames.
    fn rotations(
        &self,
        key: &str,
        array: &Array,
        count: usize,
        joints: usize,
        kind: Rotations,
    ) -> Result<Vec<PoseAxisAngle>> {
        let elements = element_count(&array.shape).unwrap_or(0);
        if kind == Rotations::Vectors || elements == 3 * count * joints {
            let values = self.numbers(key, array, 3 * count * joints)?;
            return Ok(values
                .as_chunks::<3>()
                .0
                .iter()
                .map(|vector| PoseAxisAngle(Vec3::from_array(*vector)))
                .collect());
        }
        let values = self.numbers(key, array, 9 * count * joints)?;
        let rotation = |row_major: &[f32; 9]| {
            axis_angle(row_major).ok_or_else(|| {
                self.fields.malformed(key, format_args!("the matrix {row_major:?}"), "rotation matrices")
            })
        };
        values.as_chunks::<9>().0.iter().map(rotation).collect()
    }

    fn hands(
        &self,
        names: &'static [&'static str],
        count: usize,
        kind: Rotations,
        zeroed: &mut Vec<String>,
    ) -> Result<Vec<HandPose>> {
        let Some((key, array)) = self.find(names) else {
            zeroed.push(names[0].to_owned());
            return Ok(vec![HandPose::default(); count]);
        };
        let elements = element_count(&array.shape).unwrap_or(0);
        let fifteen = |joints: &[PoseAxisAngle]| std::array::from_fn(|joint| joints[joint]);
        if kind == Rotations::Matrices && elements == 9 * 15 * count {
            let joints = self.rotations(&key, array, count, 15, kind)?;
            return Ok(joints.chunks_exact(15).map(|joints| HandPose::Flat(fifteen(joints))).collect());
        }
        if elements == 45 * count {
            let joints = self.rotations(&key, array, count, 15, Rotations::Vectors)?;
            let pose = if self.flat_hands()? { HandPose::Flat } else { HandPose::RelativeToMean };
            return Ok(joints.chunks_exact(15).map(|joints| pose(fifteen(joints))).collect());
        }
        let width = elements / count;
        if width == 0 || width > 45 || width * count != elements {
            let expected = format!("{count} frames of 15 joints, or of up to 45 PCA coefficients");
            return Err(self.fields.malformed(&key, array.description(), expected));
        }
        let values = self.numbers(&key, array, elements)?;
        Ok(values.chunks_exact(width).map(|row| HandPose::Pca(row.to_vec())).collect())
    }

    fn flat_hands(&self) -> Result<bool> {
        let key = format!("{}{FLAT_HANDS}", self.prefix);
        let key = [key.as_str(), FLAT_HANDS].into_iter().find(|key| self.fields.arrays.contains_key(*key));
        match key {
            Some(key) => Ok(self.fields.number(key)? != 0.0),
            None => Ok(false),
        }
    }

    /// The first `used` of at least as many coefficients a frame, or of all frames.
    fn coefficients(
        &self,
        names: &'static [&'static str],
        used: usize,
        count: usize,
        zeroed: &mut Vec<String>,
    ) -> Result<Vec<Vec<f32>>> {
        let Some((key, array)) = self.find(names) else {
            zeroed.push(names[0].to_owned());
            return Ok(vec![Vec::new(); count]);
        };
        let elements = element_count(&array.shape).unwrap_or(0);
        let width = array.shape.last().copied().unwrap_or(0);
        let rows = elements.checked_div(width).unwrap_or(0);
        if width < used || (rows != 1 && rows != count) {
            let expected = format!("{used} or more coefficients, once or for {count} frames");
            return Err(self.fields.malformed(&key, array.description(), expected));
        }
        let values = self.numbers(&key, array, elements)?;
        let row = |index: usize| values[index % rows * width..][..used].to_vec();
        Ok((0..count).map(row).collect())
    }
}

/// Frames, joints and kind of a body pose's shape, whose last extents are (63), (66), (21, 3), (22, 3) or those of matrices.
fn layout(shape: &[usize]) -> Option<(usize, usize, Rotations)> {
    let layouts: [(&[usize], usize, Rotations); 6] = [
        (&[21, 3, 3], 21, Rotations::Matrices),
        (&[22, 3, 3], 22, Rotations::Matrices),
        (&[21, 3], 21, Rotations::Vectors),
        (&[22, 3], 22, Rotations::Vectors),
        (&[63], 21, Rotations::Vectors),
        (&[66], 22, Rotations::Vectors),
    ];
    let fits = |(ending, joints, kind): &(&[usize], usize, Rotations)| {
        let leading = shape.strip_suffix(*ending)?;
        Some((element_count(leading).ok()?, *joints, *kind))
    };
    layouts.iter().find_map(fits)
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

/// The name after the last dot.
fn leaf(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}

/// The prefix with its item numbers taken out: `results[].smplx.`.
fn unnumbered(prefix: &str) -> String {
    let mut shown = String::new();
    let mut inside = false;
    for character in prefix.chars() {
        inside = (inside && character != ']') || character == '[';
        if !inside || character == '[' {
            shown.push(character);
        }
    }
    shown
}

/// The item numbers of a prefix, in order.
fn numbers(prefix: &str) -> Vec<u64> {
    prefix.split('[').skip(1).filter_map(|part| part.split(']').next()?.parse().ok()).collect()
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
