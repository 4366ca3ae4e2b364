//! Poses of one body by arrays of all its joints' rotations, as files of SMPL, SMPL+H, MANO, FLAME and SUPR have them.
//!
//! `pose` has all, three numbers a joint; or `global_orient` the root's, and the others `body_pose`, `hand_pose` (MANO, relative to its mean
//! hand, or coefficients of its components, as smplx saves them), or an array a joint (FLAME's `neck_pose`, `jaw_pose`, `leye_pose`, `reye_pose`). A frame, or T as rows.

use std::path::Path;

use xavatar_body::{BodyParameters, HandPose, Pose, PoseAxisAngle, mano, smplx};
use xavatar_formats::{Array, ArrayMap, Error, Result};

use crate::fields::{Fields, rotations};

const FORMAT: &str = "file of poses";
/// Names of one array with all rotations.
const WHOLE: [&str; 7] = ["pose", "poses", "smpl_pose", "smplh_pose", "full_pose", "fullpose", "thetas"];
/// Of the root's.
const ROOT: [&str; 3] = ["global_orient", "root_orient", "root_pose"];
const TRANSLATION: [&str; 4] = ["transl", "trans", "translation", "Th"];
const SHAPE: [&str; 2] = ["betas", "shape"];
const EXPRESSION: [&str; 3] = ["expression", "exp", "expr"];
/// FLAME's joints after the root.
const HEAD: [&str; 4] = ["neck_pose", "jaw_pose", "leye_pose", "reye_pose"];
/// Components of a hand's rotations.
const FINGERS: usize = 45;

/// The parameters of each frame of a file whose body has so many joints, with as many coefficients as are used; none if it has no such arrays.
///
/// # Errors
/// [`Error::Malformed`] for arrays of different numbers of frames, or numbers that are not finite.
pub(crate) fn read_whole_poses(path: &Path, arrays: &ArrayMap, joints: usize) -> Result<Option<Vec<BodyParameters>>> {
    let file = File { fields: Fields { path, format: FORMAT, arrays } };
    let Some(Turns { frames: poses, fingers }) = file.turns(joints)? else { return Ok(None) };
    let frames = poses.len();
    let (translations, shapes, expressions) =
        (file.rows(&TRANSLATION, frames)?, file.rows(&SHAPE, frames)?, file.rows(&EXPRESSION, frames)?);
    let parameters = |(frame, rotations): (usize, Vec<PoseAxisAngle>)| {
        let row = |rows: &Option<Rows>| rows.as_ref().map_or_else(Vec::new, |rows| rows.of_frame(frame).to_vec());
        let used = |rows: &Option<Rows>, most: usize| row(rows).into_iter().take(most).collect::<Vec<f32>>();
        let translation = row(&translations).try_into().unwrap_or([0.0; 3]).into();
        match &fingers {
            Some(fingers) => mano::Parameters {
                betas: used(&shapes, smplx::SHAPES),
                global_orient: rotations[0],
                hand_pose: hand_pose(fingers.of_frame(frame)),
                transl: translation,
            }
            .into(),
            None => Pose {
                rotations,
                shape: used(&shapes, smplx::SHAPES),
                expression: used(&expressions, smplx::EXPRESSIONS),
                translation,
            }
            .into(),
        }
    };
    Ok(Some(poses.into_iter().enumerate().map(parameters).collect()))
}

fn hand_pose(numbers: &[f32]) -> HandPose {
    match numbers.len() {
        FINGERS => HandPose::RelativeToMean(rotations(numbers)),
        _ => HandPose::Pca(numbers.to_vec()),
    }
}

/// The numbers of an array, one row a frame or one for all.
struct Rows {
    values: Vec<f32>,
    width: usize,
}

impl Rows {
    fn of_frame(&self, frame: usize) -> &[f32] {
        let rows = self.values.len() / self.width.max(1);
        let frame = frame.min(rows.saturating_sub(1));
        &self.values[frame * self.width..(frame + 1) * self.width]
    }
}

/// The rotations of frames.
struct Turns {
    /// Of all joints; zero for fingers that are told apart.
    frames: Vec<Vec<PoseAxisAngle>>,
    /// Fingers that are relative to a mean hand.
    fingers: Option<Rows>,
}

struct File<'a> {
    fields: Fields<'a>,
}

