//! From what was seen of frames to findings about the subject: what all frames share is said once, the rest frame by frame.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use glam::{Mat3, Quat, Vec3};

use super::alignment::{Alignment, Similarity, UNITS, angle_between};
use super::finding::{Defect, Finding};
use super::inspection::{Inspection, Observation};
use super::segments::Limb;
use super::statistics::percentile;
use crate::{Origin, ScanPlacement};

const MILLIMETRES: f32 = 1000.0;
/// Frames that are placed alike, of all that were looked at, above which the subject's scans are.
const MOST: f32 = 0.6;
/// Turns closer than this are one turn, radians.
const ONE_TURN: f32 = 0.15;
/// Shifts closer than this are one shift, metres.
const ONE_SHIFT: f32 = 0.03;
/// Frames that a message names.
const NAMED: usize = 3;
/// A scale this close to 1 is no other unit.
const ONE_SCALE: f32 = 0.04;

/// What was seen of one frame, and what its placement could be explained by.
pub(super) struct Looked {
    /// `split/sequence/number`.
    pub frame: String,
    pub inspection: Inspection,
    /// The frame's `transl`, and where its pelvis is, metres.
    pub translation: Vec3,
    pub pelvis: Vec3,
    /// The frame whose body fits this scan, if its own does not.
    pub fits_instead: Option<String>,
    /// A placement in which the scan lies on its body as well as it does as it is.
    pub fits_too: Option<Similarity>,
}

/// Findings about scans, and the placement that would mend them, if one does.
#[derive(Default)]
pub(super) struct Judged {
    pub findings: Vec<Finding>,
    pub mend: Option<ScanPlacement>,
}

/// The placement of some frames that others, which lie on their bodies as they are, may share: those of a body in a symmetric
/// pose lie on it mirrored as well. None if no frame is misplaced, or most are.
pub(super) fn placement_of_some(looked: &[Looked]) -> Option<Similarity> {
    if common_placement(looked).is_some() {
        return None;
    }
    looked.iter().flat_map(|one| &one.inspection.observations).find_map(|observation| match observation {
        Observation::Misplaced(found) => Some(found.placement),
        _ => None,
    })
}

/// The places of frames that do not lie on their bodies, for a reason that most frames do not share.
pub(super) fn strayed(looked: &[Looked]) -> Vec<usize> {
    let common = common_placement(looked);
    let strays = |observation: &Observation| match observation {
        Observation::Unrelated { .. } => true,
        Observation::Misplaced(found) => {
            common.as_ref().is_none_or(|common| !common.explains(found) || matches!(common.shift, Shift::Each(_)))
        }
        _ => false,
    };
    (0..looked.len()).filter(|place| looked[*place].inspection.observations.iter().any(strays)).collect()
}

pub(super) fn judge(looked: &[Looked]) -> Judged {
    let mut judged = Judged::default();
    let mut of_frames: BTreeMap<Defect, Vec<(&Looked, String)>> = BTreeMap::new();
    let common = common_placement(looked);
    if let Some(common) = &common {
        judged.findings.extend(findings_of_placement(common));
    }
    for one in looked {
        for observation in &one.inspection.observations {
            if common
                .as_ref()
                .is_some_and(|common| matches!(observation, Observation::Misplaced(found) if common.explains(found)))
            {
                continue;
            }
            let (defect, text) = described(observation, one);
            of_frames.entry(defect).or_default().push((one, text));
        }
    }
    let inside_out = of_frames.get(&Defect::InsideOut).map_or(0, Vec::len);
    let all_inside_out = inside_out > 0 && inside_out as f32 >= MOST * looked.len() as f32;
    judged.mend = common.as_ref().and_then(Common::mend);
    let mirrors = judged.mend.is_some_and(|mend| mend.rotation().determinant() < 0.0);
    if mirrors {
        // Turning a scan inside out is what a mirror does; the faces of one that was turned over already are to follow.
        of_frames.remove(&Defect::InsideOut);
        judged.mend = judged.mend.map(|mend| ScanPlacement { reverse_faces: !all_inside_out, ..mend });
    } else if all_inside_out && (common.is_none() || judged.mend.is_some()) {
        judged.mend = Some(ScanPlacement { reverse_faces: true, ..judged.mend.unwrap_or_default() });
    }
    judged.findings.extend(of_frames.into_iter().map(|(defect, frames)| merged(defect, &frames, looked.len())));
    judged
}

