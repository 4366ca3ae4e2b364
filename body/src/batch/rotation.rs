//! Rotations of joints and their derivatives, by hand, for f32 and f64.
//!
//! R(r) = I + a K + b K^2 with K the cross-product matrix of the axis-angle r, a = sin x / x, b = (1 - cos x) / x^2, x = |r|;
//! q(r) = (s r, cos(x / 2)) with s = sin(x / 2) / x, in the order x y z w. Values and derivatives are finite at rest, where the quotients are
//! their series. Matrices are row-major; radians.

use xavatar_vector::Scalar;

/// A 3 x 3 matrix, row by row.
pub(super) type Matrix3<T> = [T; 9];

/// Below this x^2, quotients whose numerators cancel are series; with [`TERMS`] terms they are exact in f64.
const SERIES_BELOW: f64 = 0.25;
const TERMS: usize = 8;

/// R(r).
pub(super) fn rotation_matrix<T: Scalar>(r: [T; 3]) -> Matrix3<T> {
    let squared = dot(r, r);
    let (a, b) = (sine_quotient(squared), cosine_quotient(squared));
    let [x, y, z] = r;
    let diagonal = |axis: T| T::one() + b * (axis * axis - squared);
    [
        diagonal(x),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        diagonal(y),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        diagonal(z),
    ]
}

/// The cotangent of r, given that of R(r): Jr^T vee(R^T dR), Jr the right Jacobian of the exponential map.
pub(super) fn rotation_pullback<T: Scalar>(r: [T; 3], rotation: &Matrix3<T>, cotangent: &Matrix3<T>) -> [T; 3] {
    let w = transposed_product(rotation, cotangent);
    let turn = [w[7] - w[5], w[2] - w[6], w[3] - w[1]];
    let squared = dot(r, r);
    let (b, c) = (cosine_quotient(squared), sine_defect(squared));
    let once = cross(r, turn);
    let twice = cross(r, once);
    [0, 1, 2].map(|axis| turn[axis] + b * once[axis] + c * twice[axis])
}

/// q(r), unit, x y z w.
pub(super) fn quaternion<T: Scalar>(r: [T; 3]) -> [T; 4] {
    let squared = dot(r, r);
    let s = half_sine_quotient(squared);
    [r[0] * s, r[1] * s, r[2] * s, (squared.sqrt() / T::of(2.0)).cos()]
}

/// The cotangent of r, given that of q(r).
pub(super) fn quaternion_pullback<T: Scalar>(r: [T; 3], cotangent: [T; 4]) -> [T; 3] {
    let squared = dot(r, r);
    let s = half_sine_quotient(squared);
    let [x, y, z, w] = cotangent;
    // d cos(x / 2) = -(s / 2) r . dr
    let along = half_sine_slope(squared) * dot(r, [x, y, z]) - s / T::of(2.0) * w;
    [s * x + along * r[0], s * y + along * r[1], s * z + along * r[2]]
}

/// sin x / x.
fn sine_quotient<T: Scalar>(squared: T) -> T {
    let x = squared.sqrt();
    if squared < T::of(1e-8) { T::one() - squared / T::of(6.0) } else { x.sin() / x }
}

/// (1 - cos x) / x^2, without cancellation.
fn cosine_quotient<T: Scalar>(squared: T) -> T {
    let half = sine_quotient(squared / T::of(4.0));
    half * half / T::of(2.0)
}

/// sin(x / 2) / x.
fn half_sine_quotient<T: Scalar>(squared: T) -> T {
    sine_quotient(squared / T::of(4.0)) / T::of(2.0)
}

/// (x - sin x) / x^3.
fn sine_defect<T: Scalar>(squared: T) -> T {
    if squared < T::of(SERIES_BELOW) {
        return series(1.0 / 6.0, squared, |k| 1.0 / ((2.0 * k + 2.0) * (2.0 * k + 3.0)));
    }
    let x = squared.sqrt();
    (x - x.sin()) / (squared * x)
}

/// The derivative of sin(x / 2) / x, over x.
fn half_sine_slope<T: Scalar>(squared: T) -> T {
    if squared < T::of(SERIES_BELOW) {
        return series(-1.0 / 24.0, squared, |k| (k + 1.0) / k / (4.0 * (2.0 * k + 2.0) * (2.0 * k + 3.0)));
    }
    let x = squared.sqrt();
    let half = x / T::of(2.0);
    (half * half.cos() - half.sin()) / (squared * x)
}

/// The alternating series in x^2 from `first`, whose term k is term k - 1 times `ratio(k)` x^2, negated.
fn series<T: Scalar>(first: f64, squared: T, ratio: impl Fn(f64) -> f64) -> T {
    let mut term = T::of(first);
    let mut sum = term;
    for k in 1..TERMS {
        term = -term * squared * T::of(ratio(k as f64));
        sum += term;
    }
    sum
}

