//! The two number types every kernel is written for: f32 in the product, f64 in oracles and derivative tests.

use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{AddAssign, DivAssign, MulAssign, SubAssign};

use crate::activation::Elementwise;

/// A floating-point number that fields and deformers compute with.
pub trait Real:
    num_traits::Float
    + Elementwise
    + Default
    + Debug
    + Send
    + Sync
    + Sum
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + 'static
{
    /// The nearest number of this type.
    fn of(value: f64) -> Self;
    /// As f64, exactly.
    fn wide(self) -> f64;
    /// Rounded toward zero; 0 for negative numbers and NaN.
    fn truncated(self) -> u32;
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
    fn wide(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn truncated(self) -> u32 {
        self as u32
    }
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn wide(self) -> f64 {
        self
    }
    #[inline(always)]
    fn truncated(self) -> u32 {
        self as u32
    }
}
