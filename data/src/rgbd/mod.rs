//! RGB-D frames: aligned colour and depth pictures with registered bodies, and the points that they show (thesis 4.4).
//!
//! Files -> [`RgbdSubject`] -> [`RgbdFrame`] -> [`PointCloud`]. Layouts: X-Humans' `render` folders, and plain folders that a
//! `rgbd.toml` describes (docs/rgbd.md).

mod association;
mod cameras;
mod check;
mod depth_file;
mod depth_write;
mod frame;
mod layout;
mod normals;
mod numbering;
mod pictures;
mod plain;
mod point_cloud;
mod recordings;
mod subject;
mod write;
mod xhumans;

pub use check::{RgbdCheckReport, check_rgbd};
pub use depth_file::{DepthPicture, parse_depth, read_depth};
pub use depth_write::{DepthFormat, write_depth};
pub use frame::{BACKGROUND, FARTHEST_DEPTH, NO_MEASUREMENT, RgbdFrame};
pub(crate) use layout::Shape;
pub use pictures::RgbdPictures;
pub use point_cloud::PointCloud;
pub use subject::{RgbdFiles, RgbdFrames, RgbdSubject};
pub use write::{RgbdLayout, remove_rgbd_frame, write_rgbd_subject};
