//! RGB-D frames: aligned colour and depth pictures with registered bodies, and the points that they show (thesis 4.4).

mod frame;
mod normals;
mod point_cloud;

pub use frame::{BACKGROUND, FARTHEST_DEPTH, NO_MEASUREMENT, RgbdFrame, RgbdSource};
pub use point_cloud::PointCloud;
