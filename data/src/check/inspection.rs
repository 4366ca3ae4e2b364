//! One frame looked at: whether its scan is a surface, where it stands against its registered body, limb by limb.
//!
//! Clothes hold a scan away from the body, outside; so a body that sticks out of its scan has slipped, whatever the person wears.
//! Hands are bare, so they have to be near. Inside the body the scan's winding number is 1: 0 where the scan is open, hollow or
//! has no such limb, 2 where it has two. Distances in metres, to half a centimetre.

use glam::{DVec3, Vec3};

use super::alignment::{Alignment, Pair, Similarity};
use super::segments::{Limb, Segments};
use super::soundness::Soundness;
use super::surface_points::SurfacePoints;
use crate::ScanFrame;
use xavatar_body::{BodyModel, BodyParameters, PosedBody};
use xavatar_formats::Result;
use xavatar_mesh::{Colouring, Topology, TriangleMesh};

/// Points of the scan, seven millimetres apart on a person.
const SCAN_POINTS: usize = 40_000;
/// Points of the body.
const BODY_POINTS: usize = 8000;
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
const INSIDE: std::ops::Range<f32> = 0.5..1.5;
/// Winding numbers that no closed surface has: it is open nearby.
const OPEN: std::ops::Range<f32> = 0.15..0.85;
/// Of a limb's inside, the share inside two surfaces where it is there twice.
const DOUBLED_SHARE: f32 = 0.2;
/// How deep in a limb its inside is looked at, and at how many points.
const DEPTH: f32 = 0.02;
const DEEP_POINTS: usize = 24;
/// Of a scan's surface by its body's, what a second wall has at least.
const TWO_WALLS: f32 = 1.5;
/// Sizes and distances beyond this factor are no unit and no shift, and f32 may not hold their squares.
const LARGEST_FACTOR: f64 = 1e4;
/// A scan nearer to its body than this (median) is of it, whatever has slipped, metres.
const UNRELATED: f32 = 0.025;
/// Of all limbs, those that are off where the scan as a whole is elsewhere, and that may still be when it is placed.
const ELSEWHERE: f32 = 0.4;

/// Looks at frames of subjects with one body model.
pub(super) struct Inspector<'a> {
    body: &'a BodyModel,
    segments: Segments,
}

/// What was seen of a frame.
pub(super) struct Inspection {
    pub observations: Vec<Observation>,
    pub has_colours: bool,
    /// How the faces hang together, seams merged, if it was looked at.
    pub topology: Option<Topology>,
}

/// What is wrong with a frame.
#[derive(Clone, Debug)]
pub(super) enum Observation {
    /// The scan is no surface, and why.
    NoSurface(String),
    /// The scan is so many times as large as the body, which no unit explains.
    Size(f64),
    /// The scan is so far from the body, metres.
    Far(f64),
    /// The scan lies on the body once it is placed.
    Misplaced(Alignment),
    /// Nothing brings the scan onto its body; the mean distance as it is, and the least, metres.
    Unrelated { apart: f32, least: f32 },
    /// Limbs that are not where the scan has them, and how far they are, metres.
    Slipped(Vec<(Limb, f32)>),
    /// Limbs that the scan does not have.
    Missing(Vec<Limb>),
    /// Limbs that the scan has so many times.
    Doubled(Vec<(Limb, f32)>),
    /// A second wall: the scan's surface by the body's.
    Hollow(f32),
    /// The share of the body's limbs that the scan is open around.
    Open(f32),
    /// The limbs that it is open around, where they are few.
    OpenAt(Vec<Limb>),
    /// Faces are seen from inside.
    InsideOut,
}

/// How a limb lies in the scan.
#[derive(Clone, Copy, Default)]
struct LimbFit {
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

impl<'a> Inspector<'a> {
    pub fn new(body: &'a BodyModel) -> Self {
        Self { body, segments: Segments::of(body) }
    }

