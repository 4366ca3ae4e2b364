//! One frame looked at: whether its scan is a surface, where it stands against its registered body, limb by limb.
//!
//! Clothes hold a scan away from the body, outside; so a body that sticks out of its scan has slipped, whatever the person wears.
//! Hands are bare, so they have to be near. Inside the body the scan's winding number is 1: 0 where the scan is open, hollow or
//! has no such limb, 2 where it has two. Distances in metres, to half a centimetre.

use glam::Vec3;

use super::alignment::{Alignment, Pair, Similarity};
use super::segments::{Limb, Segments};
use super::soundness::Soundness;
use super::surface_points::SurfacePoints;
use crate::ScanFrame;
use xavatar_body::{BodyModel, BodyParameters, PosedBody};
use xavatar_formats::Result;
use xavatar_mesh::{Colouring, Topology, TriangleMesh};

/// Points of the scan, five millimetres apart on a person.
const SCAN_POINTS: usize = 40_000;
/// Points of the body.
const BODY_POINTS: usize = 8000;
/// A body that is farther outside of its scan than this sticks out.
const STICKS_OUT: f32 = 0.015;
/// Of a limb, the share that sticks out where it has slipped.
const SLIPPED_SHARE: f32 = 0.25;
/// A hand farther from its scan than this (median) is not where the scan has it.
const HAND_APART: f32 = 0.02;
/// Any limb farther than this (median) and outside is not there.
const LIMB_APART: f32 = 0.04;
/// Of a limb's surface, what the scan has of a limb that is missing.
const MISSING_SURFACE: f32 = 0.35;
/// And of a slender limb that it has twice; sleeves and boots have less.
const DOUBLED_SURFACE: f32 = 1.9;
/// The winding number between outside and inside, and between inside one surface and inside two.
const INSIDE: std::ops::Range<f32> = 0.5..1.5;
/// Of a scan's surface by its body's, what a second wall has at least.
const TWO_WALLS: f32 = 1.5;
/// Sizes beyond this factor are no unit, and f32 may not hold their squares.
const LARGEST_FACTOR: f64 = 1e4;
/// Limbs that are where the scan has them, of all, below which the whole scan is elsewhere.
const FITTING_LIMBS: f32 = 0.6;
/// A placement is the right one if the surfaces are nearer by this factor.
const CLEARLY_BETTER: f32 = 0.6;

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
    /// The share of the body's inside that is outside of the scan.
    Open(f32),
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
    /// The scan's surface nearest to this limb, by the limb's own.
    surface: f32,
    /// Median winding number of the scan at points deep in the limb.
    winding: f32,
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
        let posed = self.body.pose(&frame.parameters)?;
        let body = self.body.mesh(posed.vertices.clone());
        let factor = extent(scan) / extent(&body);
        if !(1.0 / LARGEST_FACTOR..LARGEST_FACTOR).contains(&factor) || !factor.is_finite() {
            return seen(vec![Observation::Size(factor)]);
        }
        let scan_points = SurfacePoints::new(scan, SCAN_POINTS)?;
        let body_points = SurfacePoints::new(&body, BODY_POINTS)?;
        let fits = self.fits(&scan_points, &body_points, &posed);
        if std::env::var("XA_DEBUG").is_ok() {
            for limb in Limb::all() {
                let f = fits[limb.index()];
                eprintln!("{} {:18} apart {:5.1} out {:.2} surf {:.2} wind {:.2}", frame.id, limb.name(), f.apart*1e3, f.sticking_out, f.surface, f.winding);
            }
            eprintln!("{} area ratio {:.2} vol {:.3}", frame.id, scan_points.area / body_points.area, soundness.volume);
        }
        let mut observations = self.misplacement(&fits, &scan_points, &body_points);
        let is_placed = observations.is_empty();
        if is_placed {
            observations.extend(observations_of_limbs(&fits, scan_points.area / body_points.area));
        }
        if soundness.volume < 0.0 {
            observations.push(Observation::InsideOut);
        }
        seen(observations)
    }

    /// Whether a scan lies on the body of these parameters, every limb of it.
    ///
    /// # Errors
    /// Those of [`BodyModel::pose`]; if the scan has no area.
    pub fn is_of(&self, scan: &TriangleMesh, parameters: &BodyParameters) -> Result<bool> {
        let posed = self.body.pose(parameters)?;
        let body = SurfacePoints::new(&self.body.mesh(posed.vertices.clone()), BODY_POINTS)?;
        let fits = self.fits(&SurfacePoints::new(scan, SCAN_POINTS)?, &body, &posed);
        Ok(Limb::all().all(|limb| !is_off(limb, &fits[limb.index()])))
    }

    /// Whether the scan as a whole is elsewhere than the body.
    fn misplacement(&self, fits: &[LimbFit], scan: &SurfacePoints, body: &SurfacePoints) -> Vec<Observation> {
        let in_place = Limb::all().filter(|limb| !is_off(*limb, &fits[limb.index()])).count();
        if in_place == fits.len() {
            return Vec::new();
        }
        let found = Pair::new(scan, body).align();
        let is_elsewhere = (in_place as f32) < FITTING_LIMBS * fits.len() as f32;
        if found.after < CLEARLY_BETTER * found.before && found.placement != Similarity::IDENTITY {
            vec![Observation::Misplaced(found)]
        } else if is_elsewhere {
            vec![Observation::Unrelated { apart: found.before, least: found.after }]
        } else {
            Vec::new()
        }
    }

    fn fits(&self, scan: &SurfacePoints, body: &SurfacePoints, posed: &PosedBody) -> Vec<LimbFit> {
        let limb_of = |point: usize| self.segments.of_faces[body.faces[point] as usize];
        let mut distances = vec![Vec::new(); Limb::all().count()];
        let mut sticking_out = vec![0usize; distances.len()];
        for (number, &point) in body.points.iter().enumerate() {
            let (nearest, distance) = scan.nearest(point);
            let limb = limb_of(number).index();
            distances[limb].push(distance);
            let above = (point - scan.points[nearest]).dot(scan.normals[nearest]);
            sticking_out[limb] += usize::from(above > STICKS_OUT);
        }
        let mut on_scan = vec![0usize; distances.len()];
        for &point in scan.points.iter().step_by(4) {
            on_scan[limb_of(body.nearest(point).0).index()] += 1;
        }
        let mut windings = vec![Vec::new(); distances.len()];
        for (limb, core) in Segments::cores(posed) {
            windings[limb.index()].push(scan.winding_number(core));
        }
        let (of_scan, of_body) =
            (scan.area / scan.points.len().div_ceil(4) as f32, body.area / body.points.len() as f32);
        let fit = |limb: usize| {
            let count = distances[limb].len().max(1) as f32;
            LimbFit {
                apart: median(&mut distances[limb].clone()),
                sticking_out: sticking_out[limb] as f32 / count,
                surface: on_scan[limb] as f32 * of_scan / (count * of_body),
                winding: median(&mut windings[limb].clone()),
            }
        };
        (0..distances.len()).map(fit).collect()
    }
}