pub(super) fn dot<T: Scalar>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A B.
pub(super) fn matrix_product<T: Scalar>(a: &Matrix3<T>, b: &Matrix3<T>) -> Matrix3<T> {
    std::array::from_fn(|at| {
        let (row, column) = (at / 3 * 3, at % 3);
        a[row] * b[column] + a[row + 1] * b[column + 3] + a[row + 2] * b[column + 6]
    })
}

/// A^T B.
pub(super) fn transposed_product<T: Scalar>(a: &Matrix3<T>, b: &Matrix3<T>) -> Matrix3<T> {
    std::array::from_fn(|at| {
        let (row, column) = (at / 3, at % 3);
        a[row] * b[column] + a[row + 3] * b[column + 3] + a[row + 6] * b[column + 6]
    })
}

/// A B^T.
pub(super) fn product_transposed<T: Scalar>(a: &Matrix3<T>, b: &Matrix3<T>) -> Matrix3<T> {
    std::array::from_fn(|at| {
        let (row, column) = (at / 3 * 3, at % 3 * 3);
        a[row] * b[column] + a[row + 1] * b[column + 1] + a[row + 2] * b[column + 2]
    })
}

/// A v.
pub(super) fn turned<T: Scalar>(a: &Matrix3<T>, v: [T; 3]) -> [T; 3] {
    [0, 3, 6].map(|row| a[row] * v[0] + a[row + 1] * v[1] + a[row + 2] * v[2])
}

/// A^T v.
pub(super) fn turned_back<T: Scalar>(a: &Matrix3<T>, v: [T; 3]) -> [T; 3] {
    [0, 1, 2].map(|column| a[column] * v[0] + a[column + 3] * v[1] + a[column + 6] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Axis-angles from rest to beyond a half turn, on both sides of every threshold.
    const TURNS: [[f64; 3]; 8] = [
        [0.0, 0.0, 0.0],
        [1e-9, -2e-9, 1e-9],
        [5e-5, 1e-4, -3e-5],
        [0.02, -0.01, 0.03],
        [0.3, 0.3, -0.26],
        [0.4, -0.2, 0.25],
        [1.7, 2.0, -1.6],
        [-2.9, 1.1, 2.3],
    ];

    /// The gradient of `value` at r by central differences.
    fn differences(r: [f64; 3], value: impl Fn([f64; 3]) -> f64) -> [f64; 3] {
        const STEP: f64 = 1e-5;
        [0, 1, 2].map(|axis| {
            let at = |sign: f64| {
                let mut moved = r;
                moved[axis] += sign * STEP;
                value(moved)
            };
            (at(1.0) - at(-1.0)) / (2.0 * STEP)
        })
    }

    #[test]
    fn pullbacks_are_the_differences_of_their_functions() {
        let of_matrix: Matrix3<f64> = std::array::from_fn(|at| ((at * 7 + 3) % 11) as f64 / 5.0 - 1.0);
        let of_quaternion = [0.7, -1.1, 0.4, 0.9];
        for r in TURNS {
            let matrix =
                |r| rotation_matrix(r).iter().zip(&of_matrix).map(|(entry, weight)| entry * weight).sum::<f64>();
            let found = rotation_pullback(r, &rotation_matrix(r), &of_matrix);
            let entries =
                |r| quaternion(r).iter().zip(&of_quaternion).map(|(entry, weight)| entry * weight).sum::<f64>();
            let of_entries = quaternion_pullback(r, of_quaternion);
            for (found, expected) in [(found, differences(r, matrix)), (of_entries, differences(r, entries))] {
                for axis in 0..3 {
                    assert!((found[axis] - expected[axis]).abs() < 1e-8, "{r:?}: {found:?} {expected:?}");
                }
            }
        }
    }

    #[test]
    fn single_precision_agrees_with_double() {
        for r in TURNS {
            let single = r.map(|component| component as f32);
            let double = single.map(f64::from);
            let close = |single: &[f32], double: &[f64]| {
                single.iter().zip(double).all(|(s, d)| (f64::from(*s) - d).abs() < 2e-6)
            };
            assert!(close(&rotation_matrix(single), &rotation_matrix(double)), "{r:?}");
            assert!(close(&quaternion(single), &quaternion(double)), "{r:?}");
            let cotangent = [0.5, -0.25, 1.0, 0.0, 0.75, -1.0, 0.5, 0.25, -0.5];
            let found = rotation_pullback(single, &rotation_matrix(single), &cotangent);
            let expected = rotation_pullback(double, &rotation_matrix(double), &cotangent.map(f64::from));
            assert!(close(&found, &expected), "{r:?}: {found:?} {expected:?}");
        }
    }
}
