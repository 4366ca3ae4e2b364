//! The neural fields of an avatar: geometry, texture and skinning, with their derivatives written out by hand.
//!
//! Nothing here knows about bodies or files (thesis ch. 4.2, fig. A.5). From the formulas to the code:
//!
//! - e(x) = [x, sin 2^0 x, cos 2^0 x, ...], or features of a multi-resolution hash grid: [`EncodingShape`], [`HashGridShape`].
//! - a_0 = [e(x) | P c + p], a_(l+1) = softplus(W_l a_l + b_l), W = g v / |v|, e(x) joined once more on the way: [`Mlp`]. The condition c is
//!   [embedded](Mlp::embed) once a frame.
//! - f(x_c | theta, psi), a logit or a distance: [`GeometryField`]; [`Representation`] says which side is which.
//! - c(x_c, n_d), the colour, which also sees f's last hidden layer: [`TextureField`].
//! - w(x_c), the skinning weights: [`SkinningField`], an [`Mlp`] whose logits pass down the [`KinematicTree`]: a joint keeps
//!   m (1 - sigma) of its mass and its children share the rest. [`SkinningWeights`] is anything that gives such weights.
//!
//! A [`Trace`] is a thread's memory of one block of rows. Derivatives are sweeps over it:
//!
//! | | method | gives |
//! |---|---|---|
//! | forward | [`Mlp::forward`] | values, features |
//! | down | [`Mlp::input_gradient`] | df/dx, for normals |
//! | up and backward | [`Mlp::backward`] | the parameters' gradient of any loss on values *and* on df/dx |
//!
//! so that a loss on normals costs six matrix products a layer, and no tape. Gradients are [summed](SummedGradient) in a fixed order and applied by
//! [`Adam`], whose moments can be saved.
//!
//! ```
//! use rand::SeedableRng;
//! use xavatar_network::{Bounds, GeometryField, GeometryShape, Representation, Trace};
//!
//! let shape = GeometryShape { depth: 3, width: 32, frequencies: 2, skip: None, embedded: 0, grid: None };
//! let bounds = Bounds { lowest: [-1.0; 3], highest: [1.0; 3] };
//! let mut field = GeometryField::<f32>::new(&shape, 0, Representation::SignedDistance, bounds)?;
//! field.initialise(&mut rand_chacha::ChaCha8Rng::seed_from_u64(0));
//! // Starts as a sphere of radius one: negative inside, growing outwards.
//! let mut trace = Trace::default();
//! field.mlp.forward(&mut trace, &[0.0, 0.1, 0.0, 0.0, 2.0, 0.0], &[], &[]);
//! assert!(trace.output()[0] < trace.output()[1]);
//! field.mlp.input_gradient(&mut trace, &[1.0, 1.0]);
//! assert!(trace.gradient()[4] > 0.0);
//! # Ok::<(), xavatar_network::Error>(())
//! ```

mod activation;
mod encoding;
mod error;
mod geometry;
mod instructions;
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
pub use instructions::product_instructions;
pub use mlp::{Backward, Mlp, MlpGradient, MlpShape, SummedGradient, Trace};
pub use optimiser::{Adam, AdamSettings, NetworkUpdate, ParameterGroup};
pub use parameters::{ParameterEntry, ParameterLayout};
pub use real::Real;
pub use skinning::{SkinningField, SkinningTrace, SkinningWeights};
pub use texture::{TextureField, TextureShape};
pub use tree_softmax::KinematicTree;
pub use xavatar_vector::Scalar;
