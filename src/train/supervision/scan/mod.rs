//! A scan as supervision: its surface and the registered body's, each with the solid it bounds, and the parts' shares of the points.

mod draw;

use glam::Vec3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::part_shares::{PartShare, part_shares, whole_share};
use super::{BYTES_A_FACE, RegisteredBody, ScannedBody, Supervision, Surface, faces_of_part};
use crate::Result;
use crate::body::{Part, PartLabels, Registration, Role, Skeleton};
use crate::config::{Config, HandSupervision, SamplingSettings, SamplingStrategy};
use crate::data::ScanFrame;
use crate::mesh::{SurfaceSampler, TriangleMesh};
use crate::train::drawn::{PosedSamples, UNKNOWN_DEPTH};

/// Where a region's points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Scan,
    Registration,
}

/// A part of the surface and its share of P.
struct Region {
    source: Source,
    part: Part,
    share: f64,
    sampler: SurfaceSampler,
}

/// A scan and the body registered to it.
pub(super) struct ScanSupervision<'a> {
    scan: Surface,
    body: Surface,
    registration: Registration<'a>,
    regions: Vec<Region>,
    /// How deep in the registered body the centre of each of the scan's faces is, metres, at most [`UNKNOWN_DEPTH`].
    depths: Vec<f32>,
}

impl Supervision for ScanSupervision<'_> {
    fn draw(&self, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples {
        draw::draw(self, config, random)
    }

    // A scan is of the whole subject.
    fn add_seen_vertices(&self, seen: &mut [bool]) {
        seen.fill(true);
    }

    fn scan(&self) -> Option<ScannedBody<'_>> {
        Some(ScannedBody { mesh: &self.scan.mesh, solid: &self.scan.solid, body: &self.body.solid })
    }

    fn size(&self) -> usize {
        BYTES_A_FACE * (self.scan.mesh.faces.len() + self.body.mesh.faces.len())
    }
}

impl<'a> ScanSupervision<'a> {
    pub fn new(frame: ScanFrame, body: RegisteredBody<'a>, config: &Config) -> Result<Self> {
        let ScanFrame { mut scan, parameters, .. } = frame;
        scan.vertices.iter_mut().for_each(|vertex| *vertex -= parameters.translation());
        let RegisteredBody { mesh, skeleton, labels, registration } = body;
        let regions = regions(&scan, &mesh, skeleton, labels, &registration, &config.sampling)?;
        let (scan, body) = (Surface::new(scan)?, Surface::new(mesh)?);
        let depth = |face: u32| {
            let centre = scan.mesh.corners(face).into_iter().sum::<Vec3>() / 3.0;
            let distance = body.solid.signed_distance_within(centre, UNKNOWN_DEPTH);
            distance.map_or_else(
                || if body.solid.is_inside(centre) { UNKNOWN_DEPTH } else { 0.0 },
                |distance| (-distance).max(0.0),
            )
        };
        let depths = (0..scan.mesh.faces.len() as u32).into_par_iter().with_min_len(256).map(depth).collect();
        Ok(Self { scan, body, registration, regions, depths })
    }

    /// How deep in the registered body the surface is at a face of a source. Thin fingers have no exact depth on a grid.
    fn depth(&self, source: Source, face: u32) -> f32 {
        match source {
            Source::Scan => self.depths[face as usize],
            Source::Registration => UNKNOWN_DEPTH,
        }
    }

    fn surface(&self, source: Source) -> &Surface {
        match source {
            Source::Scan => &self.scan,
            Source::Registration => &self.body,
        }
    }
}

/// The parts' shares of P (METHOD section 4); half of the face's is around eyes and mouth.
fn regions(
    scan: &TriangleMesh,
    body: &TriangleMesh,
    skeleton: &Skeleton,
    labels: &PartLabels,
    registration: &Registration,
    settings: &SamplingSettings,
) -> Result<Vec<Region>> {
    if settings.strategy == SamplingStrategy::Uniform {
        let sampler = SurfaceSampler::new(scan, None)?;
        let (part, share) = (Part::default(), whole_share(settings));
        return Ok(vec![Region { source: Source::Scan, part, share, sampler }]);
    }
    let nearest: Vec<usize> = (0..scan.faces.len() as u32)
        .map(|face| registration.nearest_vertex(scan.corners(face).into_iter().sum::<Vec3>() / 3.0))
        .collect();
    let scan_faces = |wanted: &dyn Fn(usize) -> bool| -> Vec<u32> {
        (0..scan.faces.len()).filter(|face| wanted(nearest[*face])).map(|face| face as u32).collect()
    };
    let is_registered =
        |part: Part| settings.hand_supervision == HandSupervision::Registration && skeleton.role(part) == Role::Hands;
    let wanted = part_shares(skeleton, settings, |share| share / 2.0).into_iter().map(|of| match of {
        PartShare { part, share, is_detail: true } => {
            (Source::Scan, part, share, scan_faces(&|vertex| labels.parts[vertex] == part && labels.detail[vertex]))
        }
        PartShare { part, share, .. } if is_registered(part) => {
            (Source::Registration, part, share, faces_of_part(body, labels, part))
        }
        PartShare { part, share, .. } => {
            (Source::Scan, part, share, scan_faces(&|vertex| labels.parts[vertex] == part))
        }
    });
    // A part that the frame does not show contributes nothing.
    let wanted = wanted.filter(|(.., faces)| !faces.is_empty());
    let region = |(source, part, share, faces): (Source, Part, f64, Vec<u32>)| {
        let mesh = if source == Source::Scan { scan } else { body };
        Ok(Region { source, part, share, sampler: SurfaceSampler::new(mesh, Some(&faces))? })
    };
    wanted.map(region).collect()
}
