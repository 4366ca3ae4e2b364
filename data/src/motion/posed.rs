//! A clip on a certain skeleton: the poses of any avatar, whatever its motion is of.
//!
//! A file of the skeleton's own poses is read as it is. Motions of SMPL-X drive every skeleton that corresponds to it, by its joints' names.

use std::path::Path;

use super::clip::USUAL_RATE;
use super::parameters::RATE_NAMES;
use super::{Clip, MotionOptions, Warning};
use crate::whole_poses::{not_of, read_whole_poses};
use xavatar_body::{BodyModel, BodyParameters, Pose, Skeleton, smplx};
use xavatar_formats::{ArrayFile, ArrayMap, Error, Result};

/// Poses of a skeleton, at a known rate.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedClip {
    /// The pose of each frame (T), at least one.
    pub poses: Vec<Pose>,
    /// How fast they follow each other.
    pub frames_per_second: f32,
    /// What was read, detected, declared and changed, a line each, for the user.
    pub report: Vec<String>,
    /// What may be wrong with it, a line each: loud.
    pub warnings: Vec<Warning>,
}

impl Clip {
    /// The clip on a skeleton, with the body model to resolve hands where there is one.
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, if the skeleton is one that SMPL-X's joints mean nothing to, or the hands take a body to be known.
    pub fn onto(&self, skeleton: &Skeleton, body: Option<&BodyModel>) -> Result<PosedClip> {
        let (own, mut report) = (smplx::skeleton(), self.report.clone());
        let is_own = skeleton.joints == own.joints;
        if is_own || !own.corresponds_to(skeleton) {
            let poses = self.poses(body)?;
            poses.first().map_or(Ok(()), |_| skeleton.require(own, "the motion"))?;
            return Ok(self.with(poses, report));
        }
        let absolute = |frame: &smplx::Parameters| match body.map(BodyModel::hands) {
            Some(hands) if hands.len() == 2 => frame.resolve(hands),
            // A skeleton without hand conventions: what a hand adds to a mean that is not there is all of it.
            _ => BodyParameters::from(frame.with_flat_hands()).absolute(),
        };
        let mut left_out = std::collections::BTreeSet::new();
        let mut poses = Vec::with_capacity(self.frames.len());
        for frame in &self.frames {
            let transferred = own.transfer(&absolute(frame)?, skeleton);
            left_out.extend(transferred.left_out);
            poses.push(transferred.pose);
        }
        report.push(format!("of SMPL-X, on {}: joints of one name turn alike", skeleton.description()));
        if !left_out.is_empty() {
            report.push(format!("joints that it has not: {}", left_out.into_iter().collect::<Vec<_>>().join(", ")));
        }
        Ok(self.with(poses, report))
    }

    fn with(&self, poses: Vec<Pose>, report: Vec<String>) -> PosedClip {
        let (frames_per_second, warnings) = (self.frames_per_second, self.warnings.clone());
        PosedClip { poses, frames_per_second, report, warnings }
    }
}

impl PosedClip {
    /// Reads a motion for a skeleton: one of its own poses, else one of any format that [`Clip::load`] reads.
    ///
    /// # Errors
    /// Those of [`Clip::load`] and [`Clip::onto`]; [`Error::Mismatch`] for a file of neither.
    pub fn load(path: &Path, options: &MotionOptions, skeleton: &Skeleton, body: Option<&BodyModel>) -> Result<Self> {
        if skeleton.joints != smplx::skeleton().joints
            && let Some(own) = own(path, options, skeleton, body)?
        {
            return Ok(own);
        }
        let clip = Clip::load(path, options).and_then(|clip| clip.onto(skeleton, body));
        // What the file lacks of its own poses is more to the point than what it lacks of SMPL-X's.
        clip.map_err(|error| match error {
            Error::Unrecognised { .. } if skeleton.joints != smplx::skeleton().joints => {
                let arrays = ArrayFile::read(path).ok().flatten().map(|file| file.arrays).unwrap_or_default();
                not_of(path, &arrays, skeleton.joints.len())
            }
            error => error,
        })
    }
}

