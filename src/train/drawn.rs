//! The draws of one frame: all that it is trained on, made before any engine sees it.
//!
//! Each frame of each step has a generator of its own, derived from (seed, stage, step, slot), so that the order of execution does not
//! matter. Its numbers go, in this order, to the dropout of the condition, to the points of the frame, and to the canonical anchors:
//! weights, far points, unseen points, Eikonal points.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Stage;
use super::losses::Anchors;
use super::supervision::{CanonicalBody, PreparedFrame};
use crate::config::Config;
use crate::data::FrameId;
use crate::fields::FieldPose;

/// How deep in the registered body a surface is taken to be where that is not known: as deep as registrations are wrong, metres.
pub const UNKNOWN_DEPTH: f32 = 0.01;

/// What tells the root that a point is trained through from its others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// The surface is so deep in the registered body, metres, at most [`UNKNOWN_DEPTH`]; 0 outside of it.
    Depth(f32),
    /// The surface is the registered body's own, so its place on the canonical body is known; the root is `within` so much of it, metres.
    Place {
        /// On the canonical body.
        place: Vec3,
        /// How far the root may be from it.
        within: f32,
    },
}

/// Points of one posed frame; deformed coordinates, the registration's translation subtracted, metres.
#[derive(Clone, Debug, Default)]
pub struct PosedSamples {
    /// P_on: points on the surface.
    pub on_points: Vec<[f32; 3]>,
    /// Of each: the unit normal.
    pub on_normals: Vec<[f32; 3]>,
    /// Of each: the colour in [0, 1].
    pub on_colours: Vec<[f32; 3]>,
    /// Of each: the label of its part.
    pub on_labels: Vec<u8>,
    /// Of each: where it comes from.
    pub on_origins: Vec<Origin>,
    /// P_off: points beside the surface.
    pub off_points: Vec<[f32; 3]>,
    /// Of each: 1 inside and 0 outside for occupancy; else the signed distance, metres.
    pub off_targets: Vec<f32>,
    /// Of each: the label of its part.
    pub off_labels: Vec<u8>,
    /// Of each: where the point on the surface comes from that it was moved from.
    pub off_origins: Vec<Origin>,
}

/// All that one frame of one step is trained on.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Where it stands in the endless sequence of epochs.
    pub place: u64,
    /// Passes over the frames before it.
    pub epoch: u64,
    /// Which frame.
    pub frame: FrameId,
    /// Its pose.
    pub pose: Arc<FieldPose>,
    /// The pose's condition, or zeros.
    pub condition: Vec<f32>,
    /// Its points.
    pub samples: PosedSamples,
    /// Canonical points, which no frame shows.
    pub anchors: Anchors<f32>,
    /// How long the drawing took.
    pub seconds: f64,
}

impl Drawn {
    /// Points drawn: on and off the surface, and in the canonical box.
    pub fn points(&self) -> usize {
        self.samples.on_points.len() + self.samples.off_points.len() + self.anchors.far_points.len()
    }
}

/// A frame that is to be drawn from.
pub(super) struct Order<'a> {
    pub place: u64,
    pub epoch: u64,
    pub frame: Arc<PreparedFrame<'a>>,
    pub canonical: Arc<CanonicalBody<'a>>,
    pub config: &'a Config,
    /// Whether the skinning field is trained towards known weights.
    pub follows_weights: bool,
    pub random: ChaCha8Rng,
}

impl Order<'_> {
    pub fn draw(self) -> Drawn {
        let begin = Instant::now();
        let Self { place, epoch, frame, canonical, config, follows_weights, mut random } = self;
        let dropped = random.random::<f64>() < config.fields.condition_dropout;
        let condition = if dropped { vec![0.0; frame.pose.condition.len()] } else { frame.pose.condition.clone() };
        let samples = frame.supervision.draw(config, &mut random);
        let anchors = canonical.anchors(config, follows_weights, &mut random);
        let seconds = begin.elapsed().as_secs_f64();
        Drawn { place, epoch, frame: frame.id.clone(), pose: frame.pose.clone(), condition, samples, anchors, seconds }
    }
}

/// The generator of one purpose: a stream of the seed's own for each stage, step and slot.
pub(super) fn generator(seed: u64, stage: Stage, step: u64, slot: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ (stage as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    random.set_stream(step << 16 | (slot & 0xffff));
    random
}
