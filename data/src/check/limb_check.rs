//! Whether the limbs of a body lie where its scan has them, asked of single frames by whoever registers them.

use super::inspection::{Inspector, Observation};
use super::wording::distances;
use crate::ScanFrame;
use xavatar_body::BodyModel;
use xavatar_formats::Result;

/// Looks at frames as [`CheckedFrames`](super::CheckedFrames) does, for limbs that have slipped.
pub struct LimbCheck<'a> {
    inspector: Inspector<'a>,
}

impl<'a> LimbCheck<'a> {
    /// Of frames with this body.
    pub fn new(body: &'a BodyModel) -> Self {
        Self { inspector: Inspector::new(body) }
    }

    /// The limbs that are not where the scan has them, each with its distance: `left forearm 14 mm`.
    ///
    /// # Errors
    /// Those of [`BodyModel::pose`] for the frame's parameters; if the scan has no area.
    pub fn slipped(&self, frame: &ScanFrame) -> Result<Vec<String>> {
        let observations = self.inspector.inspect(frame, false)?.observations.into_iter();
        let slipped = observations.filter_map(|observation| match observation {
            Observation::Slipped(limbs) => Some(distances(&limbs).collect::<Vec<_>>()),
            _ => None,
        });
        Ok(slipped.flatten().collect())
    }
}
