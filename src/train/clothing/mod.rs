//! What is worn does not move as the skin below it: a stiff shoe follows shin and toes alike, a braid down the back follows the head.
//!
//! Before training, the skinning weights around the body are fitted to the scans. Under the right weights w a canonical place x keeps
//! its signed distance s_k to the scan of frame k, whatever the pose: the fit minimises the spread of s_k(d_w(x, B_k)) over the
//! frames, held to the body model's weights and to those of neighbouring places. [`votes`] finds places that one bone explains and the
//! body model does not, [`weights`] refines all of them; on a grid of its own, coarser than the field's. R places, K frames; metres.

mod hair;
mod volume;
mod votes;
mod weights;

use glam::{Mat3, Vec3};
use xavatar_deformer::BoneTransform;

pub(super) use self::hair::hair_hangs;
use self::volume::{BAND, DistanceVolume};
use super::frames::Frames;
use super::supervision::PreparedFrame;
use crate::Result;
use crate::body::{BodyModel, PartLabels, Role};
use crate::config::VoxelShape;
use crate::fields::{CanonicalGrid, NodeRows};

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
/// Something is worn at a place if the subject is this near to it or holds it, metres.
const WORN: f32 = 0.02;
/// In so large a share of the frames.
const WORN_SHARE: f32 = 0.6;

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

/// One frame as the fit sees it.
struct View {
    volume: DistanceVolume,
    bones: Vec<(Mat3, Vec3)>,
    /// Where the body's blend shapes put each place (R).
    places: Vec<Vec3>,
}

impl View {
    /// The view of a frame; none if it is not of a scan.
    fn new(frame: &PreparedFrame, grid: &CanonicalGrid) -> Option<Self> {
        let scan = frame.supervision.scan()?;
        let volume = DistanceVolume::new(scan.mesh, scan.solid);
        let offsets = grid.node_offsets(&frame.pose.offsets);
        let places = grid.positions().into_iter().zip(offsets);
        let places = places.map(|(position, offset)| position + Vec3::from_array(offset)).collect();
        Some(Self { bones: frame.pose.bones.iter().map(affine).collect(), volume, places })
    }

    /// Where a bone takes a place.
    fn image(&self, place: usize, bone: usize) -> Vec3 {
        let (linear, translation) = self.bones[bone];
        linear * self.places[place] + translation
    }

    /// The distance at a place under a row of weights.
    fn distance(&self, place: usize, row: &Row) -> f32 {
        self.volume.at(row.iter().map(|(bone, weight)| *weight * self.image(place, *bone)).sum()).0
    }
}

fn affine(bone: &BoneTransform<f32>) -> (Mat3, Vec3) {
    let row = |r: usize| Vec3::from_slice(&bone[4 * r..]);
    (Mat3::from_cols(row(0), row(1), row(2)).transpose(), Vec3::new(bone[3], bone[7], bone[11]))
}

/// What the nodes of the skinning grid hang on: fitted to the frames' scans, or the body model's weights without scans or with too few.
///
/// # Errors
/// A frame that cannot be read.
pub(super) fn fitted_rows(
    frames: &mut Frames,
    nodes: &CanonicalGrid,
    body: &BodyModel,
    labels: &PartLabels,
    betas: &[f32],
) -> Result<NodeRows> {
    if frames.len() < FEWEST_FRAMES {
        return Ok(nodes.body_rows(body));
    }
    let grid = CanonicalGrid::new(body, labels, betas, VoxelShape { spacing: SPACING, fine_spacing: SPACING })?;
    let count = frames.len().min(MOST_FRAMES);
    let (mut views, mut seen) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for number in 0..count {
        let frame = frames.prepared(number * frames.len() / count)?;
        let Some(view) = View::new(&frame, &grid) else { return Ok(nodes.body_rows(body)) };
        views.push(view);
        seen.push(frame);
    }
    let skeleton = body.skeleton();
    let roles: Vec<Role> = skeleton.parts_of_joints().into_iter().map(|part| skeleton.role(part)).collect();
    // Fingers move nothing that is worn elsewhere, and hands are supervised by the body itself.
    let of = |role: Role| grid.nodes_of(labels, |part| skeleton.role(part) == role);
    let (of_hands, of_face) = (of(Role::Hands), of(Role::Face));
    let distances = grid.distances();
    let places = Places {
        may_move: (0..distances.len())
            .map(|place| {
                let nearest = if of_face[place] { NEAR_FACE } else { -DEEPEST };
                distances[place] > nearest && !of_hands[place]
            })
            .collect(),
        bones: (0..roles.len()).filter(|joint| roles[*joint] != Role::Hands).collect(),
        neighbours: grid.neighbours(),
    };
    let before = grid.body_rows(body).weights;
    let mut rows = before.clone();
    votes::settle(&mut rows, &views, &seen, &places, distances);
    weights::refine(&mut rows, &views, &places, &skeleton.parents);
    let is_worn = |place: usize| {
        let holds = |view: &&View| view.distance(place, &rows[place]) < WORN;
        let share = views.iter().filter(holds).count() as f32 / views.len() as f32;
        distances[place] > OFF_BODY && places.may_move[place] && share >= WORN_SHARE
    };
    let worn = (0..rows.len()).map(is_worn).collect();
    Ok(nodes.changed_rows(body, &grid, &before, &NodeRows { weights: rows, worn }))
}