/// What one fault is called, and what is said of it for one frame.
pub(super) fn described(observation: &Observation, looked: &Looked) -> (Defect, String) {
    match observation {
        Observation::NoSurface(reason) => {
            (Defect::NoSurface, format!("the scan is no surface of a body: {reason}; export it again, or leave it out"))
        }
        Observation::Size(factor) => {
            (Defect::Unit, format!("the scan is {factor:.1e} times as large as its body, which no unit explains"))
        }
        Observation::Far(metres) => {
            (Defect::Shifted, format!("the scan is {metres:.1e} m from its body: is `transl` in metres?"))
        }
        Observation::Misplaced(found) => {
            if let Some(other) = &looked.fits_instead {
                return (Defect::OtherFrame, of_other_frame(other));
            }
            let of_frame = Common::of_frame(found, looked);
            let mut said = findings_of_placement(&of_frame);
            let text = said.iter().map(|finding| finding.message.as_str()).collect::<Vec<_>>().join("; ");
            let defect = if said.is_empty() { Defect::Shifted } else { said.remove(0).name };
            (defect, text)
        }
        Observation::Unrelated { apart, least } => match &looked.fits_instead {
            Some(other) => (Defect::OtherFrame, of_other_frame(other)),
            None => (
                Defect::OtherPerson,
                format!(
                    "scan and body are {} apart, and no turn, unit or shift brings them nearer than {}: is the registration of \
                     this frame and this person (shape, gender)?",
                    length(*apart),
                    length(*least)
                ),
            ),
        },
        Observation::Slipped(limbs) => {
            let parts = limbs.iter().map(|(limb, apart)| format!("{} {:.0} mm", limb.name(), apart * MILLIMETRES));
            let parts = parts.collect::<Vec<_>>().join(", ");
            (Defect::Slipped, format!("the registration has slipped: {parts} from the scan; register again"))
        }
        Observation::Missing(limbs) => {
            (Defect::Missing, format!("the scan has no {}; leave the frame out, or scan again", names(limbs.iter())))
        }
        Observation::Doubled(limbs) => {
            let parts = limbs.iter().map(|(limb, times)| format!("{} ({times:.1} times its surface)", limb.name()));
            let parts = parts.collect::<Vec<_>>().join(", ");
            (Defect::Doubled, format!("the scan has more than one {parts}; remove the second, or leave the frame out"))
        }
        Observation::Hollow(surface) => (
            Defect::Hollow,
            format!(
                "the scan is hollow: with a second wall its surface is {surface:.1} times its body's; keep the outer wall only"
            ),
        ),
        Observation::Open(share) => (
            Defect::Open,
            format!("the scan is open around {:.0} % of the body: it has no inside; close its holes", 100.0 * share),
        ),
        Observation::OpenAt(limbs) => {
            let text = format!("the scan is open at {}: its inside is guessed there; close it", names(limbs.iter()));
            (Defect::Holes, text)
        }
        Observation::InsideOut => {
            (Defect::InsideOut, "the scan's faces are seen from inside: turn them over (--fix does)".to_owned())
        }
    }
}

fn names<'a>(limbs: impl Iterator<Item = &'a Limb>) -> String {
    limbs.map(|limb| limb.name()).collect::<Vec<_>>().join(", ")
}

fn of_other_frame(other: &str) -> String {
    format!("the scan fits the body registered to {other}: scans and registrations are numbered differently")
}

/// One finding of a kind: the first frame's text, and where else.
fn merged(defect: Defect, frames: &[(&Looked, String)], looked: usize) -> Finding {
    let names: Vec<String> = frames.iter().map(|(one, _)| one.frame.clone()).collect();
    let mut message = format!("{} of {looked} frames, {}: {}", names.len(), names[0], frames[0].1);
    if names.len() > 1 {
        let others: Vec<&str> = names[1..].iter().take(NAMED).map(String::as_str).collect();
        let more = if names.len() > NAMED + 1 { ", ..." } else { "" };
        let _ = write!(message, " (also {}{more})", others.join(", "));
    }
    Finding { name: defect, message, frames: names }
}

/// A placement that most frames share.
struct Common {
    scale: f32,
    turn: Mat3,
    shift: Shift,
    /// Median distances before and after, metres.
    before: f32,
    after: f32,
    frames: Vec<String>,
    is_of_all: bool,
}

/// What is common to shifts.
enum Shift {
    None,
    Same(Vec3),
    /// They are those from this origin.
    To(Origin),
    /// Each its own: up to so many metres.
    Each(f32),
}

impl Common {
    fn explains(&self, found: &Alignment) -> bool {
        alike(&Similarity { scale: self.scale, turn: self.turn, shift: Vec3::ZERO }, found).is_some()
    }

    fn of_frame(found: &Alignment, looked: &Looked) -> Self {
        let Similarity { scale, turn, shift } = found.placement;
        Self {
            scale,
            turn,
            shift: if shift == Vec3::ZERO { Shift::None } else { Shift::Same(shift) },
            before: found.before,
            after: found.after,
            frames: vec![looked.frame.clone()],
            is_of_all: false,
        }
    }