/// A file of the skeleton's own poses.
fn own(
    path: &Path,
    options: &MotionOptions,
    skeleton: &Skeleton,
    body: Option<&BodyModel>,
) -> Result<Option<PosedClip>> {
    let is_array_file =
        path.is_file() && path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("bvh"));
    let Some(file) = is_array_file.then(|| ArrayFile::read(path)).transpose()?.flatten() else { return Ok(None) };
    let Some(frames) = read_whole_poses(path, &file.arrays, skeleton.joints.len())? else { return Ok(None) };
    let resolve = |(index, frame): (usize, &BodyParameters)| {
        let pose = match (frame, body) {
            (BodyParameters::Absolute(pose), _) => Ok(pose.clone()),
            (frame, Some(body)) => body.resolve(frame),
            (frame, None) => frame.absolute(),
        };
        pose.map_err(|error| error.in_frame(format!("{} of the motion", index + 1)))
    };
    let mut poses = frames.iter().enumerate().map(resolve).collect::<Result<Vec<Pose>>>()?;
    if let Some((first, last)) = options.frames {
        let last = last.unwrap_or(poses.len());
        if first == 0 || first > last || last > poses.len() {
            return Err(Error::Value {
                name: "frames".into(),
                found: format!("{first}..{last}"),
                expected: format!("within 1..{}, the motion's frames", poses.len()),
            });
        }
        poses = poses.drain(first - 1..last).collect();
    }
    let frames_per_second = options.source_rate.or_else(|| stated_rate(&file.arrays)).unwrap_or(USUAL_RATE);
    let report = vec![
        format!("motion: {} frames from {} (poses of {})", poses.len(), path.display(), skeleton.description()),
        format!("frame rate: {frames_per_second} per second"),
    ];
    Ok(Some(PosedClip { poses, frames_per_second, report, warnings: Vec::new() }))
}

fn stated_rate(arrays: &ArrayMap) -> Option<f32> {
    let rate = RATE_NAMES.iter().find_map(|name| arrays.get(*name)?.to_f32()?.first().copied());
    rate.filter(|rate| rate.is_finite() && *rate > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use xavatar_body::{HandPose, PoseAxisAngle, mano, smpl};
    use xavatar_formats::{Array, write_npz};

    fn turned() -> Clip {
        let turn = PoseAxisAngle(glam::Vec3::new(0.0, 0.3, 0.0));
        let hand = HandPose::RelativeToMean([turn; 15]);
        let frame =
            smplx::Parameters { body_pose: [turn; 21], jaw_pose: turn, left_hand_pose: hand, ..Default::default() };
        Clip { frames: vec![frame], frames_per_second: 24.0, report: Vec::new(), warnings: Vec::new() }
    }

    #[test]
    fn a_motion_of_smplx_drives_what_has_its_joints() {
        let body = turned().onto(smpl::skeleton(), None).unwrap();
        assert_eq!(body.poses[0].rotations[18].0.y, 0.3);
        assert!(body.report.iter().any(|line| line.contains("jaw")), "{:?}", body.report);
        let hand = turned().onto(&mano::skeleton("left"), None).unwrap();
        assert_eq!(hand.poses[0].rotations[3].0.y, 0.3);
        let mut strange = smpl::skeleton().clone();
        strange.joints.iter_mut().for_each(|name| name.push('?'));
        assert!(turned().onto(&strange, None).is_err());
    }

    #[test]
    fn a_file_of_own_poses_is_read_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.npz");
        let rows = |width: usize, value: f32| Array::from_f32(&[3, width], vec![value; 3 * width]);
        write_npz(
            &path,
            &[("poses".to_owned(), rows(48, 0.2)), ("fps".to_owned(), Array::from_f32(&[], vec![60.0]))].into(),
        )
        .unwrap();
        let (hand, options) =
            (mano::skeleton("right"), MotionOptions { frames: Some((2, None)), ..MotionOptions::default() });
        let clip = PosedClip::load(&path, &options, &hand, None).unwrap();
        assert_eq!((clip.poses.len(), clip.frames_per_second, clip.poses[0].rotations[15].0.x), (2, 60.0, 0.2));
        write_npz(&path, &[("bends".to_owned(), rows(48, 0.2))].into()).unwrap();
        let message = PosedClip::load(&path, &options, &hand, None).unwrap_err().to_string();
        assert!(message.contains("`pose` with 48 numbers a frame, for 16 joints"), "{message}");
    }
}
