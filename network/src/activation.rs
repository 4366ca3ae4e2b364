//! Elementwise passes between matrix products: softplus with its slope, exponentials, products.
//!
//! softplus(z) = ln(1 + exp(beta z)) / beta with beta = 100 (METHOD section 2); slope s = 1 / (1 + exp(-beta z)) and
//! softplus'' = beta s (1 - s). In f32 the exponential and logarithm are polynomials that the compiler vectorises for the widest
//! instruction set found at run time; absolute error of softplus below 2e-8. In f64 they are the standard library's.

use crate::Real;
use xavatar_vector::vectorised;

/// Sharpness of the softplus.
pub(crate) const SHARPNESS: f64 = 100.0;

/// exp(x) for x <= 0, relative error 2e-7. Cody-Waite reduction to |r| <= ln(2)/2, then degree 6.
///
/// Polynomials here are grouped after Estrin: the passes wait for the longest chain of operations, not for their number.
#[inline(always)]
fn exp_of_negative(x: f32) -> f32 {
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    // Adding 1.5 * 2^23 rounds to an integer and leaves it in the low mantissa bits.
    const ROUNDER: f32 = 12_582_912.0;
    // A comparison, because `max` would turn a NaN into -87.
    let x = if x < -87.0 { -87.0 } else { x };
    let shifted = x.mul_add(LOG2_E, ROUNDER);
    let power = shifted - ROUNDER;
    let r = power.mul_add(-LN2_LOW, power.mul_add(-LN2_HIGH, x));
    let r2 = r * r;
    let (low, middle) = (r.mul_add(1.0 / 6.0, 0.5), r.mul_add(1.0 / 120.0, 1.0 / 24.0));
    let high = r2.mul_add(1.0 / 720.0, middle);
    let series = high.mul_add(r2, low).mul_add(r2, 1.0 + r);
    series * f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3f80_0000))
}

/// ln(1 + e) for e in [0, 1], absolute error 2e-7: e times the degree-7 interpolant of ln(1 + e) / e at Chebyshev's points.
#[inline(always)]
fn ln_one_plus(e: f32) -> f32 {
    let (e2, first, second) = (e * e, e.mul_add(-0.499_971_75, 0.999_999_8), e.mul_add(-0.244_747_74, 0.332_719_3));
    let (third, fourth) = (e.mul_add(-0.106_850_03, 0.176_874_77), e.mul_add(-0.008_371_153, 0.043_493_9));
    e * fourth.mul_add(e2, third).mul_add(e2, second).mul_add(e2, first)
}

/// softplus(z) and e = exp(-beta |z|).
#[inline(always)]
fn softplus_and_decay(z: f32) -> (f32, f32) {
    // Beyond this, e^2 would be a subnormal number, slow on many processors; ln(1 + exp(-43)) / beta is 2e-21.
    const FLOOR: f32 = -43.0;
    let exponent = -SHARPNESS as f32 * z.abs();
    let e = exp_of_negative(if exponent < FLOOR { FLOOR } else { exponent });
    // Comparisons that let a NaN through, as in `exp_of_negative`.
    let rectified = if z < 0.0 { 0.0 } else { z };
    (ln_one_plus(e).mul_add(1.0 / SHARPNESS as f32, rectified), e)
}

#[inline(always)]
fn softplus_f32(z: f32) -> (f32, f32) {
    let (value, e) = softplus_and_decay(z);
    let reciprocal = 1.0 / (1.0 + e);
    (value, if z > 0.0 { reciprocal } else { e * reciprocal })
}

/// The elementwise functions that f32 and f64 compute differently.
pub trait Elementwise: Sized {
    /// softplus(z) and its slope.
    fn softplus(z: Self) -> (Self, Self);
    /// softplus(z) alone.
    fn softplus_value(z: Self) -> Self;
    /// exp(x) for x <= 0.
    fn exp_negative(x: Self) -> Self;
}

impl Elementwise for f32 {
    #[inline(always)]
    fn softplus(z: Self) -> (Self, Self) {
        softplus_f32(z)
    }
    #[inline(always)]
    fn softplus_value(z: Self) -> Self {
        softplus_and_decay(z).0
    }
    #[inline(always)]
    fn exp_negative(x: Self) -> Self {
        exp_of_negative(x)
    }
}