    /// What `--fix` records; nothing if frames would need placements of their own.
    fn mend(&self) -> Option<ScanPlacement> {
        let placed = ScanPlacement {
            scale: self.scale,
            turn: self.turn.transpose().to_cols_array_2d(),
            ..ScanPlacement::default()
        };
        match self.shift {
            Shift::None => Some(placed),
            Shift::Same(shift) => Some(ScanPlacement { shift: shift.to_array(), ..placed }),
            Shift::To(origin) => Some(ScanPlacement { origin, ..placed }),
            Shift::Each(_) => None,
        }
    }
}

/// The placement of a frame, the best or another that fits as well, that scales and turns as `placement` does.
fn alike(placement: &Similarity, found: &Alignment) -> Option<Similarity> {
    found.placements().find(|other| is_alike(placement, other)).copied()
}

/// Whether two placements scale and turn alike.
fn is_alike(one: &Similarity, other: &Similarity) -> bool {
    is_same_scale(one.scale, other.scale) && angle_between(one.turn, other.turn) < ONE_TURN
}

fn is_same_scale(one: f32, other: f32) -> bool {
    (one / other - 1.0).abs() < ONE_SCALE
}

/// The placement of most frames, if there is one.
fn common_placement(looked: &[Looked]) -> Option<Common> {
    let misplaced: Vec<(&Looked, &Alignment)> = looked
        .iter()
        .filter(|one| one.fits_instead.is_none())
        .filter_map(|one| {
            one.inspection.observations.iter().find_map(|observation| match observation {
                Observation::Misplaced(found) => Some((one, found)),
                _ => None,
            })
        })
        .collect();
    // The first of the largest groups.
    let mut group: Vec<(&Looked, Alignment)> = Vec::new();
    for candidate in misplaced.iter().flat_map(|(_, found)| found.placements()) {
        let mut placed = Vec::new();
        for &(one, found) in &misplaced {
            if let Some(placement) = alike(candidate, found) {
                placed.push((one, Alignment { placement, ..Alignment::clone(found) }));
            }
        }
        if placed.len() > group.len() {
            group = placed;
        }
    }
    if group.is_empty() {
        return None;
    }
    let first = group[0].1.placement;
    let too = |one: &&Looked| one.fits_too.is_some_and(|placement| is_alike(&first, &placement));
    if ((group.len() + looked.iter().filter(too).count()) as f32) < MOST * looked.len() as f32 {
        return None;
    }
    let middle = |value: fn(&Alignment) -> f32| {
        percentile(group.iter().map(|(_, found)| value(found)).collect(), 0.5).unwrap_or(0.0)
    };
    Some(Common {
        scale: first.scale,
        turn: first.turn,
        shift: common_shift(&group),
        before: middle(|found| found.before),
        after: middle(|found| found.after),
        frames: group.iter().map(|(one, _)| one.frame.clone()).collect(),
        is_of_all: true,
    })
}

/// What the shifts of frames have in common.
fn common_shift(group: &[(&Looked, Alignment)]) -> Shift {
    let spread = |point: &dyn Fn(&Looked) -> Vec3| {
        let shifts: Vec<Vec3> = group.iter().map(|(one, found)| found.placement.shift - point(one)).collect();
        let mean = shifts.iter().sum::<Vec3>() / shifts.len() as f32;
        let farthest = shifts.iter().map(|shift| shift.distance(mean)).fold(0.0, f32::max);
        (mean, farthest)
    };
    let (mean, farthest) = spread(&|_| Vec3::ZERO);
    if farthest < ONE_SHIFT {
        return if mean.length() < ONE_SHIFT / 2.0 { Shift::None } else { Shift::Same(mean) };
    }
    let of_origins = [
        (Origin::Translation, spread(&|one: &Looked| one.translation)),
        (Origin::Pelvis, spread(&|one: &Looked| one.pelvis)),
    ];
    for (origin, (mean, farthest)) in of_origins {
        if farthest < ONE_SHIFT && mean.length() < ONE_SHIFT {
            return Shift::To(origin);
        }
    }
    Shift::Each(group.iter().map(|(_, found)| found.placement.shift.length()).fold(0.0, f32::max))
}