    /// Looks at a frame, at its edges too if `thoroughly`.
    ///
    /// # Errors
    /// Those of [`BodyModel::pose`] for the frame's parameters.
    pub fn inspect(&self, frame: &ScanFrame, thoroughly: bool) -> Result<Inspection> {
        let scan = &frame.scan;
        let topology = thoroughly.then(|| Topology::of(&scan.merged_by_position()));
        let shared = topology.map(|topology| {
            1.0 - (topology.open_edges + topology.irregular_edges) as f32 / topology.edges.max(1) as f32
        });
        let soundness = Soundness::of(scan, shared);
        let has_colours = !matches!(scan.colouring, Colouring::None);
        let seen = |observations| Ok(Inspection { observations, has_colours, topology });
        if let Some(reason) = soundness.fault {
            return seen(vec![Observation::NoSurface(reason)]);
        }
        let posed = self.body.pose(&self.body.resolve(&frame.parameters)?)?;
        let body = self.body.mesh(posed.vertices.clone());
        let ((scan_centre, scan_size), (body_centre, body_size)) = (place_and_size(scan), place_and_size(&body));
        let factor = scan_size / body_size;
        if !(1.0 / LARGEST_FACTOR..LARGEST_FACTOR).contains(&factor) {
            return seen(vec![Observation::Size(factor)]);
        }
        let apart = scan_centre.distance(body_centre);
        if apart > LARGEST_FACTOR * scan_size.max(body_size) {
            return seen(vec![Observation::Far(apart)]);
        }
        let mut scan_points = SurfacePoints::new(scan, SCAN_POINTS)?;
        let is_inside_out = self.is_inside_out(&scan_points, &posed, soundness.volume);
        if is_inside_out {
            scan_points.reverse();
        }
        let body_points = SurfacePoints::new(&body, BODY_POINTS)?;
        let mut observations = self.observe(&scan_points, &body_points, &posed)?;
        observations.extend(is_inside_out.then_some(Observation::InsideOut));
        seen(observations)
    }

    /// Whether faces are seen from inside: by the body's inside, where the scan is around it, else by the scan's volume.
    fn is_inside_out(&self, scan: &SurfacePoints, posed: &PosedBody, volume: Option<f64>) -> bool {
        let mut windings: Vec<f32> = self.segments.cores(posed).map(|(_, core)| scan.winding_number(core)).collect();
        let winding = median(&mut windings);
        if winding.abs() > INSIDE.start { winding < 0.0 } else { volume.is_some_and(|volume| volume < 0.0) }
    }

    /// Whether a scan lies on the body of these parameters, every limb of it, once it is placed.
    ///
    /// # Errors
    /// Those of [`BodyModel::pose`]; if the scan has no area.
    pub fn is_of(&self, scan: &TriangleMesh, parameters: &BodyParameters, placement: &Similarity) -> Result<bool> {
        let posed = self.body.pose(&self.body.resolve(parameters)?)?;
        let body = SurfacePoints::new(&self.body.mesh(posed.vertices.clone()), BODY_POINTS)?;
        let mut scan = SurfacePoints::new(scan, SCAN_POINTS)?.placed(placement)?;
        if self.is_inside_out(&scan, &posed, None) {
            scan.reverse();
        }
        Ok(count_off(&self.fits(&scan, &body, &posed)) == 0)
    }

