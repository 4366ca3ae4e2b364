//! A scan as supervision: its surface and the registered body's, each with the solid it bounds, and the parts' shares of the points.

mod draw;

use glam::Vec3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::part_shares::{PartShare, part_shares, whole_share};
use super::{BYTES_A_FACE, CanonicalVertices, RegisteredBody, ScannedBody, Supervision, Surface, faces_of_part};
use crate::Result;
use crate::body::{Part, PartLabels, Registration, Role, Skeleton};
use crate::config::{Config, HandSupervision, SamplingSettings, SamplingStrategy};
use crate::data::ScanFrame;
use crate::mesh::{SurfacePoint, SurfaceSampler, TriangleMesh};
use crate::train::drawn::{Origin, PosedSamples, UNKNOWN_DEPTH};

/// Faces of a scan that lie deeper in the registered body than this are no skin, metres: a crack or a cavity that its making left inside. Roots as
/// deep are trained by no surface, so that what they show would be learned elsewhere.
const DEEPEST: f32 = UNKNOWN_DEPTH;

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
    canonical: CanonicalVertices,
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
        let ScanFrame { mut scan, parameters, unseen_parts, .. } = frame;
        scan.vertices.iter_mut().for_each(|vertex| *vertex -= parameters.translation());
        let RegisteredBody { mesh, canonical, skeleton, labels, registration } = body;
        let (scan, body) = (Surface::new(scan)?, Surface::new(mesh)?);
        let depth = |face: u32| {
            let centre = scan.mesh.corners(face).into_iter().sum::<Vec3>() / 3.0;
            let distance = body.solid.signed_distance_within(centre, UNKNOWN_DEPTH);
            distance.map_or_else(
                || if body.solid.is_inside(centre) { UNKNOWN_DEPTH } else { 0.0 },
                |distance| (-distance).max(0.0),
            )
        };
        let depths: Vec<f32> = (0..scan.mesh.faces.len() as u32).into_par_iter().with_min_len(256).map(depth).collect();
        let is_skin = |face: u32| depths[face as usize] < DEEPEST;
        let regions = regions(&scan.mesh, &body.mesh, skeleton, labels, &registration, &config.sampling, &is_skin)?;
        let is_seen = |region: &Region| !unseen_parts.contains(&skeleton.parts[region.part.index()].name);
        let regions = regions.into_iter().filter(is_seen).collect();
        Ok(Self { scan, body, canonical, registration, regions, depths })
    }

    /// Where a point on a source's surface comes from, and one that was `moved` so far from it, metres.
    fn origin(&self, source: Source, place: &SurfacePoint, moved: f32) -> Origin {
        match source {
            Source::Scan => Origin::Depth(self.depths[place.face as usize]),
            Source::Registration => self.canonical.origin(&self.body.mesh, place, moved),
        }
    }

    fn surface(&self, source: Source) -> &Surface {
        match source {
            Source::Scan => &self.scan,
            Source::Registration => &self.body,
        }
    }
}

/// The parts' shares of P (METHOD section 4), of the scan's faces that are skin; half of the face's is around eyes and mouth.
fn regions(
    scan: &TriangleMesh,
    body: &TriangleMesh,
    skeleton: &Skeleton,
    labels: &PartLabels,
    registration: &Registration,
    settings: &SamplingSettings,
    is_skin: &dyn Fn(u32) -> bool,
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
        (0..scan.faces.len() as u32).filter(|face| wanted(nearest[*face as usize]) && is_skin(*face)).collect()
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

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::data::{Capture, Split};
    use crate::mesh::Colouring;
    use crate::synthetic::BuiltInSubject;
    use crate::train::supervision::PreparedFrame;

    /// Points drawn of the left and the right hand.
    fn points_of_hands(unseen: &[&str]) -> [usize; 2] {
        let subject = BuiltInSubject::new().unwrap();
        let config = Config::preset("fast").unwrap();
        let mut frame = subject.frame(Split::Train, 0, 4).unwrap();
        frame.unseen_parts = unseen.iter().map(|name| name.to_string()).collect();
        let capture = Capture::Scan(Box::new(frame));
        let prepared = PreparedFrame::new(capture, subject.model(), subject.part_labels(), &config).unwrap();
        let samples = prepared.supervision.draw(&config, &mut ChaCha8Rng::seed_from_u64(1));
        let hands = ["left_hand", "right_hand"].map(|name| subject.model().skeleton().part_named(name).unwrap());
        hands.map(|hand| samples.on_labels.iter().filter(|label| usize::from(**label) == hand.index()).count())
    }

    #[test]
    fn nothing_is_drawn_of_a_hand_that_the_scan_does_not_show() {
        let [left, right] = points_of_hands(&[]);
        assert!(left > 0 && right > 0);
        assert_eq!(points_of_hands(&["left_hand"]), [0, right]);
    }

    // A cube of two centimetres in the chest.
    #[test]
    fn nothing_is_drawn_of_a_cavity_deep_in_the_body() {
        let subject = BuiltInSubject::new().unwrap();
        let config = Config::preset("fast").unwrap();
        let mut frame = subject.frame(Split::Train, 0, 4).unwrap();
        let pose = subject.model().resolve(&frame.parameters).unwrap();
        let chest = subject.model().pose(&pose).unwrap().joints[subject.model().skeleton().joint("spine2").unwrap()];
        let first = frame.scan.vertices.len() as u32;
        let corner = |at: u32| Vec3::new((at & 1) as f32, (at >> 1 & 1) as f32, (at >> 2) as f32) - 0.5;
        frame.scan.vertices.extend((0..8).map(|at| chest + 0.02 * corner(at)));
        for [a, b, c, d] in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
            frame.scan.faces.extend([[a, b, c], [a, c, d]].map(|face| face.map(|corner: u32| first + corner)));
        }
        (frame.scan.normals, frame.scan.colouring) = (None, Colouring::None);
        let capture = Capture::Scan(Box::new(frame));
        let prepared = PreparedFrame::new(capture, subject.model(), subject.part_labels(), &config).unwrap();
        let near = chest - pose.translation;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let drawn = |_| prepared.supervision.draw(&config, &mut random).on_points;
        assert!((0..20).flat_map(drawn).all(|point| Vec3::from_array(point).distance(near) > 0.02));
    }
}
