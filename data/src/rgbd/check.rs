//! What can be known of RGB-D frames before they are trained on: files, units, cameras, distances.
//!
//! Every frame is read; up to [`MEASURED`] of them, spread evenly, are measured against the registered body. The unit is judged
//! where the registered body appears in the picture: measured depth by the body's depth is 1 if both are in metres. If the body
//! does not appear there, other conventions of the camera's pose are tried, and the one that fits is named.

use std::collections::BTreeMap;

use glam::{Mat4, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::subject::RawFrame;
use super::{PointCloud, RgbdFiles, RgbdSubject};
use crate::check::{
    Defect, DistanceReport, Finding, SequenceReport, UNITS, UnusableFrame, count_sequences, distances_by_part, height,
    percentile, reason, strided,
};
use xavatar_body::{BodyModel, Part, PartLabels, Registration};
use xavatar_formats::Result;
use xavatar_mesh::camera::PinholeCamera;

/// Frames that are measured.
const MEASURED: usize = 16;
/// Points a frame whose distances are measured.
const POINTS: usize = 4000;
const MILLIMETRES: f32 = 1000.0;
/// A registration farther from the depth than this (median) is not of it, millimetres.
const UNRELATED: f32 = 100.0;
/// The body appears in a picture if so many of its vertices have a depth there.
const APPEARS: f32 = 0.3;
/// How far a depth may be from that of the body, as a factor, for a camera convention to fit.
const FITS: std::ops::RangeInclusive<f32> = 0.8..=1.25;
/// Points a frame below which details are lost: a person of 200 pixels' height.
const FEW_POINTS: usize = 5000;

/// What [`check_rgbd`] found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RgbdCheckReport {
    /// neutral, female or male.
    pub gender: String,
    /// Height of the body in the T-pose with the subject's mean shape, metres.
    pub body_height: f32,
    /// Where the part labels are from.
    pub part_labels: String,
    /// Frames by sequence.
    pub sequences: Vec<SequenceReport>,
    /// Frames that were measured.
    pub measured_frames: usize,
    /// Median number of surface points of the measured frames.
    pub points: Option<usize>,
    /// Distance from surface points to the nearest vertex of the registered body by part.
    pub distances: BTreeMap<String, DistanceReport>,
    /// Median of measured depth by that of the registered body: 1 if both are in metres.
    pub depth_to_body: Option<f32>,
    /// How high the body would be if the depths were right, metres.
    pub apparent_height: Option<f32>,
    /// Frames that cannot be used.
    pub unusable: Vec<UnusableFrame>,
    /// Why training would fail.
    pub problems: Vec<Finding>,
    /// What training would survive, but not well.
    pub warnings: Vec<Finding>,
}

