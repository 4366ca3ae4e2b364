//! The frames in the order of shuffled epochs, each drawn from while the one before is trained on.

use std::sync::Arc;

use rand::seq::SliceRandom;

use super::Stage;
use super::drawn::{Drawn, Order, generator};
use super::frames::Frames;
use super::refinement::RefinedPose;
use super::supervision::CanonicalBody;
use crate::Result;
use crate::config::Config;

/// The endless sequence of frames, from place 0 on.
pub(super) struct Epochs<'a> {
    pub config: &'a Config,
    pub frames: Frames<'a>,
    pub canonical: Arc<CanonicalBody<'a>>,
    /// Whether the skinning field is trained towards known weights.
    pub follows_weights: bool,
    /// What the next frame is trained on, if it is drawn already.
    pub ahead: Option<Drawn>,
}

impl<'a> Epochs<'a> {
    /// The draws at a place, and the order of those at the next.
    pub fn take(&mut self, place: u64) -> Result<(Drawn, Order<'a>)> {
        let drawn = match self.ahead.take() {
            Some(drawn) if drawn.place == place => drawn,
            _ => self.order(place)?.draw(),
        };
        Ok((drawn, self.order(place + 1)?))
    }

    /// What is needed to draw from the frame at a place.
    fn order(&mut self, place: u64) -> Result<Order<'a>> {
        let count = self.config.optimiser.batch_frames as u64;
        let (epoch, index) = self.shuffled(place);
        Ok(Order {
            place,
            epoch,
            frame: self.frames.prepared(index)?,
            canonical: self.canonical.clone(),
            config: self.config,
            follows_weights: self.follows_weights,
            random: generator(self.config.seed, Stage::Frames, place / count, place % count),
        })
    }

    /// Takes other poses of the frames from here on.
    pub fn take_poses(&mut self, poses: Vec<RefinedPose>) {
        self.frames.take_poses(poses);
        self.ahead = None;
    }

    fn shuffled(&self, place: u64) -> (u64, usize) {
        let count = self.frames.len() as u64;
        let epoch = place / count;
        let mut order: Vec<usize> = (0..self.frames.len()).collect();
        order.shuffle(&mut generator(self.config.seed, Stage::Frames, epoch, u64::MAX));
        (epoch, order[(place % count) as usize])
    }
}