/// What is said of a placement: one finding each of unit, turn, mirror and shift.
fn findings_of_placement(common: &Common) -> Vec<Finding> {
    let figures = format!("{} from the bodies, {} when mended", length(common.before), length(common.after));
    let fix = if common.mend().is_some() && common.is_of_all { " (--fix records it)" } else { "" };
    let scans = if common.is_of_all { "the scans are" } else { "the scan is" };
    let finding = |name: Defect, text: String| {
        let frames = if common.is_of_all { Vec::new() } else { common.frames.clone() };
        Finding { name, message: text, frames }
    };
    let mut findings = Vec::new();
    if !is_same_scale(common.scale, 1.0) {
        let unit = UNITS.iter().find(|(_, per_metre)| is_same_scale(common.scale * per_metre, 1.0));
        let text = match unit {
            Some((unit, per_metre)) => format!(
                "{scans} in {unit}, {per_metre:.0} times as large as the bodies: multiply by {}{fix}",
                common.scale
            ),
            None => format!(
                "{scans} {:.3} times as large as the bodies, which no unit explains: multiply by {:.4}{fix}, or give the \
                 shape (betas) of this person",
                1.0 / common.scale,
                common.scale
            ),
        };
        findings.push(finding(Defect::Unit, text));
    }
    let (mirrored, turn) = without_mirror(common.turn);
    if let Some(axis) = mirrored {
        let text = format!(
            "{scans} the mirror image of the bodies, {figures}: negate {axis}{fix}; which of the two is mirrored, the data do not say"
        );
        findings.push(finding(Defect::Mirrored, text));
    }
    if let Some(how) = turned(turn) {
        findings.push(finding(Defect::Turned, format!("{scans} {how}{fix}; {figures}")));
    }
    let shifted = match common.shift {
        Shift::None => None,
        Shift::Same(shift) => {
            Some(format!("shifted: add {:.3} to x, {:.3} to y, {:.3} to z, metres{fix}", shift.x, shift.y, shift.z))
        }
        Shift::To(Origin::Translation) => Some(format!("without `transl`, which was subtracted: add it{fix}")),
        Shift::To(Origin::Pelvis) => Some(format!("centred at the pelvis, and the bodies are not: add its place{fix}")),
        Shift::To(Origin::World) => None,
        Shift::Each(farthest) => Some(format!(
            "elsewhere than the bodies, each in a place of its own, up to {farthest:.2} m: put their own coordinates back, or \
             register them again"
        )),
    };
    if let Some(how) = shifted {
        findings.push(finding(Defect::Shifted, format!("{scans} {how}; {figures}")));
    }
    findings
}

/// The axis that a matrix mirrors, if it does, and the turn that is left: the smallest.
fn without_mirror(turn: Mat3) -> (Option<&'static str>, Mat3) {
    if turn.determinant() > 0.0 {
        return (None, turn);
    }
    let left = [("x", Vec3::X), ("y", Vec3::Y), ("z", Vec3::Z)]
        .map(|(axis, unit)| (Some(axis), turn * Mat3::from_diagonal(Vec3::ONE - 2.0 * unit)));
    let angle = |(_, turn): &(Option<&str>, Mat3)| angle_between(*turn, Mat3::IDENTITY);
    left.into_iter().min_by(|one, other| angle(one).total_cmp(&angle(other))).unwrap_or((None, turn))
}

/// A distance in millimetres, or in metres from one on.
fn length(metres: f32) -> String {
    if metres < 1.0 { format!("{:.0} mm", metres * MILLIMETRES) } else { format!("{metres:.2} m") }
}

/// How scans are turned against bodies that a turn brings them onto, and what undoes it.
fn turned(turn: Mat3) -> Option<String> {
    let angle = angle_between(turn, Mat3::IDENTITY);
    if angle < 1e-3 {
        return None;
    }
    let (axis, angle) = Quat::from_mat3(&turn).to_axis_angle();
    let (axis, angle) =
        if angle > std::f32::consts::PI { (-axis, std::f32::consts::TAU - angle) } else { (axis, angle) };
    let about = [("X", Vec3::X), ("Y", Vec3::Y), ("Z", Vec3::Z)]
        .into_iter()
        .find(|(_, unit)| axis.dot(*unit).abs() > 0.999)
        .map(|(name, unit)| (name.to_owned(), axis.dot(unit).signum()))
        .unwrap_or_else(|| (format!("({:.2}, {:.2}, {:.2})", axis.x, axis.y, axis.z), 1.0));
    let degrees = (about.1 * angle.to_degrees()).round();
    let remedy = format!("turn them by {degrees} degrees about {}", about.0);
    // The direction in the scan that the body has up.
    let up = turn.transpose() * Vec3::Y;
    let named = [("X", Vec3::X), ("Y", Vec3::Y), ("Z", Vec3::Z)];
    let is_up = named.iter().find(|(_, unit)| up.dot(*unit).abs() > 0.99);
    Some(match is_up {
        Some(("Y", unit)) if up.dot(*unit) > 0.0 && degrees.abs() == 180.0 => {
            format!("facing backwards: {remedy}")
        }
        Some(("Y", unit)) if up.dot(*unit) > 0.0 => format!("facing another way: {remedy}"),
        Some((name, unit)) => {
            let sign = if up.dot(*unit) > 0.0 { "" } else { "-" };
            format!("{sign}{name} up, the bodies Y up: {remedy}")
        }
        None => format!("leaning: {remedy}"),
    })
}
