//! Frames that ended in the wrong place, found by what can be measured, and tried again from the poses of frames near them.

use xavatar_formats::Result;

use super::quality::FrameQuality;
use super::sequence::{Frame, Sequence};
use super::subject::{Fitter, Shaped, Start};
use crate::linear::FramePose;

/// Share of the body that may be far from the scan.
const BODY_FAR: f64 = 0.06;
/// A frame is odd if more of its scan is uncovered than of the median frame, by this and by three deviations.
const MORE_UNCOVERED: f64 = 0.03;
/// Good frames before and after one that are tried as its start.
const NEIGHBOURS: usize = 2;

impl FrameQuality {
    /// One number to choose between fits of the same frame by; less is better.
    pub fn misfit(&self) -> f64 {
        self.uncovered + self.body_far()
    }

    /// The largest share of a part of the body that is far from the scan.
    pub fn body_far(&self) -> f64 {
        self.parts
            .get("body")
            .map_or_else(|| self.parts.values().map(|part| part.far).fold(0.0, f64::max), |body| body.far)
    }
}

/// Which frames are doubtful among those of one subject.
pub fn doubtful(qualities: &[FrameQuality]) -> Vec<bool> {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let usual = median(qualities.iter().map(|quality| quality.uncovered).collect());
    let deviation = 1.4826 * median(qualities.iter().map(|quality| (quality.uncovered - usual).abs()).collect());
    let most = usual + MORE_UNCOVERED.max(3.0 * deviation);
    qualities.iter().map(|quality| quality.uncovered > most || quality.body_far() > BODY_FAR).collect()
}

impl Fitter<'_> {
    /// Fits doubtful frames again from the frames near them that are not, and keeps what lies better; returns the qualities.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if a body stops being a number.
    pub fn refit(&self, poses: &mut [FramePose], frames: &[Frame], shaped: &Shaped) -> Result<Vec<FrameQuality>> {
        let thickness = &shaped.clothing.thickness;
        let of = |poses: Vec<FramePose>| Sequence { poses, shape: shaped.shape.clone() };
        let mut qualities = self.qualities(&of(poses.to_vec()), frames, thickness)?;
        let bad = doubtful(&qualities);
        for place in (0..poses.len()).filter(|place| bad[*place]) {
            let before = (0..place).rev().filter(|other| !bad[*other]).take(NEIGHBOURS);
            let after = (place + 1..poses.len()).filter(|other| !bad[*other]).take(NEIGHBOURS);
            for other in before.chain(after).collect::<Vec<_>>() {
                let mut start = poses[other].clone();
                start.translation += frames[place].scan.middle() - frames[other].scan.middle();
                let pose = self.fit_pose(Start::FromElsewhere(start), &frames[place], shaped)?;
                let quality = self.qualities(&of(vec![pose.clone()]), &frames[place..=place], thickness)?.remove(0);
                if quality.misfit() < qualities[place].misfit() {
                    (poses[place], qualities[place]) = (pose, quality);
                }
            }
        }
        Ok(qualities)
    }
}
