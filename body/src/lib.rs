//! Explicit body models: SMPL-X parameters to joints, bone transforms and vertices (thesis ch. 4.1).

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod blend_shapes;
mod bones;
mod gender;
mod model;
mod model_file;
mod parameters;
mod part_files;
mod parts;
mod posing;
mod registration;
mod skeleton;

pub use bones::{Bone, joint_weights};
pub use gender::Gender;
pub use model::BodyModel;
pub use parameters::{BodyParameters, HandPose, PoseAxisAngle};
pub use parts::{FULL_GROUP, Part, PartLabelSource, PartLabels};
pub use posing::PosedBody;
pub use posing::skin;
pub use registration::Registration;
pub use skeleton::{JOINT_NAMES, JOINTS, PARENTS};
