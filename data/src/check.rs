//! What can be known of a subject before it is trained: frames, sizes, distances, conventions.
//!
//! Every frame is read; up to [`MEASURED`] of them, spread evenly, are measured against the registered body. A scan point
//! belongs to the part of its closest body face; distances in millimetres, lengths in metres. The hand convention is judged by
//! posing the hands both ways and asking which lie on the scan; the unit by the heights of scan and body. The order of threads
//! changes nothing: points are taken at even strides, not drawn.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::{FrameFiles, FrameId, FrameNotes, ScanFrame, Subject, read_frame};
use xavatar_body::{BodyModel, BodyParameters, HandPose, Part, PartLabels, Role, Skeleton, smplx};
use xavatar_formats::Result;
use xavatar_mesh::{Note, SurfaceIndex, Topology};

/// Frames that are measured.
const MEASURED: usize = 16;
/// Points per frame whose distances are measured.
const POINTS: usize = 4000;
const MILLIMETRES: f32 = 1000.0;
/// The other hand convention is taken for the true one if it brings the hands nearer by this factor, and by so many millimetres.
const CLEARLY_NEARER: (f32, f32) = (0.7, 0.5);
/// A registration farther from its scan than this (median) is not of it, millimetres.
const UNRELATED: f32 = 100.0;
/// Heights of people, metres.
const PLAUSIBLE_HEIGHT: std::ops::RangeInclusive<f32> = 0.5..=2.5;
/// Units by how many of them a metre has.
pub(super) const UNITS: [(&str, f32); 4] =
    [("metres", 1.0), ("inches", 39.37), ("centimetres", 100.0), ("millimetres", 1000.0)];

/// What [`check`] found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// neutral, female or male.
    pub gender: String,
    /// Height of the body in the T-pose with the subject's mean shape, metres.
    pub body_height: f32,
    /// Where the part labels are from.
    pub part_labels: String,
    /// Frames by sequence.
    pub sequences: Vec<SequenceReport>,
    /// Frames that could be read and were measured.
    pub measured_frames: usize,
    /// Distance from scan points to the registered body by part.
    pub distances: BTreeMap<String, DistanceReport>,
    /// Measured scans whose every edge, seams merged, has two faces.
    pub watertight_scans: usize,
    /// Most open edges of a measured scan.
    pub most_open_edges: usize,
    /// How the hands fit in either convention; absent if no frame was measured, or none has hands with conventions.
    pub hands: Option<HandReport>,
    /// Median height of the measured scans by that of their bodies: 1 if both are in metres.
    pub scan_to_body_height: Option<f32>,
    /// The unit of the scans, if the heights name one.
    pub scan_unit: Option<&'static str>,
    /// Frames that cannot be read.
    pub unusable: Vec<UnusableFrame>,
    /// Why training would fail.
    pub problems: Vec<String>,
    /// What training would survive, but not well.
    pub warnings: Vec<String>,
}

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

/// Median distance of the body's hands to the scan under both conventions, millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HandReport {
    /// Taken as offsets from the mean hand, the layout's convention.
    pub relative_to_mean_mm: f32,
    /// Taken as absolute rotations.
    pub flat_mm: f32,
}

/// A frame that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UnusableFrame {
    /// The frame, as `split/sequence/number`.
    pub frame: String,
    /// Why.
    pub reason: String,
}

