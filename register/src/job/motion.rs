//! The motions that a capture leaves: a file for every sequence, with all its frames in order.
//!
//! A frame that was left out lies between the nearest good ones, turned along the arc from one to the other; before the first and after the
//! last good one it is as that. A sequence without any good frame has no file.

use std::path::PathBuf;

use xavatar_body::smplx;
use xavatar_data::{FrameId, Motion, UpAxis, write_motion};
use xavatar_formats::Result;

use super::Working;
use super::record::Record;
use super::report::{FrameReport, Verdict};
use crate::fit::Shaped;
use crate::linear::FramePose;

/// Frames between the first and the last of a sequence, as places in a job's list.
type Places = Vec<usize>;

impl Working<'_> {
    /// Writes the motion of every sequence; the paths are returned. Reports are of all frames, in order.
    pub(super) fn write_motions(
        &self,
        records: &[Option<Record>],
        reports: &[FrameReport],
        shaped: &Shaped,
    ) -> Result<Vec<PathBuf>> {
        let sequences = self.sequences();
        let mut paths = Vec::new();
        for (id, places) in &sequences {
            let is_told_apart = sequences.iter().filter(|(other, _)| other.sequence == id.sequence).count() == 1;
            let name = if is_told_apart { id.sequence.clone() } else { format!("{}-{}", id.split, id.sequence) };
            let path = self.job.out.join(format!("{name}.npz"));
            let known: Vec<Option<FramePose>> = places
                .iter()
                .map(|place| {
                    let (record, report) = (records[*place].as_ref()?, &reports[*place]);
                    (report.verdict == Verdict::Registered).then(|| self.pose_of(*place, record, &report.missing_hands))
                })
                .collect();
            let frames: Vec<smplx::Parameters> =
                filled(&known).iter().map(|pose| smplx::Parameters::from(&pose.pose(&shaped.shape))).collect();
            if frames.is_empty() {
                continue;
            }
            let motion = Motion {
                frames,
                frames_per_second: self.job.frames_per_second.map(|rate| rate as f32),
                up: UpAxis::Y,
                ..Motion::default()
            };
            write_motion(&path, &motion)?;
            paths.push(path);
        }
        Ok(paths)
    }

    /// The sequences, each with its first frame's name and the places of all.
    pub(super) fn sequences(&self) -> Vec<(&FrameId, Places)> {
        let mut sequences: Vec<(&FrameId, Places)> = Vec::new();
        for (place, files) in self.files.iter().enumerate() {
            let is_same = |(first, _): &&mut (&FrameId, Places)| {
                (&first.split, &first.sequence) == (&files.id().split, &files.id().sequence)
            };
            match sequences.iter_mut().find(is_same) {
                Some((_, places)) => places.push(place),
                None => sequences.push((files.id(), vec![place])),
            }
        }
        sequences
    }
}

/// The poses with gaps filled; none if there is no pose.
fn filled(known: &[Option<FramePose>]) -> Vec<FramePose> {
    let at = |place: usize| known[place].as_ref().map(|pose| (place, pose));
    let pose = |place: usize| {
        let (before, after) = ((0..=place).rev().find_map(at), (place..known.len()).find_map(at));
        match (before, after) {
            (Some((first, one)), Some((last, other))) if first < last => {
                Some(one.between(other, (place - first) as f64 / (last - first) as f64))
            }
            (near, other) => near.or(other).map(|(_, pose)| pose.clone()),
        }
    };
    (0..known.len()).filter_map(pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{Extents, so3};
    use glam::DVec3;

    #[test]
    fn gaps_are_filled_along_the_arc_and_ends_stay() {
        let extents = Extents { joints: 1, shapes: 0, expressions: 1 };
        let pose = |angle: f64| {
            let mut pose = FramePose::turned(extents, [(0, DVec3::Y * angle)]);
            (pose.translation, pose.expression[0]) = (DVec3::X * angle, angle);
            Some(pose)
        };
        let found = filled(&[None, pose(1.0), None, None, pose(2.5), None]);
        for (pose, expected) in found.iter().zip([1.0, 1.0, 1.5, 2.0, 2.5, 2.5]) {
            assert!(so3::log(&pose.rotations[0]).distance(DVec3::Y * expected) < 1e-9, "{expected}");
            assert!((pose.translation.x - expected).abs() + (pose.expression[0] - expected).abs() < 1e-9);
        }
        assert_eq!(found.len(), 6);
        assert!(filled(&[None, None]).is_empty());
    }
}
