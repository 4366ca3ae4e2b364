//! A frame made ready to draw from: bones, and what supervises: a scan (here), or what an RGB-D camera saw (`camera_view`).
//!
//! Everything is in the body's frame: the registration's translation is subtracted from what was captured.

use std::sync::Arc;

use glam::Vec3;

use super::camera_view::CameraView;
use super::captured::CapturedFrame;
use super::part_shares::{PartShare, part_shares, whole_share};
use crate::body::{BodyModel, Part, PartLabels, Registration, Role, Skeleton};
use crate::config::{Config, HandSupervision, SamplingSettings, SamplingStrategy};
use crate::data::{FrameId, ScanFrame};
use crate::fields::FieldPose;
use crate::mesh::{SolidIndex, SurfaceSampler, TriangleMesh};
use crate::{Error, Result};

/// What a prepared face and vertex take, with their hierarchies.
pub(super) const BYTES_A_FACE: usize = 200;

/// A surface to draw from, and the solid it bounds.
pub(super) struct Surface {
    pub mesh: TriangleMesh,
    pub solid: SolidIndex,
}

impl Surface {
    pub fn new(mesh: TriangleMesh) -> Result<Self> {
        Ok(Self { solid: SolidIndex::new(&mesh)?, mesh })
    }
}

/// Where a region's points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Scan,
    Registration,
}

/// A part of the surface and its share of P.
pub(super) struct Region {
    pub source: Source,
    pub part: Part,
    pub share: f64,
    pub sampler: SurfaceSampler,
}

/// One frame of training data.
pub(super) struct PreparedFrame<'a> {
    pub id: FrameId,
    pub pose: Arc<FieldPose>,
    pub supervision: Supervision<'a>,
}

/// What a frame's points are drawn from.
pub(super) enum Supervision<'a> {
    Scan(Box<ScanSupervision<'a>>),
    Camera(Box<CameraView<'a>>),
}

/// A scan and the body registered to it.
pub(super) struct ScanSupervision<'a> {
    pub scan: Surface,
    pub body: Surface,
    pub registration: Registration<'a>,
    pub regions: Vec<Region>,
}

/// The registered body of a frame, in its own frame.
pub(super) struct RegisteredBody<'a> {
    pub mesh: TriangleMesh,
    pub labels: &'a PartLabels,
    pub registration: Registration<'a>,
}

impl<'a> PreparedFrame<'a> {
    /// Prepares a frame; a scan must have normals or faces to take them from, and a surface.
    pub fn new(frame: CapturedFrame, body: &BodyModel, labels: &'a PartLabels, config: &Config) -> Result<Self> {
        let id = frame.id().clone();
        let prepare = || {
            let (skeleton, pose) = (body.skeleton(), body.resolve(frame.parameters())?);
            let posed: Vec<Vec3> =
                body.pose(&pose)?.vertices.into_iter().map(|vertex| vertex - pose.translation).collect();
            let registration = Registration::new(&posed, labels)?;
            let mut mesh = body.mesh(posed);
            mesh.normals = Some(mesh.vertex_normals());
            let registered = RegisteredBody { mesh, labels, registration };
            Ok(Self {
                id: id.clone(),
                pose: Arc::new(FieldPose::new(body, &pose)?),
                supervision: match frame {
                    CapturedFrame::Scan(frame) => {
                        Supervision::Scan(Box::new(ScanSupervision::new(*frame, registered, skeleton, config)?))
                    }
                    CapturedFrame::Rgbd(frame) => {
                        Supervision::Camera(Box::new(CameraView::new(*frame, registered, skeleton, config)?))
                    }
                },
            })
        };
        prepare().map_err(|error: Error| error.in_frame(id.to_string()))
    }

    /// What the frame takes in memory, about, bytes.
    pub fn size(&self) -> usize {
        match &self.supervision {
            Supervision::Scan(supervision) => {
                let ScanSupervision { scan, body, .. } = supervision.as_ref();
                BYTES_A_FACE * (scan.mesh.faces.len() + body.mesh.faces.len())
            }
            Supervision::Camera(view) => view.size(),
        }
    }
}

impl<'a> ScanSupervision<'a> {
    fn new(frame: ScanFrame, body: RegisteredBody<'a>, skeleton: &Skeleton, config: &Config) -> Result<Self> {
        let ScanFrame { mut scan, parameters, .. } = frame;
        scan.vertices.iter_mut().for_each(|vertex| *vertex -= parameters.translation());
        let RegisteredBody { mesh, labels, registration } = body;
        let regions = regions(&scan, &mesh, skeleton, labels, &registration, &config.sampling)?;
        Ok(Self { scan: Surface::new(scan)?, body: Surface::new(mesh)?, registration, regions })
    }

    pub fn surface(&self, source: Source) -> &Surface {
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

/// The faces of a body whose corners all belong to a part.
pub(super) fn faces_of_part(body: &TriangleMesh, labels: &PartLabels, part: Part) -> Vec<u32> {
    let of_part = |face: &[u32; 3]| face.iter().all(|vertex| labels.parts[*vertex as usize] == part);
    (0..).zip(&body.faces).filter(|(_, face)| of_part(face)).map(|(index, _)| index).collect()
}
