//! One frame looked at: whether its scan is a surface, where it stands against its registered body, limb by limb.
//!
//! Where limbs are not where the scan has them ([`LimbFits`]), a placement of the whole scan is looked for ([`Pair`]); what is wrong
//! beside it is seen after that. Metres.

use glam::{DVec3, Vec3};

use super::alignment::{Alignment, Pair, Similarity};
use super::limb_fit::{INSIDE, LimbFits};
use super::segments::{Limb, Segments};
use super::soundness::Soundness;
use super::statistics::percentile;
use super::surface_points::SurfacePoints;
use crate::ScanFrame;
use xavatar_body::{BodyModel, BodyParameters, PosedBody};
use xavatar_formats::Result;
use xavatar_mesh::{Colouring, Surroundings, Topology, TriangleMesh, without_surroundings};

/// Points of the scan, seven millimetres apart on a person.
const SCAN_POINTS: usize = 40_000;
/// Points of the body.
const BODY_POINTS: usize = 8000;
/// Sizes and distances beyond this factor are no unit and no shift, and f32 may not hold their squares.
const LARGEST_FACTOR: f64 = 1e4;
/// A scan nearer to its body than this (median) is of it, whatever has slipped, metres.
const UNRELATED: f32 = 0.025;
/// Of all limbs, those that are off where the scan as a whole is elsewhere, and that may still be when it is placed.
const ELSEWHERE: f32 = 0.4;

/// Less than this besides the person, by the scan's surface, is let pass.
const SURROUNDED: f64 = 0.02;

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
    /// The scan shows more than the person; all else is seen without that.
    Surroundings(Surroundings),
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
        let body_points = SurfacePoints::new(&body, BODY_POINTS)?;
        let fits_of = |points: &SurfacePoints| LimbFits::of(points, &body_points, &posed, &self.segments);
        let mut surroundings = None;
        if let Some((person, found)) = without_surroundings(scan).filter(|(_, found)| found.share() >= SURROUNDED) {
            let alone = SurfacePoints::new(&person, SCAN_POINTS)?;
            // A limb that is loose, beyond a hole, is no surroundings: without it the body fits no better.
            let off = fits_of(&alone).count_off();
            if off == 0 || off < fits_of(&scan_points).count_off() {
                (scan_points, surroundings) = (alone, Some(Observation::Surroundings(found)));
            }
        }
        let is_inside_out = self.is_inside_out(&scan_points, &posed, soundness.volume);
        if is_inside_out {
            scan_points.reverse();
        }
        let mut observations = self.observe(&scan_points, &body_points, &posed, &frame.unseen_parts)?;
        observations.extend(is_inside_out.then_some(Observation::InsideOut));
        observations.extend(surroundings);
        seen(observations)
    }

    /// Whether faces are seen from inside: by the body's inside, where the scan is around it, else by the scan's volume.
    fn is_inside_out(&self, scan: &SurfacePoints, posed: &PosedBody, volume: Option<f64>) -> bool {
        let windings = self.segments.cores(posed).map(|(_, core)| scan.winding_number(core)).collect();
        let winding = percentile(windings, 0.5).unwrap_or(0.0);
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
        Ok(LimbFits::of(&scan, &body, &posed, &self.segments).count_off() == 0)
    }

    /// Whether the scan as a whole is elsewhere than the body; and, once it is placed, what is wrong with limbs.
    fn observe(
        &self,
        scan: &SurfacePoints,
        body: &SurfacePoints,
        posed: &PosedBody,
        unseen_parts: &[String],
    ) -> Result<Vec<Observation>> {
        let fits_of = |scan: &SurfacePoints| LimbFits::of(scan, body, posed, &self.segments).without(unseen_parts);
        let fits = fits_of(scan);
        let off = fits.count_off();
        if let Some(whole) = fits.of_walls() {
            return Ok(vec![whole]);
        }
        if off == 0 {
            return Ok(fits.of_limbs());
        }
        let bare = (0..body.points.len()).filter(|point| self.segments.limb_at(body, *point).is_bare());
        let found = Pair::new(scan, body, bare.map(|point| body.points[point])).align();
        let some = (ELSEWHERE * fits.count() as f32) as usize;
        let mut placed = Vec::new();
        for placement in found.placements() {
            let fits = fits_of(&scan.placed(placement)?);
            placed.push((fits.count_off(), *placement, fits));
        }
        // The first of those that bring most limbs into place.
        let least = placed.iter().map(|(still_off, ..)| *still_off).min().unwrap_or(off);
        placed.retain(|(still_off, ..)| *still_off == least);
        let mends = least == 0 || (3 * least <= off && off > some);
        let others = placed.iter().skip(1).map(|(_, placement, _)| *placement).collect();
        match placed.into_iter().next() {
            Some((_, placement, fits)) if mends && placement != Similarity::IDENTITY => {
                let alignment = Alignment { placement, alternatives: others, ..found };
                Ok(std::iter::once(Observation::Misplaced(alignment)).chain(fits.of_limbs()).collect())
            }
            _ if off > some && found.before > UNRELATED => {
                Ok(vec![Observation::Unrelated { apart: found.before, least: found.after }])
            }
            _ => Ok(fits.of_limbs()),
        }
    }
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
