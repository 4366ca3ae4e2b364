//! The passes of a hash grid that read or write its table, for one level: eight corners of each row's cell.
//!
//! Weights and slopes are computed for eight rows side by side, then each row's entries are visited. F features an entry.

use super::cells::{LANES, Lanes, LevelCells};
use crate::Real;
use xavatar_vector::vectorised;

/// Groups between a visit and the prefetch of its entries.
const AHEAD: usize = 1;

/// result = sum_k weight_k table_k, F of every `stride` entries.
pub(super) fn interpolate<T: Real, const F: usize>(
    table: &[T],
    cells: LevelCells<T>,
    weights: impl Fn(usize, &[Lanes<T>; 3]) -> [Lanes<T>; 8],
    result: &mut [T],
    stride: usize,
) {
    let entries = table.as_chunks::<F>().0;
    vectorised(
        #[inline(always)]
        || {
            let groups = cells.corners.iter().zip(cells.places).zip(result.chunks_mut(LANES * stride));
            for (group, ((corners, places), result)) in groups.enumerate() {
                prefetch(entries, cells.corners, group + AHEAD);
                let weights = weights(group, places);
                for (lane, result) in result.chunks_mut(stride).enumerate() {
                    let mut sum = [T::zero(); F];
                    for corner in 0..8 {
                        let entry = &entries[corners[corner][lane] as usize];
                        for (sum, value) in sum.iter_mut().zip(entry) {
                            *sum = weights[corner][lane].mul_add(*value, *sum);
                        }
                    }
                    result[..F].copy_from_slice(&sum);
                }
            }
        },
    );
}

/// table_k += weight_k cotangent.
pub(super) fn scatter<T: Real, const F: usize>(
    table: &mut [T],
    cells: LevelCells<T>,
    weights: impl Fn(usize, &[Lanes<T>; 3]) -> [Lanes<T>; 8],
    cotangents: &[T],
    stride: usize,
) {
    let entries = table.as_chunks_mut::<F>().0;
    vectorised(
        #[inline(always)]
        || {
            let groups = cells.corners.iter().zip(cells.places).zip(cotangents.chunks(LANES * stride));
            for (group, ((corners, places), cotangents)) in groups.enumerate() {
                prefetch(entries, cells.corners, group + AHEAD);
                let weights = weights(group, places);
                for (lane, cotangent) in cotangents.chunks(stride).enumerate() {
                    let cotangent: [T; F] = std::array::from_fn(|feature| cotangent[feature]);
                    if cotangent.iter().all(|value| *value == T::zero()) {
                        continue;
                    }
                    for corner in 0..8 {
                        let entry = &mut entries[corners[corner][lane] as usize];
                        for (sum, cotangent) in entry.iter_mut().zip(cotangent) {
                            *sum = weights[corner][lane].mul_add(cotangent, *sum);
                        }
                    }
                }
            }
        },
    );
}

/// Adds scale d/dt of c . sum_k w_k(t) table_k to `sums` (G), by `slope` of the products q_k = c . table_k.
pub(super) fn contract<T: Real, const F: usize>(
    table: &[T],
    cells: LevelCells<T>,
    cotangents: &[T],
    stride: usize,
    slope: impl Fn(usize, usize, [T; 3], &[T; 8]) -> [T; 3],
    sums: &mut [[Lanes<T>; 3]],
) {
    let entries = table.as_chunks::<F>().0;
    vectorised(
        #[inline(always)]
        || {
            let groups = cells.corners.iter().zip(cells.places).zip(cotangents.chunks(LANES * stride)).zip(sums);
            for (group, (((corners, places), cotangents), sums)) in groups.enumerate() {
                prefetch(entries, cells.corners, group + AHEAD);
                let mut products = [[T::zero(); LANES]; 8];
                for (lane, cotangent) in cotangents.chunks(stride).enumerate() {
                    let cotangent: [T; F] = std::array::from_fn(|feature| cotangent[feature]);
                    for corner in 0..8 {
                        let entry = &entries[corners[corner][lane] as usize];
                        let mut product = T::zero();
                        for (value, cotangent) in entry.iter().zip(cotangent) {
                            product = value.mul_add(cotangent, product);
                        }
                        products[corner][lane] = product;
                    }
                }
                for lane in 0..LANES {
                    let place = [places[0][lane], places[1][lane], places[2][lane]];
                    let mut corners = [T::zero(); 8];
                    for (corner, products) in corners.iter_mut().zip(&products) {
                        *corner = products[lane];
                    }
                    let slope = slope(group, lane, place, &corners);
                    for axis in 0..3 {
                        sums[axis][lane] += slope[axis];
                    }
                }
            }
        },
    );
}

/// Asks for the entries of a group that will be visited soon: the processor does not look ahead far enough by itself.
#[inline(always)]
fn prefetch<E>(entries: &[E], groups: &[[Lanes<u32>; 8]], group: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(corners) = groups.get(group) {
        for entries_of_corner in corners {
            for entry in *entries_of_corner {
                let address = entries.as_ptr().wrapping_add(entry as usize);
                // SAFETY: a hint, which reads nothing and cannot fault whatever the address.
                unsafe { std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(address.cast()) };
            }
        }
    }
}
