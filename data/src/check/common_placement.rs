//! The placement that most frames of a subject share: of scans in another unit, turned, mirrored, or elsewhere.

use glam::{Mat3, Vec3};

use super::alignment::{Alignment, Similarity, angle_between};
use super::inspection::Observation;
use super::judgement::Looked;
use super::statistics::percentile;
use crate::{Origin, ScanPlacement};

/// Frames that are placed alike, of all that were looked at, above which the subject's scans are.
pub(super) const MOST: f32 = 0.6;
/// Turns closer than this are one turn, radians.
const ONE_TURN: f32 = 0.15;
/// Shifts closer than this are one shift, metres.
const ONE_SHIFT: f32 = 0.03;
/// A scale this close to 1 is no other unit.
const ONE_SCALE: f32 = 0.04;

/// A placement that most frames share.
pub(super) struct Common {
    pub scale: f32,
    pub turn: Mat3,
    pub shift: Shift,
    /// Median distances before and after, metres.
    pub before: f32,
    pub after: f32,
    pub frames: Vec<String>,
    /// Whether it is the subject's, and not one frame's.
    pub is_of_all: bool,
}

/// What is common to shifts.
pub(super) enum Shift {
    None,
    Same(Vec3),
    /// They are those from this origin.
    To(Origin),
    /// Each its own: up to so many metres.
    Each(f32),
}

impl Common {
    /// Whether a frame's placement is this one.
    pub fn explains(&self, found: &Alignment) -> bool {
        alike(&Similarity { scale: self.scale, turn: self.turn, shift: Vec3::ZERO }, found).is_some()
    }

    /// A placement of one frame alone.
    pub fn of_frame(found: &Alignment, looked: &Looked) -> Self {
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
    pub fn mend(&self) -> Option<ScanPlacement> {
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

pub(super) fn is_same_scale(one: f32, other: f32) -> bool {
    (one / other - 1.0).abs() < ONE_SCALE
}

/// The placement of most frames, if there is one.
pub(super) fn common_placement(looked: &[Looked]) -> Option<Common> {
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
    let (scale, turn) = (middle(|found| found.placement.scale), first.turn);
    let (before, after) = (middle(|found| found.before), middle(|found| found.after));
    for (one, found) in &mut group {
        found.placement = about_pelvis(&found.placement, scale, turn, one.pelvis);
    }
    let frames = group.iter().map(|(one, _)| one.frame.clone()).collect();
    Some(Common { scale, turn, shift: common_shift(&group), before, after, frames, is_of_all: true })
}

/// The placement with the common size and turn that brings the same point of a scan to the pelvis.
fn about_pelvis(placement: &Similarity, scale: f32, turn: Mat3, pelvis: Vec3) -> Similarity {
    Similarity { scale, turn, shift: pelvis - turn * placement.inverse_of(pelvis) * scale }
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
