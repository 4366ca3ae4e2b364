//! The neural fields of an avatar: geometry, texture and skinning, with their derivatives written out by hand.
//!
//! Nothing here knows about bodies or files. METHOD: thesis ch. 4.2, fig. A.5.

mod error;
mod real;
mod skinning;

pub use error::{Error, Result};
pub use real::Real;
pub use skinning::SkinningWeights;
