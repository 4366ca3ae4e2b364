//! The neural fields of an avatar: geometry, texture and skinning, with their derivatives written out by hand.
//!
//! Nothing here knows about bodies or files. METHOD: thesis ch. 4.2, fig. A.5.

mod activation;
mod encoding;
mod error;
mod geometry;
mod matmul;
mod mlp;
mod optimiser;
mod parameters;
mod real;
mod skinning;
mod texture;
mod tree_softmax;

pub use encoding::{Bounds, EncodingShape, HashGridShape};
pub use error::{Error, Result};
pub use geometry::{GeometryField, GeometryShape, Representation};
pub use mlp::{Backward, Mlp, MlpGradient, MlpShape, SummedGradient, Trace};
pub use optimiser::{Adam, AdamSettings, NetworkUpdate, ParameterGroup, clipping_factor};
pub use parameters::{ParameterEntry, ParameterLayout};
pub use real::Real;
pub use skinning::{SkinningField, SkinningTrace, SkinningWeights};
pub use texture::{TextureField, TextureShape};
pub use tree_softmax::KinematicTree;
