//! Canonical <-> deformed space: linear blend skinning and the part-aware correspondence search (thesis ch. 4.2.2-4.2.3).
//!
//! Knows skinning weights and bone transforms, nothing of bodies or files.

mod affine;
mod axis;
mod baked;
mod baked_warp;
mod broyden;
mod broyden_lanes;
mod candidates;
mod error;
mod grid;
mod groups;
mod implicit;
mod normals;
mod plan;
mod search;
mod skinning;
#[cfg(test)]
mod softmax_field;
mod sparse_weights;
mod start_regions;
mod warp;

pub use affine::{BoneTransform, Jacobian, bone_transform};
pub use axis::Axis;
pub use baked::BakedWeights;
pub use baked_warp::BakedWarp;
pub use candidates::{Candidates, SearchStatistics};
pub use error::{Error, Result};
pub use grid::Grid;
pub use groups::StartGroups;
pub use implicit::root_cotangents;
pub use normals::{GradientSide, deformed_normals, deformed_normals_backward};
pub use search::{SearchSettings, search, search_and_polish};
pub use skinning::{blend_transforms, deform, deform_backward, jacobians_backward, skinning_jacobians};
pub use sparse_weights::SparseWeights;
pub use start_regions::{StartBoxes, StartRegions};
pub use warp::{ExactWarp, ExactWorkspace, Warp};
