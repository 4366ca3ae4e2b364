//! Registration.

pub mod fit;
pub mod landmarks;
pub mod linear;
pub mod surface_model;
pub mod target;
pub mod terms;