    /// Whether the scan as a whole is elsewhere than the body; and, once it is placed, what is wrong with limbs.
    fn observe(&self, scan: &SurfacePoints, body: &SurfacePoints, posed: &PosedBody) -> Result<Vec<Observation>> {
        let fits = self.fits(scan, body, posed);
        let off = count_off(&fits);
        if let Some(whole) = of_walls(&fits, scan.area / body.area) {
            return Ok(vec![whole]);
        }
        if off == 0 {
            return Ok(of_limbs(&fits));
        }
        let bare = (0..body.points.len()).filter(|point| self.limb_at(body, *point).is_bare());
        let found = Pair::new(scan, body, bare.map(|point| body.points[point])).align();
        let some = (ELSEWHERE * fits.len() as f32) as usize;
        let mut placed = Vec::new();
        for placement in found.placements() {
            let fits = self.fits(&scan.placed(placement)?, body, posed);
            placed.push((count_off(&fits), *placement, fits));
        }
        // The first of those that bring most limbs into place.
        let least = placed.iter().map(|(still_off, ..)| *still_off).min().unwrap_or(off);
        placed.retain(|(still_off, ..)| *still_off == least);
        let mends = least == 0 || (3 * least <= off && off > some);
        let others = placed.iter().skip(1).map(|(_, placement, _)| *placement).collect();
        match placed.into_iter().next() {
            Some((_, placement, fits)) if mends && placement != Similarity::IDENTITY => {
                let alignment = Alignment { placement, alternatives: others, ..found };
                Ok(std::iter::once(Observation::Misplaced(alignment)).chain(of_limbs(&fits)).collect())
            }
            _ if off > some && found.before > UNRELATED => {
                Ok(vec![Observation::Unrelated { apart: found.before, least: found.after }])
            }
            _ => Ok(of_limbs(&fits)),
        }
    }

    fn limb_at(&self, body: &SurfacePoints, point: usize) -> Limb {
        self.segments.of_faces[body.faces[point] as usize]
    }

