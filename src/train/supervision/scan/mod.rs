//! A scan as supervision: its surface and the registered body's, each with the solid it bounds, and the parts' shares of the points.

mod draw;

use glam::Vec3;
use rand_chacha::ChaCha8Rng;

use super::{BYTES_A_FACE, RegisteredBody, Supervision, Surface, faces_of_part};
use crate::Result;
use crate::body::{Part, PartLabels, Registration};
use crate::config::{Config, HandSupervision, SamplingSettings, SamplingStrategy};
use crate::data::ScanFrame;
use crate::mesh::{SurfaceSampler, TriangleMesh};
use crate::train::drawn::PosedSamples;

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
}

impl Supervision for ScanSupervision<'_> {
    fn draw(&self, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples {
        draw::draw(self, config, random)
    }

    // A scan is of the whole subject.
    fn add_seen_vertices(&self, seen: &mut [bool]) {
        seen.fill(true);
    }

    fn size(&self) -> usize {
        BYTES_A_FACE * (self.scan.mesh.faces.len() + self.body.mesh.faces.len())
    }
}

impl<'a> ScanSupervision<'a> {
    pub fn new(frame: ScanFrame, body: RegisteredBody<'a>, settings: &SamplingSettings) -> Result<Self> {
        let ScanFrame { mut scan, parameters, .. } = frame;
        scan.vertices.iter_mut().for_each(|vertex| *vertex -= parameters.transl);
        let RegisteredBody { mesh, labels, registration } = body;
        let regions = regions(&scan, &mesh, labels, &registration, settings)?;
        Ok(Self { scan: Surface::new(scan)?, body: Surface::new(mesh)?, registration, regions })
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
    labels: &PartLabels,
    registration: &Registration,
    settings: &SamplingSettings,
) -> Result<Vec<Region>> {
    if settings.strategy == SamplingStrategy::Uniform {
        let sampler = SurfaceSampler::new(scan, None)?;
        let share = settings.body_share + settings.face_share + 2.0 * settings.hand_share;
        return Ok(vec![Region { source: Source::Scan, part: Part::Body, share, sampler }]);
    }
    let nearest: Vec<usize> = (0..scan.faces.len() as u32)
        .map(|face| registration.nearest_vertex(scan.corners(face).into_iter().sum::<Vec3>() / 3.0))
        .collect();
    let scan_faces = |wanted: &dyn Fn(usize) -> bool| -> Vec<u32> {
        (0..scan.faces.len()).filter(|face| wanted(nearest[*face])).map(|face| face as u32).collect()
    };
    let of_part = |part: Part| scan_faces(&|vertex| labels.parts[vertex] == part);
    let mut wanted = vec![
        (Source::Scan, Part::Body, settings.body_share, of_part(Part::Body)),
        (Source::Scan, Part::Face, settings.face_share / 2.0, of_part(Part::Face)),
        (Source::Scan, Part::Face, settings.face_share / 2.0, scan_faces(&|vertex| labels.eyes_mouth[vertex])),
    ];
    for part in [Part::LeftHand, Part::RightHand] {
        let (source, faces) = match settings.hand_supervision {
            HandSupervision::Registration => (Source::Registration, faces_of_part(body, labels, part)),
            HandSupervision::Scan => (Source::Scan, of_part(part)),
        };
        wanted.push((source, part, settings.hand_share, faces));
    }
    // A part that the frame does not show contributes nothing.
    wanted.retain(|(.., faces)| !faces.is_empty());
    let region = |(source, part, share, faces): (Source, Part, f64, Vec<u32>)| {
        let mesh = if source == Source::Scan { scan } else { body };
        Ok(Region { source, part, share, sampler: SurfaceSampler::new(mesh, Some(&faces))? })
    };
    wanted.into_iter().map(region).collect()
}