/// Reads every frame of a subject and measures some of them against the body. `progress` hears of each frame that is done.
///
/// # Errors
/// Those of [`BodyModel::pose`] for the subject's shape. What is wrong with the data is in the report.
pub fn check(
    subject: &Subject,
    body: &BodyModel,
    labels: &PartLabels,
    progress: &(dyn Fn() + Sync),
) -> Result<CheckReport> {
    let standing = body.pose(&body.skeleton().rest_pose().in_shape(&subject.betas))?;
    let files: Vec<&FrameFiles> = subject.train.iter().chain(&subject.test).collect();
    let stride = files.len().div_ceil(MEASURED).max(1);
    let frames: Vec<Result<(Vec<Note>, Option<Measurement>)>> = files
        .par_iter()
        .enumerate()
        .map(|(place, files)| {
            let seen = read_frame(files, &subject.betas).and_then(|frame| {
                let measured = (place % stride == 0).then(|| measure(&frame, body, labels)).transpose();
                let measured = measured.map_err(|error| error.in_frame(frame.id.to_string()))?;
                Ok((frame.notes, measured))
            });
            progress();
            seen
        })
        .collect();
    let mut notes = FrameNotes::default();
    for (files, seen) in files.iter().zip(&frames) {
        seen.iter().for_each(|(lost, _)| notes.add(&files.id, lost));
    }

    let reasons = frames.iter().map(|frame| frame.as_ref().err().map(reason));
    let (sequences, unusable) = count_sequences(files.iter().map(|files| &files.id).zip(reasons));
    let measured: Vec<Measurement> = frames.into_iter().filter_map(|frame| frame.ok()?.1).collect();

    let heights: Vec<f32> = measured.iter().map(|frame| frame.scan_to_body_height).collect();
    let scan_to_body_height = percentile(heights, 0.5);
    let mut report = CheckReport {
        gender: subject.gender.to_string(),
        body_height: height(&standing.vertices),
        part_labels: labels.source.to_string(),
        sequences,
        measured_frames: measured.len(),
        distances: distances_by_part(body.skeleton(), measured.iter().flat_map(|frame| frame.to_body.iter().copied())),
        watertight_scans: measured.iter().filter(|frame| frame.topology.is_watertight()).count(),
        most_open_edges: measured.iter().map(|frame| frame.topology.open_edges).max().unwrap_or(0),
        hands: hands(&measured),
        scan_to_body_height,
        scan_unit: scan_to_body_height.and_then(unit),
        unusable,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    judge(&mut report);
    report.warnings.extend(notes.lines());
    Ok(report)
}

/// What one frame says.
struct Measurement {
    /// Distances from scan points to the body, by part, millimetres.
    to_body: Vec<(Part, f32)>,
    /// Distances from the body's hands to the scan: as stored, and with absolute rotations; millimetres.
    hands_to_scan: [Vec<f32>; 2],
    topology: Topology,
    scan_to_body_height: f32,
}

fn measure(frame: &ScanFrame, body: &BodyModel, labels: &PartLabels) -> Result<Measurement> {
    let posed = body.mesh(body.pose(&body.resolve(&frame.parameters)?)?.vertices);
    let body_surface = SurfaceIndex::new(&posed)?;
    let to_body = strided(&frame.scan.vertices, POINTS).map(|&point| {
        let closest = body_surface.closest(point);
        let corner = (0..3).max_by(|&a, &b| closest.barycentric[a].total_cmp(&closest.barycentric[b])).unwrap_or(0);
        let vertex = posed.faces[closest.face as usize][corner];
        (labels.parts[vertex as usize], closest.distance * MILLIMETRES)
    });
    let to_body = to_body.collect();

    let scan_surface = SurfaceIndex::new(&frame.scan)?;
    let hand_vertices: Vec<usize> =
        body.skeleton().parts_of(Role::Hands).flat_map(|part| labels.vertices_of(part)).collect();
    let hand_distances = |vertices: &[Vec3]| {
        let distance = |&vertex: &usize| scan_surface.closest(vertices[vertex]).distance * MILLIMETRES;
        strided(&hand_vertices, POINTS / 4).map(distance).collect::<Vec<_>>()
    };
    let other =
        with_flat_hands(&frame.parameters).map(|parameters| body.pose(&body.resolve(&parameters)?)).transpose()?;
    let hands_to_scan = match other {
        Some(other) => [hand_distances(&posed.vertices), hand_distances(&other.vertices)],
        None => [Vec::new(), Vec::new()],
    };
    Ok(Measurement {
        to_body,
        hands_to_scan,
        topology: Topology::of(&frame.scan.merged_by_position()),
        scan_to_body_height: height(&frame.scan.vertices) / height(&posed.vertices),
    })
}

/// The same numbers, taken as absolute rotations; none where they are already.
fn with_flat_hands(parameters: &BodyParameters) -> Option<BodyParameters> {
    let parameters = parameters.smplx().ok()?;
    let flat = |hand: &HandPose| match hand {
        HandPose::RelativeToMean(rotations) => HandPose::Flat(*rotations),
        other => other.clone(),
    };
    let (left_hand_pose, right_hand_pose) = (flat(&parameters.left_hand_pose), flat(&parameters.right_hand_pose));
    Some(smplx::Parameters { left_hand_pose, right_hand_pose, ..parameters.clone() }.into())
}

/// About `count` items at even strides.
pub(super) fn strided<T>(items: &[T], count: usize) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(count).max(1))
}

pub(super) fn height(vertices: &[Vec3]) -> f32 {
    let range = vertices.iter().fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v.y), high.max(v.y)));
    range.1 - range.0
}

