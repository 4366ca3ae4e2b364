//! Numbers against double-precision references.

mod body;
mod loss_derivatives;
mod mesh_inside;
mod metrics;
mod scan_step;
