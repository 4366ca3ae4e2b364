//! Trilinear interpolation in one cell, and its first and second derivatives.
//!
//! Corner k = x + 2 y + 4 z (each 0 or 1) has weight w_k(t) = a_x b_y c_z with a = [1 - t_x, t_x] and so on, t in [0, 1]^3.
//! Values q_k at the corners interpolate to sum_k w_k q_k: linear in each coordinate, so only mixed second derivatives remain.

use crate::Real;

/// w_k(t).
#[inline(always)]
pub(super) fn weights<T: Real>([x, y, z]: [T; 3]) -> [T; 8] {
    let yz = bilinear(y, z);
    let x0 = T::one() - x;
    [x0 * yz[0], x * yz[0], x0 * yz[1], x * yz[1], x0 * yz[2], x * yz[2], x0 * yz[3], x * yz[3]]
}

/// v . dw_k/dt.
#[inline(always)]
pub(super) fn weight_slopes<T: Real>([x, y, z]: [T; 3], [along_x, along_y, along_z]: [T; 3]) -> [T; 8] {
    let (x0, y0, z0) = (T::one() - x, T::one() - y, T::one() - z);
    let yz = bilinear(y, z);
    // v . d(b_y c_z)/dt for the four edges along x.
    let slope = [
        -(along_y * z0 + along_z * y0),
        along_y * z0 - along_z * y,
        along_z * y0 - along_y * z,
        along_y * z + along_z * y,
    ];
    let mut slopes = [T::zero(); 8];
    for edge in 0..4 {
        let along = along_x * yz[edge];
        slopes[2 * edge] = x0 * slope[edge] - along;
        slopes[2 * edge + 1] = x * slope[edge] + along;
    }
    slopes
}

/// d/dt of sum_k w_k q_k.
#[inline(always)]
pub(super) fn gradient<T: Real>([x, y, z]: [T; 3], corners: &[T; 8]) -> [T; 3] {
    let yz = bilinear(y, z);
    let (mut rise, mut middle) = ([T::zero(); 4], [T::zero(); 4]);
    for edge in 0..4 {
        rise[edge] = corners[2 * edge + 1] - corners[2 * edge];
        middle[edge] = corners[2 * edge] + x * rise[edge];
    }
    let along_x = yz[0] * rise[0] + yz[1] * rise[1] + yz[2] * rise[2] + yz[3] * rise[3];
    let (low, high) = (middle[1] - middle[0], middle[3] - middle[2]);
    let along_z = (middle[2] + y * high) - (middle[0] + y * low);
    [along_x, low + z * (high - low), along_z]
}

/// The second derivative of sum_k w_k q_k times v: d/dt (v . d/dt).
#[inline(always)]
pub(super) fn curvature<T: Real>([x, y, z]: [T; 3], corners: &[T; 8], along: [T; 3]) -> [T; 3] {
    let (mut rise, mut middle) = ([T::zero(); 4], [T::zero(); 4]);
    for edge in 0..4 {
        rise[edge] = corners[2 * edge + 1] - corners[2 * edge];
        middle[edge] = corners[2 * edge] + x * rise[edge];
    }
    let (low, high) = (rise[1] - rise[0], rise[3] - rise[2]);
    let xy = low + z * (high - low);
    let xz = (rise[2] + y * high) - (rise[0] + y * low);
    let yz = (middle[3] - middle[2]) - (middle[1] - middle[0]);
    [xy * along[1] + xz * along[2], xy * along[0] + yz * along[2], xz * along[0] + yz * along[1]]
}

/// b_y c_z of the edges (y, z) = 00, 10, 01, 11.
#[inline(always)]
fn bilinear<T: Real>(y: T, z: T) -> [T; 4] {
    let (y0, z0) = (T::one() - y, T::one() - z);
    [y0 * z0, y * z0, y0 * z, y * z]
}
