//! What can be known of a subject before it is trained: frames, sizes, places, distances, conventions.
//!
//! Every frame is read and inspected: whether its scan is a surface, and where it stands against its registered body, limb by
//! limb ([`inspection`]); what all frames share is said once ([`judgement`]), with the placement that mends it. Up to
//! [`MEASURED`] frames, spread evenly, are measured to the millimetre ([`distances`]).

mod alignment;
mod checked_frames;
mod common_placement;
mod distances;
mod finding;
mod inspection;
mod judgement;
mod limb_check;
mod limb_fit;
mod segments;
mod soundness;
mod statistics;
mod surface_points;
#[cfg(test)]
mod testing;
mod wording;

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

pub use checked_frames::CheckedFrames;
pub use distances::HandReport;
pub use finding::{Defect, Finding};
pub use limb_check::LimbCheck;
pub use statistics::{DistanceReport, SequenceReport, UnusableFrame};

pub(super) use alignment::UNITS;
pub(super) use statistics::{count_sequences, distances_by_part, height, percentile, reason, strided};

use self::alignment::Similarity;
use self::distances::Distances;
use self::inspection::{Inspector, Observation};
use self::judgement::{Judged, Looked};
use super::{FrameFiles, FrameNotes, ScanFrame, ScanPlacement, Subject, read_frame};
use xavatar_body::{BodyModel, PartLabels, Skeleton};
use xavatar_formats::Result;
use xavatar_mesh::Note;

/// Frames that are measured to the millimetre.
const MEASURED: usize = 16;
/// The other hand convention is taken for the true one if it brings the hands nearer by this factor, and by so many millimetres.
const CLEARLY_NEARER: (f32, f32) = (0.7, 0.5);
/// Heights of people, metres.
const PLAUSIBLE_HEIGHT: std::ops::RangeInclusive<f32> = 0.5..=2.5;
/// Frames before and after one whose bodies are compared with its scan.
const NEIGHBOURS: usize = 3;

/// What [`check`] found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// How the folder is laid out.
    pub layout: &'static str,
    /// neutral, female or male.
    pub gender: String,
    /// Height of the body in the T-pose with the subject's shape, metres.
    pub body_height: f32,
    /// Where the part labels are from.
    pub part_labels: String,
    /// Frames by sequence.
    pub sequences: Vec<SequenceReport>,
    /// Frames that could be read and were inspected.
    pub inspected_frames: usize,
    /// Those of them that were measured.
    pub measured_frames: usize,
    /// Distance from scan points to the registered body by part.
    pub distances: BTreeMap<String, DistanceReport>,
    /// Inspected scans whose every edge, seams merged, has two faces.
    pub watertight_scans: usize,
    /// Most open edges of an inspected scan.
    pub most_open_edges: usize,
    /// Inspected scans with colours.
    pub coloured_scans: usize,
    /// How the hands fit in either convention; absent if no frame was measured.
    pub hands: Option<HandReport>,
    /// Median height of the measured scans by that of their bodies: 1 if both are in metres.
    pub scan_to_body_height: Option<f32>,
    /// Frames that cannot be read.
    pub unusable: Vec<UnusableFrame>,
    /// Why training would fail, or give somebody else's avatar.
    pub problems: Vec<Finding>,
    /// What training would survive, but not well.
    pub warnings: Vec<Finding>,
    /// What brings all scans onto their bodies, if one placement does.
    pub mend: Option<ScanPlacement>,
}

/// A frame that was looked at: what was noted of it as it was read, and how far it is from its body where that is measured.
type Seen = (Looked, Vec<Note>, Option<Distances>);

