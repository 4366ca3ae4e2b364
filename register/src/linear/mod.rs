//! A body near a pose, to first order: places and their derivatives by turns of joints in SO(3), translation, expression and shape.
//!
//! x = (R_1 .. R_J, t, psi, beta), R_k <- R_k exp(hat(d_k)). Double precision; metres, radians. Every column is checked against finite
//! differences, for every family of bodies.

mod body_points;
mod chain;
mod columns;
mod frame_pose;
mod normal_equations;
mod rotation;
pub mod so3;
#[cfg(test)]
mod tests;

pub use body_points::{BodyPoints, PosedPoints};
pub use chain::{Basis, Linkage, PosedChain};
pub use columns::{Besides, Extents, Unknowns};
pub use frame_pose::FramePose;
pub use normal_equations::{NormalEquations, Row};
pub use rotation::rotation_between;
