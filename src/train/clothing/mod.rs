//! What is worn does not move as the skin below it: a stiff shoe follows shin and toes alike, a braid down the back follows the head.
//!
//! Before training, the skinning weights around the body are fitted to the scans. Under the right weights w a canonical place x keeps
//! its signed distance s_k to the scan of frame k, whatever the pose: the fit minimises the spread of s_k(d_w(x, B_k)) over the
//! frames, held to the body model's weights and to those of neighbouring places. [`votes`] finds places that one bone explains and the
//! body model does not, [`weights`] refines all of them, [`worn`] tells what most frames then agree on; on a grid of its own, coarser
//! than the field's. R places, K frames; metres.

mod hair;
mod volume;
mod votes;
mod weights;
mod worn;

use glam::{Mat3, Vec3};
use xavatar_deformer::BoneTransform;

pub(super) use self::hair::hair_hangs;
use self::volume::{BAND, DistanceVolume};
pub(super) use self::worn::Worn;
use super::frames::Frames;
use super::supervision::PreparedFrame;
use crate::Result;
use crate::body::{BodyModel, PartLabels, Role};
use crate::config::VoxelShape;
use crate::fields::{CanonicalGrid, NodeRows};
use crate::mesh::SolidIndex;

/// Distance between the places whose weights are fitted, metres.
const SPACING: f32 = 0.035;
/// Most frames that are looked at, evenly chosen: more poses than these say little that is new.
const MOST_FRAMES: usize = 16;
/// Fewest frames that tell what is worn from chance.
const FEWEST_FRAMES: usize = 6;
/// Places deeper in the body than this keep its weights, metres.
const DEEPEST: f32 = 0.02;
/// Places nearer than this to a face keep them too: the body model knows its expressions, metres.
const NEAR_FACE: f32 = 0.03;
/// Distance from the body from which a place is asked whether anything is worn there, metres.
const OFF_BODY: f32 = 0.05;
/// Something is worn at a place if it is this near to it or holds it, metres.
const WORN: f32 = 0.02;

/// A place's bones with their weights, which sum to one.
type Row = Vec<(usize, f32)>;

/// What may be fitted (R).
struct Places {
    /// Whether a place may move otherwise than the body model says.
    may_move: Vec<bool>,
    /// The bones that it may move with.
    bones: Vec<usize>,
    /// The six places around each.
    neighbours: Vec<[u32; 6]>,
}

impl Places {
    fn new(grid: &CanonicalGrid, body: &BodyModel, labels: &PartLabels) -> Self {
        let skeleton = body.skeleton();
        let of = |role: Role| grid.nodes_of(labels, |part| skeleton.role(part) == role);
        let (of_hands, of_face) = (of(Role::Hands), of(Role::Face));
        let may_move = grid.distances().iter().enumerate().map(|(place, distance)| {
            let nearest = if of_face[place] { NEAR_FACE } else { -DEEPEST };
            *distance > nearest && !of_hands[place]
        });
        // Fingers move nothing that is worn elsewhere, and hands are supervised by the body itself; jaw and eyes move no hair.
        let parts = skeleton.parts_of_joints();
        let head = skeleton.joint("head");
        let moves_clothes = |joint: &usize| {
            let is_of_head = head.is_some() && skeleton.parents[*joint] == head;
            skeleton.role(parts[*joint]) != Role::Hands && !is_of_head
        };
        Self {
            may_move: may_move.collect(),
            bones: (0..parts.len()).filter(moves_clothes).collect(),
            neighbours: grid.neighbours(),
        }
    }
}

/// One frame as the fit sees it.
struct View<'a> {
    volume: DistanceVolume,
    /// The registered body.
    body: &'a SolidIndex,
    bones: Vec<(Mat3, Vec3)>,
    /// Where the body's blend shapes put each place (R).
    places: Vec<Vec3>,
}

impl<'a> View<'a> {
    /// The view of a frame; none if it is not of a scan.
    fn new(frame: &'a PreparedFrame, grid: &CanonicalGrid) -> Option<Self> {
        let scan = frame.supervision.scan()?;
        let volume = DistanceVolume::new(scan.mesh, scan.solid);
        let offsets = grid.node_offsets(&frame.pose.offsets);
        let places = grid.positions().into_iter().zip(offsets);
        let places = places.map(|(position, offset)| position + Vec3::from_array(offset)).collect();
        Some(Self { bones: frame.pose.bones.iter().map(affine).collect(), body: scan.body, volume, places })
    }

    /// Where a bone takes a place.
    fn image(&self, place: usize, bone: usize) -> Vec3 {
        let (linear, translation) = self.bones[bone];
        linear * self.places[place] + translation
    }

    /// Where a row of weights takes a place.
    fn blended(&self, place: usize, row: &Row) -> Vec3 {
        row.iter().map(|(bone, weight)| *weight * self.image(place, *bone)).sum()
    }

    /// The distance at a place under a row of weights.
    fn distance(&self, place: usize, row: &Row) -> f32 {
        self.volume.at(self.blended(place, row)).0
    }
}

fn affine(bone: &BoneTransform<f32>) -> (Mat3, Vec3) {
    let row = |r: usize| Vec3::from_slice(&bone[4 * r..]);
    (Mat3::from_cols(row(0), row(1), row(2)).transpose(), Vec3::new(bone[3], bone[7], bone[11]))
}

/// What the nodes of the skinning grid hang on, and what is worn: fitted to the frames' scans, or the body model's weights and nothing
/// without scans or with too few.
///
/// # Errors
/// A frame that cannot be read.
pub(super) fn fitted_rows(
    frames: &mut Frames,
    nodes: &CanonicalGrid,
    body: &BodyModel,
    labels: &PartLabels,
    betas: &[f32],
) -> Result<(NodeRows, Option<Worn>)> {
    if frames.len() < FEWEST_FRAMES {
        return Ok((nodes.body_rows(body), None));
    }
    let grid = CanonicalGrid::new(body, labels, betas, VoxelShape { spacing: SPACING, fine_spacing: SPACING })?;
    let count = frames.len().min(MOST_FRAMES);
    let looked_at = (0..count).map(|number| frames.prepared(number * frames.len() / count));
    let looked_at = looked_at.collect::<Result<Vec<_>>>()?;
    let views: Option<Vec<View>> = looked_at.iter().map(|frame| View::new(frame, &grid)).collect();
    let Some(views) = views else { return Ok((nodes.body_rows(body), None)) };
    let places = Places::new(&grid, body, labels);
    let before = grid.body_rows(body).weights;
    let mut rows = before.clone();
    votes::settle(&mut rows, &views, &places, grid.distances(), |point| grid.nearest_node(point));
    weights::refine(&mut rows, &views, &places, &body.skeleton().parents);
    let worn = Worn::new(grid, &rows, &views, &places);
    let to_body = worn.grid().distances().iter();
    let is_worn = worn.distances().iter().zip(to_body).map(|(worn, body)| *worn < WORN && *body > OFF_BODY);
    let after = NodeRows { weights: rows, worn: is_worn.collect() };
    Ok((nodes.changed_rows(body, worn.grid(), &before, &after), Some(worn)))
}