/// Reads and inspects every frame of a subject. `progress` hears of each frame that is done.
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
    let inspector = Inspector::new(body);
    let frames: Vec<Result<Seen>> = files
        .par_iter()
        .enumerate()
        .map(|(place, files)| {
            let seen = read_frame(files, &subject.betas).and_then(|frame| {
                let name = frame.id.to_string();
                look(&frame, &inspector, body)
                    .and_then(|looked| {
                        let is_measured = place % stride == 0 && !looked.is_beyond_measure();
                        let distances = is_measured.then(|| Distances::of(&frame, body, labels)).transpose()?;
                        Ok((looked, frame.notes.clone(), distances))
                    })
                    .map_err(|error| error.in_frame(name))
            });
            progress();
            seen
        })
        .collect();

    let mut notes = FrameNotes::default();
    for (files, seen) in files.iter().zip(&frames) {
        seen.iter().for_each(|(_, lost, _)| notes.add(&files.id, lost));
    }
    let reasons = frames.iter().map(|frame| frame.as_ref().err().map(reason));
    let (sequences, unusable) = count_sequences(files.iter().map(|files| &files.id).zip(reasons));
    let places: Vec<usize> = (0..frames.len()).filter(|place| frames[*place].is_ok()).collect();
    let (mut looked, measured): (Vec<Looked>, Vec<Option<Distances>>) =
        frames.into_iter().flatten().map(|(looked, _, measured)| (looked, measured)).unzip();
    find_other_placements(&mut looked, &places, &files, subject, &inspector);
    find_other_frames(&mut looked, &places, &files, subject, &inspector);
    let measured: Vec<Distances> = measured.into_iter().flatten().collect();
    let Judged { findings, mend } = judgement::judge(&looked);

    let topologies = || looked.iter().filter_map(|one| one.inspection.topology);
    let heights: Vec<f32> = measured.iter().map(|frame| frame.scan_to_body_height).collect();
    let mut report = CheckReport {
        layout: subject.layout.name(),
        gender: subject.gender.to_string(),
        body_height: height(&standing.vertices),
        part_labels: labels.source.to_string(),
        sequences,
        inspected_frames: looked.len(),
        measured_frames: measured.len(),
        distances: distances_by_part(body.skeleton(), measured.iter().flat_map(|frame| frame.to_body.iter().copied())),
        watertight_scans: topologies().filter(|topology| topology.is_watertight()).count(),
        most_open_edges: topologies().map(|topology| topology.open_edges).max().unwrap_or(0),
        coloured_scans: looked.iter().filter(|one| one.inspection.has_colours).count(),
        hands: distances::hands(&measured),
        scan_to_body_height: percentile(heights, 0.5),
        unusable,
        problems: Vec::new(),
        warnings: Vec::new(),
        mend,
    };
    let (problems, warnings) = report
        .of_subject(subject, body.skeleton(), &notes)
        .into_iter()
        .chain(findings)
        .partition(|finding| finding.name.is_problem());
    (report.problems, report.warnings) = (problems, warnings);
    Ok(report)
}

/// Inspects one frame.
fn look(frame: &ScanFrame, inspector: &Inspector<'_>, body: &BodyModel) -> Result<Looked> {
    let inspection = inspector.inspect(frame, true)?;
    let pelvis = body.pose(&body.resolve(&frame.parameters)?)?.joints[0];
    Ok(Looked {
        frame: frame.id.to_string(),
        inspection,
        translation: frame.parameters.translation(),
        pelvis,
        fits_instead: None,
        fits_too: None,
    })
}

impl Looked {
    /// Whether nothing was seen but, at most, faces from inside.
    fn is_in_place(&self) -> bool {
        self.inspection.observations.iter().all(|observation| matches!(observation, Observation::InsideOut))
    }

    /// Whether distances to the body would say nothing.
    fn is_beyond_measure(&self) -> bool {
        self.inspection.observations.iter().any(|observation| {
            matches!(observation, Observation::NoSurface(_) | Observation::Size(_) | Observation::Far(_))
        })
    }
}

/// Tries the placement of a few scans on those that lie on their bodies as they are.
fn find_other_placements(
    looked: &mut [Looked],
    places: &[usize],
    files: &[&FrameFiles],
    subject: &Subject,
    inspector: &Inspector<'_>,
) {
    let Some(placement) = judgement::placement_of_some(looked) else { return };
    looked.par_iter_mut().zip(places).filter(|(one, _)| one.is_in_place()).for_each(|(one, &place)| {
        let fits = read_frame(files[place], &subject.betas)
            .and_then(|frame| inspector.is_of(&frame.scan, &frame.parameters, &placement));
        one.fits_too = fits.unwrap_or(false).then_some(placement);
    });
}

