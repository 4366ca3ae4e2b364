//! What fields and deformers ask of a number, beyond arithmetic.

use xavatar_vector::Scalar;

use crate::activation::Elementwise;

/// A floating-point number that fields and deformers compute with.
pub trait Real: Scalar + Elementwise {
    /// Rounded toward zero; 0 for negative numbers and NaN, 2^31 - 1 for larger numbers.
    fn truncated(self) -> u32;
    /// A number below 2^24, exactly.
    fn of_index(index: u32) -> Self;
}

impl Real for f32 {
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
