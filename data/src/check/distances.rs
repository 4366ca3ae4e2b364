//! How far a scan is from its registered body, part by part, and which hand convention fits it.
//!
//! A scan point belongs to the part of its closest body face. The hand convention is judged by posing the hands both ways and
//! asking which lie on the scan. The order of threads changes nothing: points are taken at even strides, not drawn.

use glam::Vec3;
use serde::Serialize;

use super::statistics::{height, percentile, strided};
use crate::ScanFrame;
use xavatar_body::{BodyModel, BodyParameters, HandPose, Part, PartLabels, Role, smplx};
use xavatar_formats::Result;
use xavatar_mesh::SurfaceIndex;

/// Points per frame whose distances are measured.
const POINTS: usize = 4000;
const MILLIMETRES: f32 = 1000.0;

/// Median distance of the body's hands to the scan under both conventions, millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HandReport {
    /// Taken as offsets from the mean hand, as smplx and X-Humans do.
    pub relative_to_mean_mm: f32,
    /// Taken as absolute rotations.
    pub flat_mm: f32,
}

/// What one frame says.
pub(super) struct Distances {
    /// From scan points to the body, by part, millimetres.
    pub to_body: Vec<(Part, f32)>,
    /// From the body's hands to the scan: as stored, and with absolute rotations; millimetres.
    hands_to_scan: [Vec<f32>; 2],
    pub scan_to_body_height: f32,
}

impl Distances {
    pub fn of(frame: &ScanFrame, body: &BodyModel, labels: &PartLabels) -> Result<Self> {
        let posed = body.mesh(body.pose(&body.resolve(&frame.parameters)?)?.vertices);
        let body_surface = SurfaceIndex::new(&posed)?;
        let to_body = strided(&frame.scan.vertices, POINTS).map(|&point| {
            let closest = body_surface.closest(point);
            let corner = (0..3).max_by(|&a, &b| closest.barycentric[a].total_cmp(&closest.barycentric[b])).unwrap_or(0);
            let vertex = posed.faces[closest.face as usize][corner];
            (labels.parts[vertex as usize], closest.distance * MILLIMETRES)
        });
        let to_body = to_body.collect();

        let scan_surface = SurfaceIndex::new(&frame.scan)?;
        let hand_vertices: Vec<usize> =
            body.skeleton().parts_of(Role::Hands).flat_map(|part| labels.vertices_of(part)).collect();
        let hand_distances = |vertices: &[Vec3]| {
            let distance = |&vertex: &usize| scan_surface.closest(vertices[vertex]).distance * MILLIMETRES;
            strided(&hand_vertices, POINTS / 4).map(distance).collect::<Vec<_>>()
        };
        let other =
            with_flat_hands(&frame.parameters).map(|parameters| body.pose(&body.resolve(&parameters)?)).transpose()?;
        let hands_to_scan = match other {
            Some(other) => [hand_distances(&posed.vertices), hand_distances(&other.vertices)],
            None => [Vec::new(), Vec::new()],
        };
        Ok(Self { to_body, hands_to_scan, scan_to_body_height: height(&frame.scan.vertices) / height(&posed.vertices) })
    }
}

/// How the hands of all frames lie; none if no frame was measured.
pub(super) fn hands(measured: &[Distances]) -> Option<HandReport> {
    let median = |convention: usize| {
        let values = measured.iter().flat_map(|frame| frame.hands_to_scan[convention].iter().copied());
        percentile(values.collect(), 0.5)
    };
    Some(HandReport { relative_to_mean_mm: median(0)?, flat_mm: median(1)? })
}

/// The same numbers, taken as absolute rotations; none where they are already.
fn with_flat_hands(parameters: &BodyParameters) -> Option<BodyParameters> {
    let parameters = parameters.smplx().ok()?;
    let flat = |hand: &HandPose| match hand {
        HandPose::RelativeToMean(rotations) => HandPose::Flat(*rotations),
        other => other.clone(),
    };
    let (left_hand_pose, right_hand_pose) = (flat(&parameters.left_hand_pose), flat(&parameters.right_hand_pose));
    Some(smplx::Parameters { left_hand_pose, right_hand_pose, ..parameters.clone() }.into())
}