/// Compares scans that do not lie on their bodies with the bodies of frames near them.
fn find_other_frames(
    looked: &mut [Looked],
    places: &[usize],
    files: &[&FrameFiles],
    subject: &Subject,
    inspector: &Inspector<'_>,
) {
    let strayed = judgement::strayed(looked);
    let fits_instead: Vec<Option<String>> = strayed
        .par_iter()
        .map(|&number| {
            let place = places[number];
            let frame = read_frame(files[place], &subject.betas).ok()?;
            let near = place.saturating_sub(NEIGHBOURS)..(place + NEIGHBOURS + 1).min(files.len());
            near.filter(|other| *other != place).find_map(|other| {
                let parameters = files[other].read_parameters(&subject.betas).ok()?;
                let fits = inspector.is_of(&frame.scan, &parameters, &Similarity::IDENTITY).unwrap_or(false);
                fits.then(|| files[other].id.to_string())
            })
        })
        .collect();
    for (number, instead) in strayed.into_iter().zip(fits_instead) {
        looked[number].fits_instead = instead;
    }
}

impl CheckReport {
    /// Whether training from these scans would give an avatar of this subject.
    #[must_use]
    pub fn is_fit(&self) -> bool {
        self.problems.is_empty()
    }

    /// Findings about the subject as a whole.
    fn of_subject(&self, subject: &Subject, skeleton: &Skeleton, notes: &FrameNotes) -> Vec<Finding> {
        let usable = |split: &str| {
            let of_split = self.sequences.iter().filter(|sequence| sequence.split == split);
            of_split.map(|sequence| sequence.frames - sequence.unusable).sum::<usize>()
        };
        let mut findings = Vec::new();
        let mut add = |name, message: String| findings.push(Finding::of_subject(name, message));
        if usable("train") == 0 {
            add(Defect::NoFrames, "no frame can be trained on: each needs a scan and the body registered to it".into());
        }
        if usable("test") == 0 {
            add(
                Defect::NoTestFrames,
                "no test frame: there will be nothing to measure on but what was learned from".into(),
            );
        }
        let broken = self.unusable.iter().filter(|frame| frame.frame.starts_with("train/")).count();
        if broken > 0 {
            let frames = if broken == 1 { "frame" } else { "frames" };
            add(
                Defect::Unreadable,
                format!("{broken} training {frames} cannot be read: mend, remove or leave them out"),
            );
        }
        if skeleton.is_whole_body() && !PLAUSIBLE_HEIGHT.contains(&self.body_height) {
            let height = self.body_height;
            add(Defect::BodyHeight, format!("the body is {height:.2} m high: is its shape of this subject and model?"));
        }
        if let Some(spread) = subject.shape_spread.filter(|spread| *spread > LARGEST_SHAPE_SPREAD) {
            let text = format!(
                "the registrations have shapes of their own, up to {spread:.2} apart in a coefficient; their mean is used: are all \
                 frames of one person?"
            );
            add(Defect::Shapes, text);
        }
        if !subject.absent.is_empty() {
            let absent = subject.absent.join(", ");
            add(Defect::Incomplete, format!("no registration has {absent}: taken as zero"));
        }
        if let Some(hands) = self.hands.filter(HandReport::is_flat) {
            let HandReport { flat_mm, relative_to_mean_mm } = hands;
            let text = format!(
                "the hands fit better as absolute rotations ({flat_mm:.1} mm) than as offsets from the mean hand \
                 ({relative_to_mean_mm:.1} mm): the registration seems to use the flat hand convention; write \
                 `hands = \"flat\"` into {}",
                Subject::DESCRIPTION_FILE
            );
            add(Defect::Hands, text);
        }
        notes.lines().for_each(|line| add(Defect::Lost, line));
        let colourless = self.inspected_frames - self.coloured_scans;
        if colourless > 0 {
            let text = format!(
                "{colourless} of {} scans have no colours: the avatar will be grey there; export them with colours or a texture",
                self.inspected_frames
            );
            add(Defect::NoColours, text);
        }
        if self.watertight_scans < self.inspected_frames {
            let text = format!(
                "{} of {} scans have holes (up to {} open edges): inside and outside are decided by winding numbers",
                self.inspected_frames - self.watertight_scans,
                self.inspected_frames,
                self.most_open_edges
            );
            add(Defect::Holes, text);
        }
        findings
    }
}

/// Shape coefficients of one person differ by less between registrations.
const LARGEST_SHAPE_SPREAD: f32 = 0.5;

impl HandReport {
    /// Whether the hands fit clearly better as absolute rotations; only hands that lie on the scan say so.
    fn is_flat(&self) -> bool {
        let (factor, margin) = CLEARLY_NEARER;
        self.flat_mm < factor * self.relative_to_mean_mm
            && self.flat_mm + margin < self.relative_to_mean_mm
            && self.flat_mm < 25.0
    }
}