/// Reads every frame of a subject and measures some of them against the body. `progress` hears of each frame that is done.
///
/// # Errors
/// Those of [`BodyModel::pose`] for the subject's shape. What is wrong with the data is in the report.
pub fn check_rgbd(
    subject: &RgbdSubject,
    body: &BodyModel,
    labels: &PartLabels,
    progress: &(dyn Fn() + Sync),
) -> Result<RgbdCheckReport> {
    let standing = body.pose(&body.skeleton().rest_pose().in_shape(&subject.betas))?;
    let body_height = height(&standing.vertices);
    let files: Vec<&RgbdFiles> = subject.train.iter().chain(&subject.test).collect();
    let stride = files.len().div_ceil(MEASURED).max(1);
    let frames: Vec<Seen> = files
        .par_iter()
        .enumerate()
        .map(|(place, files)| {
            let seen = look_at(files, &subject.betas, body, labels, place % stride == 0);
            progress();
            seen
        })
        .collect();

    let reasons = frames.iter().map(|frame| frame.usable.as_ref().err().map(reason));
    let (sequences, unusable) = count_sequences(files.iter().map(|files| &files.id).zip(reasons));
    let clouds: Vec<&Measured> = frames.iter().filter_map(|frame| frame.usable.as_ref().ok()?.as_ref()).collect();
    let placements: Vec<&Placement> = frames.iter().filter_map(|frame| frame.placement.as_ref()).collect();
    let in_sight = placements.iter().filter(|placement| placement.share >= APPEARS);
    let depth_to_body = percentile(in_sight.map(|placement| placement.ratio).collect(), 0.5);
    let points = percentile(clouds.iter().map(|cloud| cloud.points as f32).collect(), 0.5);
    let mut report = RgbdCheckReport {
        gender: subject.gender.to_string(),
        body_height,
        part_labels: labels.source.to_string(),
        sequences,
        measured_frames: placements.len(),
        points: points.map(|points| points as usize),
        distances: distances_by_part(body.skeleton(), clouds.iter().flat_map(|cloud| cloud.to_body.iter().copied())),
        depth_to_body,
        apparent_height: depth_to_body.map(|ratio| ratio * body_height),
        unusable,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    judge(&mut report, &placements);
    Ok(report)
}

/// What one frame says.
struct Seen {
    /// Where the body appears in the picture, if the frame was read and measured.
    placement: Option<Placement>,
    /// Its surface points, if measured; or why the frame cannot be used.
    usable: Result<Option<Measured>>,
}

/// The surface points of a frame.
struct Measured {
    /// How many there are.
    points: usize,
    /// Some of them: their parts, and their distances to the body, millimetres.
    to_body: Vec<(Part, f32)>,
}

/// How the registered body and the measured depths go together.
#[derive(Clone, Copy)]
struct Placement {
    /// Share of the body's vertices that lie before the camera, in the picture, where it has a depth.
    share: f32,
    /// Median there of measured depth by the body's.
    ratio: f32,
    /// Another reading of the camera's pose that fits, if this one does not.
    instead: Option<&'static str>,
}

fn look_at(files: &RgbdFiles, betas: &[f32], body: &BodyModel, labels: &PartLabels, measured: bool) -> Seen {
    let raw = match files.read_raw(betas) {
        Ok(raw) => raw,
        Err(error) => return Seen { placement: None, usable: Err(error) },
    };
    if !measured {
        return Seen { placement: None, usable: files.interpret(raw).map(|_| None) };
    }
    let posed = match body.resolve(&raw.frame.parameters).and_then(|pose| body.pose(&pose)) {
        Ok(posed) => posed,
        Err(error) => return Seen { placement: None, usable: Err(error) },
    };
    let placement = Some(placement(&raw, files.metres_per_unit, &posed.vertices));
    let measure = || {
        let cloud = PointCloud::of(&files.interpret(raw)?)?;
        let registration = Registration::new(&posed.vertices, labels)?;
        let nearest = |point: &Vec3| registration.nearest(*point);
        let far = strided(&cloud.points, POINTS).map(nearest).map(|(part, distance)| (part, distance * MILLIMETRES));
        Ok(Some(Measured { points: cloud.points.len(), to_body: far.collect() }))
    };
    Seen { placement, usable: measure() }
}

/// Where the body appears, and whether another convention of the camera would explain the depths better.
fn placement(raw: &RawFrame, metres_per_unit: f32, vertices: &[Vec3]) -> Placement {
    let camera = raw.frame.camera;
    let (share, ratio) = agreement(raw, metres_per_unit, vertices, &camera);
    let fits = |(share, ratio): (f32, f32)| share >= APPEARS && FITS.contains(&ratio);
    let flip = Mat4::from_scale(Vec3::new(1.0, -1.0, -1.0));
    let (pose, inverse) = (camera.extrinsic(), camera.extrinsic().inverse());
    let readings = [
        ("camera to world", inverse),
        ("in OpenGL's axes (y up, z backward)", flip * pose),
        ("camera to world in OpenGL's axes (y up, z backward)", flip * inverse),
    ];
    let instead = readings.into_iter().find(|(_, extrinsic)| {
        let other = camera.posed(*extrinsic);
        other.is_ok_and(|other| fits(agreement(raw, metres_per_unit, vertices, &other)))
    });
    Placement { share, ratio, instead: instead.map(|(name, _)| name).filter(|_| !fits((share, ratio))) }
}

/// The share of vertices that appear where there is a depth, and the median of that depth by theirs.
fn agreement(raw: &RawFrame, metres_per_unit: f32, vertices: &[Vec3], camera: &PinholeCamera) -> (f32, f32) {
    let mut ratios = Vec::new();
    let mut looked_for = 0;
    for &vertex in strided(vertices, POINTS) {
        looked_for += 1;
        let (pixel, depth) = camera.project(vertex);
        let inside =
            pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < camera.width as f32 && pixel.y < camera.height as f32;
        if depth <= 0.0 || !inside {
            continue;
        }
        let place = pixel.y as usize * camera.width as usize + pixel.x as usize;
        let measured = raw.depth.values[place] * metres_per_unit;
        if measured > 0.0 && measured.is_finite() && raw.frame.mask.as_ref().is_none_or(|mask| mask[place]) {
            ratios.push(measured / depth);
        }
    }
    let share = ratios.len() as f32 / looked_for.max(1) as f32;
    (share, percentile(ratios, 0.5).unwrap_or(f32::NAN))
}

fn judge(report: &mut RgbdCheckReport, placements: &[&Placement]) {
    let usable = |split: &str| {
        let of_split = report.sequences.iter().filter(|sequence| sequence.split == split);
        of_split.map(|sequence| sequence.frames - sequence.unusable).sum::<usize>()
    };
    let mut findings = Vec::new();
    let mut add = |name, message: String| findings.push(Finding::of_subject(name, message));
    if usable("train") == 0 {
        add(Defect::NoFrames, "no frame can be trained on".into());
    }
    let broken = report.unusable.iter().filter(|frame| frame.frame.starts_with("train/")).count();
    if broken > 0 {
        let text = "training frames that cannot be used";
        add(Defect::Unreadable, format!("{text}: {broken}; mend, remove or leave them out"));
    }
    let strayed =
        placements.iter().filter(|placement| placement.share < APPEARS || placement.instead.is_some()).count();
    let instead = placements.iter().find_map(|placement| placement.instead);
    if 2 * strayed > placements.len() {
        let text = match instead {
            Some(name) => format!(
                "the extrinsics are {name}: convert them to world to camera in OpenCV's axes (x right, y down, z forward)"
            ),
            None => "the registered body does not appear where the pictures have depth: are cameras, pictures and bodies of \
                     the same frames, and the extrinsics world to camera, in metres, in OpenCV's axes?"
                .into(),
        };
        add(Defect::Camera, text);
    } else if let (Some(ratio), Some(tall)) = (report.depth_to_body, report.apparent_height) {
        if !FITS.contains(&ratio) {
            add(Defect::Unit, depth_unit(ratio, tall));
        }
        let all = report.distances.get("all").filter(|all| all.median_mm > UNRELATED && FITS.contains(&ratio));
        if let Some(all) = all {
            let text = format!(
                "half of the points are more than {:.0} mm from the registered body: are parameters and pictures of the same \
                 frames, and is depth z, not the length of the ray?",
                all.median_mm
            );
            add(Defect::OtherFrame, text);
        }
    }
    if let Some(points) = report.points.filter(|points| *points < FEW_POINTS) {
        let text = format!("a frame has only {points} points of the subject: go nearer, or use a finer camera");
        add(Defect::FewPoints, text);
    }
    (report.problems, report.warnings) = findings.into_iter().partition(|finding| finding.name.is_problem());
}

/// In which unit depths are that are not in metres.
fn depth_unit(ratio: f32, tall: f32) -> String {
    let tall = if tall < 0.1 { format!("{:.1} mm", tall * MILLIMETRES) } else { format!("{tall:.0} m") };
    // A unit declared too large makes depths too large, and too small, too small.
    let explained =
        |&&(_, per_metre): &&(&str, f32)| FITS.contains(&(ratio / per_metre)) || FITS.contains(&(ratio * per_metre));
    let unit = UNITS.iter().skip(1).find(explained);
    match unit {
        Some((name, _)) if ratio > 1.0 => {
            format!("the body would be {tall} tall: the depth pictures are in {name}; declare that (depth_unit)")
        }
        Some((name, _)) => format!(
            "the body would be {tall} tall: the depth pictures are not in {name}, but probably in metres; declare that (depth_unit)"
        ),
        None => format!(
            "the body would be {tall} tall: depth is {ratio:.3} times that of the registered body; correct depth_unit"
        ),
    }
}