impl Elementwise for f64 {
    #[inline(always)]
    fn softplus(z: Self) -> (Self, Self) {
        // Linear beyond beta z = 20, as in PyTorch: a difference of 2e-11 that f32 cannot express.
        if SHARPNESS * z > 20.0 {
            return (z, 1.0);
        }
        let e = (-SHARPNESS * z.abs()).exp();
        (z.max(0.0) + e.ln_1p() / SHARPNESS, if z > 0.0 { 1.0 / (1.0 + e) } else { e / (1.0 + e) })
    }
    #[inline(always)]
    fn softplus_value(z: Self) -> Self {
        Self::softplus(z).0
    }
    #[inline(always)]
    fn exp_negative(x: Self) -> Self {
        x.exp()
    }
}

/// Replaces each pre-activation row of `values` (`width` of every `stride` entries) by softplus(row + bias); writes the slopes (R, width).
pub(crate) fn softplus_rows<T: Real>(values: &mut [T], stride: usize, bias: &[T], slopes: &mut [T]) {
    let width = bias.len();
    vectorised(
        #[inline(always)]
        || {
            for (row, slope_row) in values.chunks_mut(stride).zip(slopes.chunks_exact_mut(width)) {
                for ((value, slope), bias) in row[..width].iter_mut().zip(slope_row).zip(bias) {
                    (*value, *slope) = T::softplus(*value + *bias);
                }
            }
        },
    );
}

/// As [`softplus_rows`], without the slopes.
pub(crate) fn softplus_value_rows<T: Real>(values: &mut [T], stride: usize, bias: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for row in values.chunks_mut(stride) {
                for (value, bias) in row.iter_mut().zip(bias) {
                    *value = T::softplus_value(*value + *bias);
                }
            }
        },
    );
}

/// row *= factor row, entry by entry; rows of `values` are `stride` apart.
pub(crate) fn scale_rows<T: Real>(values: &mut [T], stride: usize, factors: &[T], width: usize) {
    vectorised(
        #[inline(always)]
        || {
            for (row, factor_row) in values.chunks_mut(stride).zip(factors.chunks_exact(width)) {
                for (value, factor) in row[..width].iter_mut().zip(factor_row) {
                    *value *= *factor;
                }
            }
        },
    );
}

/// The up sweep's pass: curvature = beta (1 - s) u p and tangent = s p, for p given in `tangents` (rows `stride` apart).
pub(crate) fn curvature_rows<T: Real>(
    tangents: &mut [T],
    stride: usize,
    slopes: &[T],
    cotangents: &[T],
    curvature: &mut [T],
    width: usize,
) {
    let beta = T::of(SHARPNESS);
    vectorised(
        #[inline(always)]
        || {
            let rows = slopes.chunks_exact(width).zip(cotangents.chunks_exact(width));
            for ((row, (slope_row, cotangent_row)), curvature_row) in
                tangents.chunks_mut(stride).zip(rows).zip(curvature.chunks_exact_mut(width))
            {
                for (((tangent, slope), cotangent), curvature) in
                    row[..width].iter_mut().zip(slope_row).zip(cotangent_row).zip(curvature_row)
                {
                    *curvature = beta * (T::one() - *slope) * *cotangent * *tangent;
                    *tangent *= *slope;
                }
            }
        },
    );
}

/// result = s * values, entry by entry (all (R, width)).
pub(crate) fn write_scaled<T: Real>(result: &mut [T], slopes: &[T], values: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for ((result, slope), value) in result.iter_mut().zip(slopes).zip(values) {
                *result = *slope * *value;
            }
        },
    );
}

/// result += s * values, entry by entry (all (R, width)).
pub(crate) fn add_scaled<T: Real>(result: &mut [T], slopes: &[T], values: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for ((result, slope), value) in result.iter_mut().zip(slopes).zip(values) {
                *result += *slope * *value;
            }
        },
    );
}

