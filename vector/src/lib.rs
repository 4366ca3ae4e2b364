//! What every kernel of the workspace stands on: number types, vector instructions chosen when the program runs, matrix products.
//!
//! Every kernel that is worth it runs its inner loop in [`vectorised`]: one preamble, and no `unsafe`.

mod instructions;
mod matrix;
mod scalar;

pub use instructions::{pass_instructions, vectorised};
pub use matrix::{Matrix, MatrixMut, Write, product};
pub use scalar::Scalar;