/// Whether a limb is not where the scan has it.
fn is_off(limb: Limb, fit: &LimbFit) -> bool {
    let apart = if limb.is_bare() { HAND_APART } else { f32::INFINITY };
    fit.sticking_out > SLIPPED_SHARE || fit.apart > apart || fit.apart > LIMB_APART && fit.winding < INSIDE.start
}

/// What is wrong with limbs of a scan that stands where its body does.
fn observations_of_limbs(fits: &[LimbFit], surface: f32) -> Vec<Observation> {
    let fit = |limb: Limb| fits[limb.index()];
    let mut observations = Vec::new();
    let outside = Limb::all().filter(|limb| fit(*limb).winding < INSIDE.start && !limb.is_bare()).count();
    let share = outside as f32 / Limb::all().filter(|limb| !limb.is_bare()).count() as f32;
    let near = |limb: &Limb| fit(*limb).apart < LIMB_APART;
    let is_open_throughout = share > 0.5 && Limb::all().filter(near).count() > fits.len() / 2;
    if is_open_throughout {
        observations.push(if surface > TWO_WALLS { Observation::Hollow(surface) } else { Observation::Open(share) });
        return observations;
    }
    let mut missing = Vec::new();
    let mut slipped = Vec::new();
    let mut open = 0;
    for limb in Limb::all() {
        let LimbFit { apart, winding, surface, .. } = fit(limb);
        if apart > HAND_APART && surface < MISSING_SURFACE && (winding < INSIDE.start || limb.is_bare()) {
            missing.push(limb);
        } else if is_off(limb, &fit(limb)) {
            slipped.push((limb, apart));
        } else if winding < INSIDE.start && !limb.is_bare() {
            open += 1;
        }
    }
    let is_doubled = |limb: &Limb| {
        let LimbFit { apart, winding, surface, .. } = fit(*limb);
        let is_near = apart < HAND_APART;
        is_near && (winding > INSIDE.end || surface > DOUBLED_SURFACE && !limb.may_be_wide())
    };
    let doubled: Vec<_> = Limb::all().filter(is_doubled).map(|limb| (limb, fit(limb).surface)).collect();
    observations.extend((!missing.is_empty()).then_some(Observation::Missing(missing)));
    observations.extend((!slipped.is_empty()).then_some(Observation::Slipped(slipped)));
    observations.extend((!doubled.is_empty()).then_some(Observation::Doubled(doubled)));
    observations.extend((open > 0).then(|| Observation::Open(open as f32 / fits.len() as f32)));
    observations
}

/// The longest side of the box around a mesh, in f64.
fn extent(mesh: &TriangleMesh) -> f64 {
    let (low, high) = mesh
        .vertices
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), vertex| (low.min(*vertex), high.max(*vertex)));
    (high.as_dvec3() - low.as_dvec3()).max_element()
}

fn median(values: &mut [f32]) -> f32 {
    match values.len() {
        0 => 0.0,
        count => *values.select_nth_unstable_by(count / 2, f32::total_cmp).1,
    }
}