impl File<'_> {
    /// The rotations of all joints of each frame.
    fn turns(&self, joints: usize) -> Result<Option<Turns>> {
        let absolute = |frames| Ok(Some(Turns { frames, fingers: None }));
        let turns = |row: &[f32]| row.as_chunks::<3>().0.iter().map(|turn| PoseAxisAngle((*turn).into())).collect();
        for key in WHOLE.iter().filter(|key| self.fields.arrays.contains_key(**key)) {
            let numbers = self.numbers(key)?;
            if !numbers.is_empty() && numbers.len().is_multiple_of(3 * joints) {
                return absolute(numbers.chunks_exact(3 * joints).map(turns).collect());
            }
        }
        let Some(root) = ROOT.iter().find(|key| self.fields.arrays.contains_key(**key)) else { return Ok(None) };
        let root = self.numbers(root)?;
        let frames = root.len() / 3;
        let has = |key: &str| self.fields.arrays.contains_key(key);
        if frames == 0 || root.len() % 3 != 0 {
            return Ok(None);
        }
        let own = |frame: usize| root[3 * frame..3 * frame + 3].to_vec();
        if joints == mano::JOINTS && has("hand_pose") {
            let values = self.numbers("hand_pose")?;
            let width = values.len() / frames;
            if width * frames != values.len() || !(1..=FINGERS).contains(&width) {
                return Err(self.fields.malformed(
                    "hand_pose",
                    self.fields.array("hand_pose")?.description(),
                    "1 to 45 numbers a frame",
                ));
            }
            let whole = |frame: usize| turns(&[own(frame), vec![0.0; FINGERS]].concat());
            return Ok(Some(Turns { frames: (0..frames).map(whole).collect(), fingers: Some(Rows { values, width }) }));
        }
        let names: &[&str] = if joints == 1 + HEAD.len() && !has("body_pose") { &HEAD } else { &["body_pose"] };
        let mut rows: Vec<Vec<f32>> = (0..frames).map(own).collect();
        for name in names {
            let width = if names.len() == 1 { 3 * (joints - 1) } else { 3 };
            let values = if has(name) { self.numbers(name)? } else { vec![0.0; frames * width] };
            if values.len() != frames * width {
                return Ok(None);
            }
            rows.iter_mut().zip(values.chunks_exact(width)).for_each(|(row, values)| row.extend_from_slice(values));
        }
        match names.iter().any(|name| has(name)) {
            true => absolute(rows.iter().map(|row| turns(row)).collect()),
            false => Ok(None),
        }
    }

    /// The rows of the first array that is there, one a frame or one for all.
    fn rows(&self, keys: &[&str], frames: usize) -> Result<Option<Rows>> {
        let Some(key) = keys.iter().find(|key| self.fields.arrays.contains_key(**key)) else { return Ok(None) };
        let array = self.fields.array(key)?;
        let values = self.numbers(key)?;
        // A vector without rows is of all frames.
        let rows = if array.shape.len() <= 1 || values.len() == *array.shape.last().unwrap_or(&0) { 1 } else { frames };
        match values.len().checked_div(rows) {
            Some(width) if width * rows == values.len() => Ok(Some(Rows { values, width })),
            _ => {
                Err(self.fields.malformed(key, array.description(), format_args!("a row for each of {frames} frames")))
            }
        }
    }

    /// All numbers of an array, finite.
    fn numbers(&self, key: &str) -> Result<Vec<f32>> {
        let count = self.fields.array(key)?.shape.iter().product();
        self.fields.numbers(key, count)
    }
}

/// The joints of the one family whose whole pose a frame's file has, by the number of its rotations; none if there is none.
pub(crate) fn joints_of_frame(arrays: &ArrayMap, families: &[usize]) -> Option<usize> {
    let count = |key: &str| Some(arrays.get(key)?.to_f32()?.len());
    if let Some(count) = WHOLE.iter().find_map(|key| count(key)) {
        return families.iter().copied().find(|joints| 3 * joints == count);
    }
    let is_root = ROOT.iter().any(|key| count(key) == Some(3));
    let of_root = |rest: usize| families.iter().copied().find(|joints| 3 * (joints - 1) == rest);
    match (is_root, count("body_pose"), count("hand_pose")) {
        (true, Some(rest), _) => of_root(rest),
        (true, None, Some(_)) => Some(mano::JOINTS),
        (true, None, None) if HEAD[..2].iter().all(|name| arrays.contains_key(*name)) => Some(1 + HEAD.len()),
        _ => None,
    }
}

