//! Landmarks: named points of a person, found by any program, as places of a body.

mod bones;
mod c3d;
mod file;
mod json;
mod names;
mod own;
mod points;
mod sites;
#[cfg(test)]
mod tests;
mod trc;

use glam::DVec3;

pub use bones::believed;
pub use file::{Found, LandmarkFiles, Track, TrackFrame, parse_landmarks};
pub use names::{COCO_17, of_count as names_of_layout};
pub use own::{LANDMARKS_FILE, NamedPoint, write_own};
pub use sites::{NamedSite, Site, Sites};

/// A place of the body that was seen in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Which of the body's [`Sites`].
    pub site: usize,
    /// Where, in the scan's coordinates, metres.
    pub place: DVec3,
    /// 0 to 1.
    pub confidence: f64,
}