    fn fits(&self, scan: &SurfacePoints, body: &SurfacePoints, posed: &PosedBody) -> Vec<LimbFit> {
        let mut of_limbs: Vec<LimbPoints> = Limb::all().map(|_| LimbPoints::default()).collect();
        for (number, &point) in body.points.iter().enumerate() {
            let (nearest, distance) = scan.nearest(point);
            let above = (point - scan.points[nearest]).dot(scan.normals[nearest]);
            let limb = &mut of_limbs[self.limb_at(body, number).index()];
            limb.distances.push(distance);
            limb.sticking_out += usize::from(above > STICKS_OUT);
            limb.centre += point;
            limb.deep.push(point - body.normals[number] * DEPTH);
        }
        let some_of_scan = || scan.points.iter().step_by(SCAN_STRIDE);
        let mut strays = Vec::new();
        for &point in some_of_scan() {
            let (nearest, distance) = body.nearest(point);
            let limb = &mut of_limbs[self.limb_at(body, nearest).index()];
            limb.on_scan += 1;
            if distance > STRAYS {
                limb.straying += 1;
                strays.push(point);
            }
        }
        let mut cores: Vec<Vec<Vec3>> = of_limbs.iter().map(|_| Vec::new()).collect();
        for (limb, core) in self.segments.cores(posed) {
            cores[limb.index()].push(core);
        }
        let a_scan_point = scan.area / some_of_scan().len() as f32;
        let a_body_point = body.area / body.points.len() as f32;
        let fit = |limb: Limb| {
            let LimbPoints { distances, sticking_out, on_scan, straying, centre, deep } = &of_limbs[limb.index()];
            let count = distances.len().max(1) as f32;
            let of_limb = |points: usize| points as f32 * a_scan_point / (count * a_body_point);
            let centre = *centre / count;
            let deep = deep.iter().step_by(deep.len().div_ceil(DEEP_POINTS).max(1));
            let inside = cores[limb.index()].iter().chain(deep.filter(|_| !limb.is_bare()));
            let mut windings: Vec<f32> = inside.map(|point| scan.winding_number(*point)).collect();
            let twice = windings.iter().filter(|winding| **winding > INSIDE.end).count();
            LimbFit {
                apart: median(&mut distances.clone()),
                sticking_out: *sticking_out as f32 / count,
                surface: of_limb(*on_scan),
                straying: of_limb(*straying),
                straying_around: of_limb(strays.iter().filter(|point| point.distance(centre) < AROUND).count()),
                twice_inside: twice as f32 / windings.len().max(1) as f32,
                winding: median(&mut windings),
            }
        };
        Limb::all().map(fit).collect()
    }
}

/// Points of the scan of which one is looked up on the body.
const SCAN_STRIDE: usize = 4;

/// What is counted of a limb.
#[derive(Default)]
struct LimbPoints {
    distances: Vec<f32>,
    sticking_out: usize,
    on_scan: usize,
    straying: usize,
    centre: Vec3,
    deep: Vec<Vec3>,
}

fn count_off(fits: &[LimbFit]) -> usize {
    Limb::all().filter(|limb| is_off(*limb, &fits[limb.index()])).count()
}

/// Whether a limb is not where the scan has it. One that is inside of the scan may be in a pocket or under a coat.
fn is_off(limb: Limb, fit: &LimbFit) -> bool {
    let apart = if limb.is_bare() { HAND_APART } else { LIMB_APART };
    fit.sticking_out > SLIPPED_SHARE || (fit.apart > apart && fit.winding < INSIDE.start)
}

/// Whether the scan has a second wall, or too little of one; `surface` is its surface by the body's.
fn of_walls(fits: &[LimbFit], surface: f32) -> Option<Observation> {
    let share_of = |is: &dyn Fn(&LimbFit) -> bool| {
        let thick = || Limb::all().filter(|limb| !limb.is_bare());
        thick().filter(|limb| is(&fits[limb.index()])).count() as f32 / thick().count() as f32
    };
    let is_near = share_of(&|fit| fit.apart < LIMB_APART) > 0.5;
    let in_cavity = share_of(&|fit| fit.winding < INSIDE.start || fit.twice_inside > 0.5);
    let open = share_of(&|fit| OPEN.contains(&fit.winding));
    if surface > TWO_WALLS && is_near && in_cavity > 0.5 {
        return Some(Observation::Hollow(surface));
    }
    (open > 0.5).then_some(Observation::Open(open))
}

/// What is wrong with limbs of a scan that stands where its body does.
fn of_limbs(fits: &[LimbFit]) -> Vec<Observation> {
    let fit = |limb: Limb| fits[limb.index()];
    let (mut missing, mut slipped, mut doubled, mut open) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for limb in Limb::all() {
        let found = fit(limb);
        let is_slender = !limb.may_be_wide() && found.apart < LIMB_APART / 2.0;
        let has_second = found.surface > DOUBLED_SURFACE && found.straying > STRAYING_SURFACE;
        let is_elsewhere = found.straying_around > STRAYING_SURFACE;
        if is_off(limb, &found) {
            match found.surface < MISSING_SURFACE && !is_elsewhere {
                true => missing.push(limb),
                false => slipped.push((limb, found.apart)),
            }
        } else if found.twice_inside > DOUBLED_SHARE || is_slender && has_second {
            doubled.push((limb, found.surface));
        } else if OPEN.contains(&found.winding) && !limb.is_bare() {
            open.push(limb);
        }
    }
    let some = |limbs: bool, observation: Observation| limbs.then_some(observation);
    [
        // Where a limb is missing, the one before it is open.
        some(missing.is_empty() && !open.is_empty(), Observation::OpenAt(open)),
        some(!missing.is_empty(), Observation::Missing(missing)),
        some(!slipped.is_empty(), Observation::Slipped(slipped)),
        some(!doubled.is_empty(), Observation::Doubled(doubled)),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The middle of the box around a mesh and its longest side, in f64.
fn place_and_size(mesh: &TriangleMesh) -> (DVec3, f64) {
    let (low, high) = mesh
        .vertices
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), vertex| (low.min(*vertex), high.max(*vertex)));
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    ((low + high) / 2.0, (high - low).max_element())
}

fn median(values: &mut [f32]) -> f32 {
    match values.len() {
        0 => 0.0,
        count => *values.select_nth_unstable_by(count / 2, f32::total_cmp).1,
    }
}