/// result += beta (1 - s) * tangents * values; `tangents` rows are `stride` apart, the others (R, width).
pub(crate) fn add_curvature<T: Real>(
    result: &mut [T],
    slopes: &[T],
    tangents: &[T],
    stride: usize,
    values: &[T],
    width: usize,
) {
    let beta = T::of(SHARPNESS);
    vectorised(
        #[inline(always)]
        || {
            let rows = slopes.chunks_exact(width).zip(values.chunks_exact(width));
            for ((result_row, (slope_row, value_row)), tangent_row) in
                result.chunks_exact_mut(width).zip(rows).zip(tangents.chunks(stride))
            {
                for (((result, slope), value), tangent) in
                    result_row.iter_mut().zip(slope_row).zip(value_row).zip(&tangent_row[..width])
                {
                    *result += beta * (T::one() - *slope) * *tangent * *value;
                }
            }
        },
    );
}

/// Adds the sum of the rows of `values` (R, width) to `sums`.
pub(crate) fn add_column_sums<T: Real>(sums: &mut [T], values: &[T]) {
    let width = sums.len();
    vectorised(
        #[inline(always)]
        || {
            for row in values.chunks_exact(width) {
                for (sum, value) in sums.iter_mut().zip(row) {
                    *sum += *value;
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    // The f32 polynomials against f64's exp and ln_1p, over the range where softplus bends and far outside it.
    #[test]
    fn single_precision_softplus_agrees_with_double() {
        let mut worst = (0.0f64, 0.0f64);
        for step in -200_000..200_000 {
            let z = step as f32 * 5e-6;
            let (value, slope) = f32::softplus(z);
            let (exact_value, exact_slope) = f64::softplus(f64::from(z));
            worst.0 = worst.0.max((f64::from(value) - exact_value).abs() - 6e-8 * exact_value);
            worst.1 = worst.1.max((f64::from(slope) - exact_slope).abs());
        }
        assert!(worst.0 < 2e-8, "value error {}", worst.0);
        assert!(worst.1 < 1e-6, "slope error {}", worst.1);
        for z in [-1e30f32, -100.0, 100.0, 1e30] {
            let (value, slope) = f32::softplus(z);
            assert!((value - z.max(0.0)).abs() < 1e-20);
            assert!((slope - f32::from(z > 0.0)).abs() < 1e-18);
        }
    }

    // A NaN must reach the loss, where it is refused; a softplus of zero would hide it.
    #[test]
    fn a_nan_stays_a_nan() {
        let (value, slope) = f32::softplus(f32::NAN);
        assert!(value.is_nan() && slope.is_nan());
        assert!(f32::exp_negative(f32::NAN).is_nan());
    }

    // Vectorised code must be the scalar code: the same rows through both give the same numbers up to fused rounding.
    #[test]
    fn vectorised_rows_equal_the_scalar_function() {
        let bias: Vec<f32> = (0..37).map(|i| (i as f32 - 18.0) * 1e-3).collect();
        let start: Vec<f32> = (0..5 * 40).map(|i| ((i * 7919) % 400) as f32 * 1e-3 - 0.2).collect();
        let mut values = start.clone();
        let mut slopes = vec![0.0; 5 * 37];
        softplus_rows(&mut values, 40, &bias, &mut slopes);
        let mut alone = start.clone();
        softplus_value_rows(&mut alone, 40, &bias);
        assert_eq!(alone, values);
        for row in 0..5 {
            for column in 0..37 {
                let (value, slope) = softplus_f32(start[row * 40 + column] + bias[column]);
                assert!((values[row * 40 + column] - value).abs() <= 1e-7 * value.abs().max(0.1));
                assert!((slopes[row * 37 + column] - slope).abs() <= 1e-6);
            }
            assert_eq!(values[row * 40 + 37..row * 40 + 40], start[row * 40 + 37..row * 40 + 40]);
        }
    }

    #[test]
    fn exponential_of_negative_numbers() {
        for step in 0..80_000 {
            let x = -(step as f32) * 1e-3;
            let exact = f64::from(x).exp();
            assert!((f64::from(f32::exp_negative(x)) - exact).abs() < 3e-7 * exact);
        }
        assert!(f32::exp_negative(-1e9) < 1e-37);
    }
}
