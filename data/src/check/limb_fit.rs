//! How each limb of a registered body lies in its scan, and what that says of the scan.
//!
//! Clothes hold a scan away from the body, outside; so a limb that sticks out of its scan has slipped, whatever the person wears.
//! Inside the body the scan's winding number is 1: 0 where the scan is open, hollow or has no such limb, 2 where it has two.
//! Metres, to half a centimetre.

use glam::Vec3;

use super::inspection::Observation;
use super::segments::{Limb, Segments};
use super::statistics::percentile;
use super::surface_points::SurfacePoints;
use xavatar_body::PosedBody;

/// A body that is farther outside of its scan than this sticks out.
const STICKS_OUT: f32 = 0.015;
/// Of a limb, the share that sticks out where it has slipped.
const SLIPPED_SHARE: f32 = 0.25;
/// A limb farther from its scan than this (median), and outside of it, is not where the scan has it: a hand, which is bare, ...
const HAND_APART: f32 = 0.02;
/// ... and any other.
const LIMB_APART: f32 = 0.04;
/// Of a limb's surface, what the scan has of a limb that is missing.
const MISSING_SURFACE: f32 = 0.35;
/// A scan's surface farther from the body than this strays.
const STRAYS: f32 = 0.04;
/// How far around a limb a scan may have it instead.
const AROUND: f32 = 0.35;
/// Of a limb's surface, what strays around it where it has slipped and is not missing, or where there is a second.
const STRAYING_SURFACE: f32 = 0.4;
/// Of a slender limb's surface, what a scan that has it twice has near it; shoes have 1.6, and do not stray.
const DOUBLED_SURFACE: f32 = 1.5;
/// The winding number between outside and inside, and between inside one surface and inside two.
pub(super) const INSIDE: std::ops::Range<f32> = 0.5..1.5;
/// Winding numbers that no closed surface has: it is open nearby.
const OPEN: std::ops::Range<f32> = 0.15..0.85;
/// Of a limb's inside, the share inside two surfaces where it is there twice.
const DOUBLED_SHARE: f32 = 0.2;
/// Points of the scan of which one is looked up on the body.
const SCAN_STRIDE: usize = 4;
/// How deep in a limb its inside is looked at, and at how many points.
const DEPTH: f32 = 0.02;
const DEEP_POINTS: usize = 24;
/// Of a scan's surface by its body's, what a second wall has at least.
const TWO_WALLS: f32 = 1.5;

/// How each limb lies in the scan, in the order of [`Limb::all`], and the scan's surface by the body's.
pub(super) struct LimbFits {
    limbs: Vec<LimbFit>,
    surface: f32,
    /// Whether limbs are known not to be seen, and left out.
    lacks_some: bool,
}

/// How a limb lies in the scan.
#[derive(Clone, Copy)]
struct LimbFit {
    limb: Limb,
    /// Median distance of the limb's surface to the scan.
    apart: f32,
    /// The share of it that sticks out.
    sticking_out: f32,
    /// The scan's surface nearest to this limb, by the limb's own; and what of it strays.
    surface: f32,
    straying: f32,
    /// The scan's surface that strays around this limb, nearest to it or not, by the limb's own.
    straying_around: f32,
    /// Median winding number of the scan at points deep in the limb, and the share of them that are inside two surfaces.
    winding: f32,
    twice_inside: f32,
}

/// What is counted of a limb.
#[derive(Default)]
struct LimbPoints {
    distances: Vec<f32>,
    sticking_out: usize,
    on_scan: usize,
    straying: usize,
    centre: Vec3,
    /// Points inside.
    deep: Vec<Vec3>,
    cores: Vec<Vec3>,
}

impl LimbFits {
    /// Looks how the limbs of a posed body lie in a scan, whose normals point outward.
    pub fn of(scan: &SurfacePoints, body: &SurfacePoints, posed: &PosedBody, segments: &Segments) -> Self {
        let mut of_limbs: Vec<LimbPoints> = Limb::all().map(|_| LimbPoints::default()).collect();
        for (number, &point) in body.points.iter().enumerate() {
            let (nearest, distance) = scan.nearest(point);
            let above = (point - scan.points[nearest]).dot(scan.normals[nearest]);
            let limb = &mut of_limbs[segments.limb_at(body, number).index()];
            limb.distances.push(distance);
            limb.sticking_out += usize::from(above > STICKS_OUT);
            limb.centre += point;
            limb.deep.push(point - body.normals[number] * DEPTH);
        }
        let some_of_scan = || scan.points.iter().step_by(SCAN_STRIDE);
        let mut strays = Vec::new();
        for &point in some_of_scan() {
            let (nearest, distance) = body.nearest(point);
            let limb = &mut of_limbs[segments.limb_at(body, nearest).index()];
            limb.on_scan += 1;
            if distance > STRAYS {
                limb.straying += 1;
                strays.push(point);
            }
        }
        for (limb, core) in segments.cores(posed) {
            of_limbs[limb.index()].cores.push(core);
        }
        let a_scan_point = scan.area / some_of_scan().len().max(1) as f32;
        let a_body_point = body.area / body.points.len() as f32;
        let fit = |(limb, points): (Limb, &LimbPoints)| {
            let count = points.distances.len().max(1) as f32;
            let of_limb = |points: usize| points as f32 * a_scan_point / (count * a_body_point);
            let centre = points.centre / count;
            let deep = points.deep.iter().step_by(points.deep.len().div_ceil(DEEP_POINTS).max(1));
            let inside = points.cores.iter().chain(deep.filter(|_| !limb.is_bare()));
            let windings: Vec<f32> = inside.map(|point| scan.winding_number(*point)).collect();
            let twice = windings.iter().filter(|winding| **winding > INSIDE.end).count();
            LimbFit {
                limb,
                apart: percentile(points.distances.clone(), 0.5).unwrap_or(0.0),
                sticking_out: points.sticking_out as f32 / count,
                surface: of_limb(points.on_scan),
                straying: of_limb(points.straying),
                straying_around: of_limb(strays.iter().filter(|point| point.distance(centre) < AROUND).count()),
                twice_inside: twice as f32 / windings.len().max(1) as f32,
                winding: percentile(windings, 0.5).unwrap_or(0.0),
            }
        };
        // A body of hands alone has no torso.
        let limbs = Limb::all().zip(&of_limbs).filter(|(_, points)| !points.distances.is_empty()).map(fit).collect();
        Self { limbs, surface: scan.area / body.area, lacks_some: false }
    }

