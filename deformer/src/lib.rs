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
mod error;
mod grid;
mod search;
mod warp;

pub use affine::{BoneTransform, Jacobian, bone_transform};
pub use error::{Error, Result};
pub use grid::{Axis, BakedWarp, BakedWeights, Grid, SparseWeights, VoxelSkinning};
pub use search::{
    Candidates, SearchSettings, SearchStatistics, StartBoxes, StartGroups, StartRegions, search, search_and_polish,
};
pub use warp::{
    ExactWarp, ExactWorkspace, GradientSide, Warp, blend_transforms, deform, deform_backward, deformed_normals,
    deformed_normals_backward, jacobians_backward, root_cotangents, skinning_jacobians,
};
