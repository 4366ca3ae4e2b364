//! STAR's and SUPR's bodies (Osman ch. 3-4): pose correctives that are sparse and local, driven by quaternions.
//!
//! `training` alternates poses, templates and joints, weights, and correctives; each vertex's correctives are a convex group lasso over the joints
//! (`group_lasso`) whose price is the way along the surface (`geodesic`), on sums over all frames (`moments`); what they are worth is judged by
//! frames that were held out (`selection`).

mod acceleration;
mod correctives;
mod geodesic;
mod group_lasso;
mod heaviness;
mod moments;
mod selection;
mod state;
mod training;

pub use correctives::{SparseCorrectives, VertexBlocks};
pub use geodesic::distances_to_joints;
pub use group_lasso::{GroupLasso, GroupProblem};
pub use moments::Moments;
pub use selection::{Chosen, Kind, chosen};
pub use training::{Progress, TrainedBody, TrainedSubject, Training};
