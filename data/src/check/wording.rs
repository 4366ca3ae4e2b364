//! What is said of a fault: the figure, and the remedy.

use glam::{Mat3, Quat, Vec3};

use super::alignment::{UNITS, angle_between};
use super::common_placement::{Common, Shift, is_same_scale};
use super::finding::{Defect, Finding};
use super::inspection::Observation;
use super::judgement::Looked;
use super::segments::Limb;
use crate::Origin;
use xavatar_formats::Choice;

const MILLIMETRES: f32 = 1000.0;

/// What one fault is called, and what is said of it for one frame.
pub(super) fn described(observation: &Observation, looked: &Looked) -> (Defect, String) {
    match observation {
        Observation::NoSurface(reason) => {
            (Defect::NoSurface, format!("the scan is no surface of a body: {reason}; export it again, or leave it out"))
        }
        Observation::Surroundings(found) => {
            (Defect::Surroundings, format!("the scan shows more than the person: {found}; cut it away"))
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
            let parts = distances(limbs).collect::<Vec<_>>().join(", ");
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
            (Defect::InsideOut, "the scan's faces are seen from inside: turn them over".to_owned())
        }
    }
}

fn names<'a>(limbs: impl Iterator<Item = &'a Limb>) -> String {
    limbs.map(|limb| limb.name()).collect::<Vec<_>>().join(", ")
}

fn of_other_frame(other: &str) -> String {
    format!("the scan fits the body registered to {other}: scans and registrations are numbered differently")
}

/// What is said of a placement: one finding each of unit, turn, mirror and shift.
pub(super) fn findings_of_placement(common: &Common) -> Vec<Finding> {
    let figures = format!("{} from the bodies, {} when mended", length(common.before), length(common.after));
    let choice = (common.mend().is_some() && common.is_of_all).then_some(Choice::RecordPlacement);
    let scans = if common.is_of_all { "the scans are" } else { "the scan is" };
    let finding = |name: Defect, text: String| {
        let frames = if common.is_of_all { Vec::new() } else { common.frames.clone() };
        Finding { name, message: text, frames, choice }
    };
    let mut findings = Vec::new();
    if !is_same_scale(common.scale, 1.0) {
        let unit = UNITS.iter().find(|(_, per_metre)| is_same_scale(common.scale * per_metre, 1.0));
        let text = match unit {
            Some((unit, per_metre)) => {
                format!("{scans} in {unit}, {per_metre:.0} times as large as the bodies: multiply by {}", common.scale)
            }
            None => format!(
                "{scans} {:.3} times as large as the bodies, which no unit explains: multiply by {:.4}, or give the \
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
            "{scans} the mirror image of the bodies, {figures}: negate {axis}; which of the two is mirrored, the data do not say"
        );
        findings.push(finding(Defect::Mirrored, text));
    }
    if let Some(how) = turned(turn) {
        findings.push(finding(Defect::Turned, format!("{scans} {how}; {figures}")));
    }
    let shifted = match common.shift {
        Shift::None => None,
        Shift::Same(shift) => {
            Some(format!("shifted: add {:.3} to x, {:.3} to y, {:.3} to z, metres", shift.x, shift.y, shift.z))
        }
        Shift::To(Origin::Translation) => Some("without `transl`, which was subtracted: add it".to_owned()),
        Shift::To(Origin::Pelvis) => Some("centred at the pelvis, and the bodies are not: add its place".to_owned()),
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

/// Each limb with its distance.
pub(super) fn distances(limbs: &[(Limb, f32)]) -> impl Iterator<Item = String> {
    limbs.iter().map(|(limb, apart)| format!("{} {:.0} mm", limb.name(), apart * MILLIMETRES))
}
