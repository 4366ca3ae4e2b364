//! Explicit body models: SMPL-X parameters to joints, bone transforms and vertices (thesis ch. 4.1).

mod parameters;

pub use parameters::{BodyParameters, HandPose, PoseAxisAngle};

/// Joints of the SMPL-X skeleton: 22 body, jaw, two eyes, 2 x 15 hand joints.
pub const JOINTS: usize = 55;
