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
    /// Rounded toward zero; 0 for negative numbers and NaN, 2^31 - 1 for larger numbers.
    fn truncated(self) -> u32;
    /// A number below 2^24, exactly.
    fn of_index(index: u32) -> Self;
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
        // Through i32, which has vector instructions.
        (self as i32).max(0) as u32
    }
    #[inline(always)]
    fn of_index(index: u32) -> Self {
        index as i32 as Self
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
        // Through i32, which has vector instructions.
        (self as i32).max(0) as u32
    }
    #[inline(always)]
    fn of_index(index: u32) -> Self {
        index as i32 as Self
    }
}