/// What a file with poses of other joints is told.
pub(crate) fn not_of(path: &Path, arrays: &ArrayMap, joints: usize) -> Error {
    let names: Vec<String> =
        arrays.iter().map(|(name, array)| format!("{name} {}", Array::description(array))).take(12).collect();
    Error::Mismatch {
        path: path.into(),
        found: format!("the arrays {}", names.join(", ")),
        expected: format!("`pose` with {} numbers a frame, for {joints} joints", 3 * joints),
        remedy: "docs/motion.md has the names".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(arrays: &[(&str, &[usize], f32)]) -> ArrayMap {
        let array = |shape: &[usize], value: f32| Array::from_f32(shape, vec![value; shape.iter().product()]);
        arrays.iter().map(|(name, shape, value)| ((*name).to_owned(), array(shape, *value))).collect()
    }

    fn read(arrays: &[(&str, &[usize], f32)], joints: usize) -> Option<Vec<BodyParameters>> {
        read_whole_poses(Path::new("a.npz"), &map(arrays), joints).unwrap()
    }

    #[test]
    fn one_array_has_the_rotations_of_all_joints() {
        let frames = read(&[("poses", &[2, 36], 0.25), ("trans", &[2, 3], 1.5), ("betas", &[10], 0.5)], 12).unwrap();
        assert_eq!(frames.len(), 2);
        let BodyParameters::Absolute(pose) = &frames[1] else { panic!("absolute") };
        assert_eq!((pose.rotations.len(), pose.rotations[11].0.x, pose.translation.y), (12, 0.25, 1.5));
        assert_eq!(pose.shape, [0.5; 10]);
        assert_eq!(read(&[("poses", &[12, 3], 0.25)], 12).unwrap().len(), 1);
        assert!(read(&[("poses", &[2, 35], 0.25)], 12).is_none());
    }

    #[test]
    fn hands_and_heads_come_in_pieces() {
        let hand = read(&[("global_orient", &[1, 3], 0.1), ("hand_pose", &[1, 6], 0.2)], 16).unwrap();
        let BodyParameters::Mano(hand) = &hand[0] else { panic!("relative") };
        assert_eq!(hand.hand_pose, HandPose::Pca(vec![0.2; 6]));
        let relative = read(&[("global_orient", &[3], 0.1), ("hand_pose", &[45], 0.2)], 16).unwrap();
        assert!(
            matches!(&relative[0], BodyParameters::Mano(hand) if matches!(hand.hand_pose, HandPose::RelativeToMean(_)))
        );
        let head = [
            ("global_orient", &[3][..], 0.1),
            ("jaw_pose", &[3], 0.3),
            ("neck_pose", &[3], 0.2),
            ("expression", &[10], 1.0),
        ];
        let BodyParameters::Absolute(pose) = read(&head, 5).unwrap().remove(0) else { panic!("absolute") };
        assert_eq!(pose.rotations.iter().map(|turn| turn.0.y).collect::<Vec<_>>(), [0.1, 0.2, 0.3, 0.0, 0.0]);
        assert_eq!(pose.expression.len(), 10);
    }

    #[test]
    fn a_frames_numbers_say_of_how_many_joints_it_is() {
        let of = |arrays: &[(&str, &[usize], f32)]| joints_of_frame(&map(arrays), &[24, 52, 16, 5]);
        assert_eq!(of(&[("pose", &[72], 0.0)]), Some(24));
        assert_eq!(of(&[("pose", &[1, 48], 0.0)]), Some(16));
        assert_eq!(of(&[("pose", &[50], 0.0)]), None);
        assert_eq!(of(&[("global_orient", &[3], 0.0), ("body_pose", &[69], 0.0)]), Some(24));
        assert_eq!(of(&[("global_orient", &[3], 0.0), ("hand_pose", &[6], 0.0)]), Some(16));
        assert_eq!(of(&[("global_orient", &[3], 0.0), ("neck_pose", &[3], 0.0), ("jaw_pose", &[3], 0.0)]), Some(5));
        assert_eq!(of(&[("global_orient", &[3], 0.0), ("body_pose", &[63], 0.0)]), None);
    }

    #[test]
    fn rows_that_do_not_belong_together_are_named() {
        let arrays = map(&[("pose", &[2, 15], 0.0), ("trans", &[5, 3], 0.0)]);
        let message = read_whole_poses(Path::new("a.npz"), &arrays, 5).unwrap_err().to_string();
        assert!(message.contains("`trans`") && message.contains("each of 2 frames"), "{message}");
        let arrays = map(&[("pose", &[15], f32::NAN)]);
        assert!(read_whole_poses(Path::new("a.npz"), &arrays, 5).is_err());
    }
}