/// The frames of each sequence, of ids in order with the reason why a frame cannot be used, and the frames that cannot.
pub(super) fn count_sequences<'a>(
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
pub(super) fn distances_by_part(
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

fn hands(measured: &[Measurement]) -> Option<HandReport> {
    let median = |convention: usize| {
        let values = measured.iter().flat_map(|frame| frame.hands_to_scan[convention].iter().copied());
        percentile(values.collect(), 0.5)
    };
    Some(HandReport { relative_to_mean_mm: median(0)?, flat_mm: median(1)? })
}

/// The unit whose size explains the ratio of scan to body height; hair and hats, or missing feet, change it by less than this.
fn unit(ratio: f32) -> Option<&'static str> {
    let fits = |&&(_, per_metre): &&(&str, f32)| (0.6..1.6).contains(&(ratio / per_metre));
    UNITS.iter().find(fits).map(|(name, _)| *name)
}

fn judge(report: &mut CheckReport) {
    let usable = |split: &str| {
        let of_split = report.sequences.iter().filter(|sequence| sequence.split == split);
        of_split.map(|sequence| sequence.frames - sequence.unusable).sum::<usize>()
    };
    let (mut problems, mut warnings) = (Vec::new(), Vec::new());
    if usable("train") == 0 {
        problems.push("no frame can be trained on: complete the folder train/<sequence>".into());
    }
    if usable("test") == 0 {
        warnings.push("no test frame: `xavatar eval --split test` will have nothing to measure".into());
    }
    let broken = report.unusable.iter().filter(|frame| frame.frame.starts_with("train/")).count();
    if broken > 0 {
        problems.push(format!(
            "{broken} training {} cannot be read: mend or remove, or train with --skip-bad-frames",
            if broken == 1 { "frame" } else { "frames" }
        ));
    }
    if !PLAUSIBLE_HEIGHT.contains(&report.body_height) {
        warnings.push(format!(
            "the body is {:.2} m high: is mean_shape_smplx.npy of this subject and model?",
            report.body_height
        ));
    }
    match (report.scan_to_body_height, report.scan_unit) {
        (None, _) | (_, Some("metres")) => {}
        (Some(ratio), Some(unit)) => {
            problems.push(format!("the scans are in {unit}, {ratio:.0} times the body: convert them to metres"));
        }
        (Some(ratio), None) => warnings.push(format!(
            "the scans are {ratio:.2} times as high as the registered bodies: are both in metres and Y up?"
        )),
    }
    let is_metric = report.scan_unit == Some("metres");
    let apart = report.distances.get("all").filter(|all| all.median_mm > UNRELATED).filter(|_| is_metric);
    if let Some(all) = apart {
        problems.push(format!(
            "half of the scans' points are more than {:.0} mm from the registered body: are parameters and scans of the \
             same frames, and `transl` and Y up those of the scans?",
            all.median_mm
        ));
    }
    if let Some(hands) = report.hands.filter(|_| is_metric && apart.is_none()) {
        let (factor, margin) = CLEARLY_NEARER;
        if hands.flat_mm < factor * hands.relative_to_mean_mm && hands.flat_mm + margin < hands.relative_to_mean_mm {
            warnings.push(format!(
                "the hands fit better as absolute rotations ({:.1} mm) than as offsets from the mean hand ({:.1} mm): the \
                 registration seems to use the flat hand convention; subtract hands_meanl/r from the hand poses",
                hands.flat_mm, hands.relative_to_mean_mm
            ));
        }
    }
    if report.watertight_scans < report.measured_frames {
        warnings.push(format!(
            "{} of {} scans have holes (up to {} open edges): inside and outside are decided by winding numbers",
            report.measured_frames - report.watertight_scans,
            report.measured_frames,
            report.most_open_edges
        ));
    }
    report.problems = problems;
    report.warnings = warnings;
}

/// The value below which `share` of the values are; none of no values.
pub(super) fn percentile(mut values: Vec<f32>, share: f32) -> Option<f32> {
    let last = values.len().checked_sub(1)?;
    let place = (share * last as f32).round() as usize;
    Some(*values.select_nth_unstable_by(place, f32::total_cmp).1)
}

/// The error without the frame's name, which stands beside it.
pub(super) fn reason(error: &xavatar_formats::Error) -> String {
    match error {
        xavatar_formats::Error::Frame { source, .. } => reason(source),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_told_by_heights() {
        for (name, per_metre) in UNITS {
            for clothing in [0.8, 1.0, 1.3] {
                assert_eq!(unit(clothing * per_metre), Some(name));
            }
        }
        for ratio in [0.0, 0.1, 5.0, f32::NAN, f32::INFINITY] {
            assert_eq!(unit(ratio), None);
        }
    }

    #[test]
    fn percentiles_are_of_the_sorted_values() {
        let values: Vec<f32> = (0..=100).rev().map(|value| value as f32).collect();
        assert_eq!(percentile(values.clone(), 0.5), Some(50.0));
        assert_eq!(percentile(values, 0.95), Some(95.0));
        assert_eq!(percentile(Vec::new(), 0.5), None);
    }
}
