//! Explicit body models: a pose of a skeleton to joints, bone transforms and vertices (thesis ch. 4.1).
//!
//! A [`Skeleton`] is data: joints, tree, parts, canonical pose. A [`BodyModel`] has one, with the template, weights and blend shapes
//! of its file, and takes a [`Pose`]. Each family of models is a file in `families`; what it alone knows, the layout of its
//! files, its joints' numbers, its hand conventions ([`smplx::Parameters`]), stays there.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod anatomy;
pub mod anny;
mod batch;
mod blend_shapes;
mod bones;
mod face_units;
mod families;
mod gender;
mod hands;
mod imported;
mod influences;
mod joint_regressor;
mod least_squares;
pub mod mhr;
mod model;
mod model_arrays;
mod model_file;
mod parameters;
mod part_files;
mod part_labels;
mod parts;
mod pose;
mod posing;
mod regions;
mod registration;
mod retopology;
mod separation;
mod shape_space;
mod skeleton;
mod symmetric;
mod transfer;

pub use anatomy::{Anatomy, Correctives, JointBasis};
pub use batch::{ConstrainedBatch, HingeConvention, JointConstraints, JointFreedom, Limits, PoseBatch, PosedBatch};
pub use blend_shapes::BlendShapes;
pub use bones::Bone;
pub use face_units::{FaceUnits, FittedUnit, UnitError};
pub use families::{flame, mano, smpl, smplh, smplx};
pub use gender::Gender;
pub use hands::{Fingers, HandPose, HandSpace};
pub use joint_regressor::{JointFit, Motion};
pub use model::{BodyModel, Coefficients};
pub use parameters::BodyParameters;
pub use part_labels::{PartLabelSource, PartLabels};
pub use parts::{Detail, Part, PartGroup, Role};
pub use pose::{Pose, PoseAxisAngle};
pub use posing::PosedBody;
pub use posing::skin;
pub use regions::Region;
pub use registration::Registration;
pub use retopology::{Moved, SurfaceMap, moved};
pub use separation::BodyPart;
pub use shape_space::ShapeSpace;
pub use skeleton::Skeleton;
pub use transfer::Transferred;