    /// Without the limbs of these parts, of which it is known that the scan says nothing.
    #[must_use]
    pub fn without(mut self, unseen_parts: &[String]) -> Self {
        let is_seen = |fit: &LimbFit| !unseen_parts.iter().any(|part| part.replace('_', " ") == fit.limb.name());
        self.limbs.retain(is_seen);
        self.lacks_some |= !unseen_parts.is_empty();
        self
    }

    /// How many limbs there are.
    pub fn count(&self) -> usize {
        self.limbs.len()
    }

    /// How many of them are not where the scan has them.
    pub fn count_off(&self) -> usize {
        self.limbs.iter().filter(|limb| limb.is_off()).count()
    }

    /// Whether the scan has a second wall, or too little of one.
    pub fn of_walls(&self) -> Option<Observation> {
        let share_of = |is: fn(&LimbFit) -> bool| {
            let thick = || self.limbs.iter().filter(|fit| !fit.limb.is_bare());
            thick().filter(|fit| is(fit)).count() as f32 / thick().count().max(1) as f32
        };
        let is_near = share_of(|fit| fit.apart < LIMB_APART) > 0.5;
        let in_cavity = share_of(|fit| fit.winding < INSIDE.start || fit.twice_inside > 0.5);
        let open = share_of(|fit| OPEN.contains(&fit.winding));
        if self.surface > TWO_WALLS && is_near && in_cavity > 0.5 {
            return Some(Observation::Hollow(self.surface));
        }
        if open > 0.5 {
            return Some(Observation::Open(open));
        }
        // Of a scan that is cut through the trunk, whole limbs may be on the side that is gone.
        let is_cut = |fit: &LimbFit| OPEN.contains(&fit.winding) && fit.surface < MISSING_SURFACE;
        let trunk_is_cut = self.limbs.iter().any(|fit| fit.limb.is_trunk() && is_cut(fit));
        trunk_is_cut.then(|| Observation::Open(share_of(|fit| fit.winding < OPEN.end)))
    }

    /// What is wrong with limbs of a scan that stands where its body does.
    pub fn of_limbs(&self) -> Vec<Observation> {
        let (mut missing, mut slipped, mut doubled, mut open) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for fit in &self.limbs {
            if fit.is_off() {
                match fit.surface < MISSING_SURFACE && fit.straying_around < STRAYING_SURFACE {
                    true => missing.push(fit.limb),
                    false => slipped.push((fit.limb, fit.apart)),
                }
            } else if fit.is_doubled() {
                doubled.push((fit.limb, fit.surface));
            } else if OPEN.contains(&fit.winding) && !fit.limb.is_bare() {
                open.push(fit.limb);
            }
        }
        let some = |there_are: bool, observation: Observation| there_are.then_some(observation);
        [
            // Where a limb is missing, the one before it is open.
            some(missing.is_empty() && !self.lacks_some && !open.is_empty(), Observation::OpenAt(open)),
            some(!missing.is_empty(), Observation::Missing(missing)),
            some(!slipped.is_empty(), Observation::Slipped(slipped)),
            some(!doubled.is_empty(), Observation::Doubled(doubled)),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

impl LimbFit {
    /// Whether the limb is not where the scan has it. One that is inside of the scan may be in a pocket or under a coat.
    fn is_off(&self) -> bool {
        let apart = if self.limb.is_bare() { HAND_APART } else { LIMB_APART };
        self.sticking_out > SLIPPED_SHARE || (self.apart > apart && self.winding < INSIDE.start)
    }

    /// Whether the scan has the limb twice: in one another, or, of those that no garment makes wide, beside each other.
    fn is_doubled(&self) -> bool {
        let is_slender = !self.limb.may_be_wide() && self.apart < LIMB_APART / 2.0;
        let has_second = self.surface > DOUBLED_SURFACE && self.straying > STRAYING_SURFACE;
        self.twice_inside > DOUBLED_SHARE || is_slender && has_second
    }
}
