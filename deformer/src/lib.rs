//! Canonical <-> deformed space: linear blend skinning and the part-aware correspondence search (thesis ch. 4.2.2-4.2.3).
//!
//! Knows skinning weights and bone transforms, nothing of bodies or files. From the formulas to the code:
//!
//! - d(x_c) = sum_i w_i(x_c) B_i x_c, and its Jacobian J: [`deform`], [`skinning_jacobians`]; as something to search on, a
//!   [`Warp`]: [`ExactWarp`] evaluates the weights, [`BakedWarp`] looks twelve numbers up on a [`Grid`] on which they were sampled
//!   ([`BakedWeights`]) or are learned ([`VoxelSkinning`]).
//! - Starts x_c = B_i^-1 x_d for the bones i of the point's part: [`StartGroups`]; on a grid, only those whose bones can matter there
//!   ([`StartRegions`]).
//! - d(x_c) = x_d by Broyden's method from each start: [`search`], and [`search_and_polish`] for baked fields, whose roots are then
//!   made exact. [`SearchSettings`] says when a start is given up and which roots are one; [`Candidates`] are what is left.
//! - dx_c = -J^-1 d d(x_c)/d sigma at a root, whatever iterations led there: [`root_cotangents`] turns a cotangent of x_c into one of
//!   d, [`deform_backward`] that into one of the weights.
//! - n_d = normalise(J^-T grad f): [`deformed_normals`] and its backward; [`GradientSide`] says which way grad f points.
//!
//! Points, transforms and weights are flat batches: N points, I starts, J bones; metres.

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
mod voxel;
mod voxel_gradient;
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
pub use voxel::VoxelSkinning;
pub use warp::{ExactWarp, ExactWorkspace, Warp};
