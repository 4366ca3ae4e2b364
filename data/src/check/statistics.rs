//! Small statistics that the checks of scans and of RGB-D frames share.

use std::collections::BTreeMap;

use glam::Vec3;
use serde::Serialize;

use crate::FrameId;
use xavatar_body::{Part, Skeleton};

/// The frames of one sequence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SequenceReport {
    /// `train` or `test`.
    pub split: String,
    /// The folder's name.
    pub sequence: String,
    /// Frames of which there is a file.
    pub frames: usize,
    /// Those that cannot be read.
    pub unusable: usize,
}

/// Distances of many points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DistanceReport {
    /// Half of the points are nearer, millimetres.
    pub median_mm: f32,
    /// 95 % of the points are nearer, millimetres.
    pub percentile_95_mm: f32,
}

/// A frame that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UnusableFrame {
    /// The frame, as `split/sequence/number`.
    pub frame: String,
    /// Why.
    pub reason: String,
}

/// About `count` items at even strides.
pub(crate) fn strided<T>(items: &[T], count: usize) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(count).max(1))
}

/// The extent along Y, metres.
pub(crate) fn height(vertices: &[Vec3]) -> f32 {
    let range = vertices.iter().fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v.y), high.max(v.y)));
    range.1 - range.0
}

/// The value below which `share` of the values are; none of no values.
pub(crate) fn percentile(mut values: Vec<f32>, share: f32) -> Option<f32> {
    let last = values.len().checked_sub(1)?;
    let place = (share * last as f32).round() as usize;
    Some(*values.select_nth_unstable_by(place, f32::total_cmp).1)
}

/// The frames of each sequence, of ids in order with the reason why a frame cannot be used, and the frames that cannot.
pub(crate) fn count_sequences<'a>(
    frames: impl Iterator<Item = (&'a FrameId, Option<String>)>,
) -> (Vec<SequenceReport>, Vec<UnusableFrame>) {
    let mut sequences: Vec<SequenceReport> = Vec::new();
    let mut unusable = Vec::new();
    for (id, reason) in frames {
        let (split, sequence) = (id.split.clone(), id.sequence.clone());
        if sequences.last().is_none_or(|last| (&last.split, &last.sequence) != (&split, &sequence)) {
            sequences.push(SequenceReport { split, sequence, frames: 0, unusable: 0 });
        }
        let counts = sequences.len() - 1;
        sequences[counts].frames += 1;
        if let Some(reason) = reason {
            sequences[counts].unusable += 1;
            unusable.push(UnusableFrame { frame: id.to_string(), reason });
        }
    }
    (sequences, unusable)
}

/// Distances (millimetres) of points by their part, and of all.
pub(crate) fn distances_by_part(
    skeleton: &Skeleton,
    points: impl Iterator<Item = (Part, f32)> + Clone,
) -> BTreeMap<String, DistanceReport> {
    let report = |part: Option<Part>| {
        let of_part = points.clone().filter(|(found, _)| part.is_none_or(|part| *found == part));
        let values: Vec<f32> = of_part.map(|(_, distance)| distance).collect();
        let percentile_95_mm = percentile(values.clone(), 0.95)?;
        Some(DistanceReport { median_mm: percentile(values, 0.5)?, percentile_95_mm })
    };
    let parts = skeleton.parts().filter_map(|(part, group)| Some((group.title(), report(Some(part))?)));
    parts.chain(report(None).map(|all| ("all".to_owned(), all))).collect()
}

/// The error without the frame's name, which stands beside it.
pub(crate) fn reason(error: &xavatar_formats::Error) -> String {
    match error {
        xavatar_formats::Error::Frame { source, .. } => reason(source),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_the_sorted_values() {
        let values: Vec<f32> = (0..=100).rev().map(|value| value as f32).collect();
        assert_eq!(percentile(values.clone(), 0.5), Some(50.0));
        assert_eq!(percentile(values, 0.95), Some(95.0));
        assert_eq!(percentile(Vec::new(), 0.5), None);
    }
}
