//! The neural fields of an avatar: geometry, texture and skinning, with their derivatives written out by hand.
//!
//! Nothing here knows about bodies or files. METHOD: thesis ch. 4.2, fig. A.5.

mod activation;
mod encoding;
mod error;
mod matmul;
mod mlp;
mod parameters;
mod real;
mod skinning;

pub use error::{Error, Result};
pub use mlp::{Backward, Mlp, MlpGradient, MlpShape, Trace};
pub use parameters::{ParameterEntry, ParameterLayout};
pub use real::Real;
pub use skinning::SkinningWeights;
