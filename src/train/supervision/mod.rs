//! What supervises the fields: each kind of capture in a file of its own, and the subject's canonical body.
//!
//! A capture becomes a [`PreparedFrame`]: the pose as the fields take it, and a [`Supervision`] that points are drawn from. Everything is in
//! the body's frame: the registration's translation is subtracted from what was captured.

mod canonical_body;
mod curve;
mod distance_grid;
mod part_shares;
mod rgbd;
mod scan;
mod uniform;

use std::sync::Arc;

use glam::Vec3;
use rand_chacha::ChaCha8Rng;

pub(super) use canonical_body::CanonicalBody;
pub(super) use curve::Curve;
pub use distance_grid::DistanceGrid;

use rgbd::CameraView;
use scan::ScanSupervision;
use uniform::uniform_points;

use super::drawn::{Origin, PosedSamples};
use crate::body::{BodyModel, Part, PartLabels, Registration, Skeleton};
use crate::config::Config;
use crate::data::{Capture, CaptureKind, FrameId};
use crate::fields::FieldPose;
use crate::mesh::{SolidIndex, SurfacePoint, TriangleMesh};
use crate::{Error, InputError, Result};

/// What a prepared face and vertex take, with their hierarchies.
const BYTES_A_FACE: usize = 200;

/// What a capture gives to the losses.
pub trait Supervision: Send + Sync {
    /// Draws points on and beside the surface.
    fn draw(&self, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples;

    /// Adds the registered body's vertices (V) that it shows to `seen`.
    fn add_seen_vertices(&self, seen: &mut [bool]);

    /// The scan and the registered body, if that is what it is of.
    fn scan(&self) -> Option<ScannedBody<'_>> {
        None
    }

    /// What it takes in memory, about, bytes.
    fn size(&self) -> usize;
}

/// A scan with the body registered to it, in the body's frame.
pub struct ScannedBody<'a> {
    /// The scan.
    pub mesh: &'a TriangleMesh,
    /// Its solid.
    pub solid: &'a SolidIndex,
    /// The solid of the registered body.
    pub body: &'a SolidIndex,
}

/// One frame of training data.
pub struct PreparedFrame<'a> {
    /// Which frame.
    pub id: FrameId,
    /// Its pose.
    pub pose: Arc<FieldPose>,
    /// What was captured of it.
    pub supervision: Box<dyn Supervision + 'a>,
}

/// The registered body of a frame, in its own frame.
struct RegisteredBody<'a> {
    mesh: TriangleMesh,
    canonical: CanonicalVertices,
    skeleton: &'a Skeleton,
    labels: &'a PartLabels,
    registration: Registration<'a>,
}

/// How far the root of a point on the registered body is from its place on the canonical body, where weights between a grid's nodes are not
/// quite the body model's, metres; and how much farther for a point beside it, by how far it is beside.
const EXACT: f32 = 0.02;
const STRETCH: f32 = 2.0;

/// The registered body's vertices in canonical space (V).
struct CanonicalVertices(Vec<Vec3>);

impl CanonicalVertices {
    /// Where a place on the posed `body` comes from, or a point that was `moved` so far from it, metres.
    fn origin(&self, body: &TriangleMesh, place: &SurfacePoint, moved: f32) -> Origin {
        let corners = body.faces[place.face as usize].map(|vertex| self.0[vertex as usize]);
        let place = corners.into_iter().zip(place.barycentric).map(|(corner, share)| corner * share).sum();
        Origin::Place { place, within: EXACT + STRETCH * moved }
    }
}

impl<'a> PreparedFrame<'a> {
    /// Prepares a capture; a scan must have normals or faces to take them from, and a surface.
    ///
    /// # Errors
    /// What makes the capture useless, with the frame named.
    pub fn new(capture: Capture, body: &'a BodyModel, labels: &'a PartLabels, config: &Config) -> Result<Self> {
        let id = capture.id().clone();
        let prepare = || {
            let pose = body.resolve(capture.parameters())?;
            let posed: Vec<Vec3> =
                body.pose(&pose)?.vertices.into_iter().map(|vertex| vertex - pose.translation).collect();
            let registration = Registration::new(&posed, labels)?;
            let mut mesh = body.mesh(posed);
            mesh.normals = Some(mesh.vertex_normals());
            let canonical = CanonicalVertices(body.canonical_vertices(&pose.shape, &[])?);
            let pose = Arc::new(FieldPose::new(body, &pose)?);
            let registered = RegisteredBody { mesh, canonical, skeleton: body.skeleton(), labels, registration };
            Ok(Self { id: id.clone(), pose, supervision: supervise(capture, registered, config)? })
        };
        prepare().map_err(|error: Error| error.in_frame(id.to_string()))
    }
}

/// What a capture of any kind gives to the losses.
fn supervise<'a>(capture: Capture, body: RegisteredBody<'a>, config: &Config) -> Result<Box<dyn Supervision + 'a>> {
    Ok(match capture {
        Capture::Scan(frame) => Box::new(ScanSupervision::new(*frame, body, config)?),
        Capture::Rgbd(capture) => Box::new(CameraView::new(*capture, body, config)?),
    })
}

/// Refuses a configuration that is for captures of another kind.
pub(super) fn check_kind(captured: CaptureKind, config: &Config) -> Result<()> {
    let configured = if config.rgbd.is_some() { CaptureKind::Rgbd } else { CaptureKind::Scans };
    if captured == configured {
        return Ok(());
    }
    let (found, expected) = match configured {
        CaptureKind::Rgbd => ("RGB-D frames", "one for scans: fast, demo or paper-scan"),
        CaptureKind::Scans => ("scans", "one for RGB-D frames: fast-rgbd, demo-rgbd or paper-rgbd"),
    };
    Err(Error::from(InputError::Value {
        name: "preset".into(),
        found: format!("`{}`, which is for {found}", config.preset),
        expected: expected.into(),
    }))
}

/// A surface to draw from, and the solid it bounds.
struct Surface {
    mesh: TriangleMesh,
    solid: SolidIndex,
}

impl Surface {
    fn new(mesh: TriangleMesh) -> Result<Self> {
        Ok(Self { solid: SolidIndex::new(&mesh)?, mesh })
    }
}

/// The faces of a body whose corners all belong to a part.
fn faces_of_part(body: &TriangleMesh, labels: &PartLabels, part: Part) -> Vec<u32> {
    let of_part = |face: &[u32; 3]| face.iter().all(|vertex| labels.parts[*vertex as usize] == part);
    (0..).zip(&body.faces).filter(|(_, face)| of_part(face)).map(|(index, _)| index).collect()
}
