//! Forward linear blend skinning and its derivatives (thesis ch. 4.2.2): x_d = sum_j w_j(x_c) B_j x_c.
//!
//! With A = sum_j w_j B_j and G_k = sum_j (dw_j / dx_k) B_j, 3 x 4 each, and x~ = (x_c, 1):
//! x_d = A x~, and column k of J = dx_d/dx_c is A's column k + G_k x~.
//! N points, J bones, k an axis; weights (N, J), their gradients (N, 3, J) as fields give them. Metres.
//! Cotangents, named `*_cotangents`, are added to: zero them first. Kernels are serial; callers work in row blocks.

use xavatar_network::Real;
use xavatar_vector::vectorised;

use crate::affine::apply;
use crate::error::{expect_length, expect_weights};
use crate::{BoneTransform, Jacobian, Result};

/// Rows that one pass over the bones serves: enough independent sums to hide the latency of an addition.
const TILE: usize = 4;

/// The blended transform A of each point (N).
///
/// # Errors
/// If `weights` is not (N, J); give every point one weight per bone.
pub fn blend_transforms<T: Real>(
    weights: &[T],
    bones: &[BoneTransform<T>],
    transforms: &mut [BoneTransform<T>],
) -> Result<()> {
    expect_weights("skinning weights", weights.len(), transforms.len(), bones.len())?;
    blend(weights, bones, transforms);
    Ok(())
}

/// The deformed points x_d = A x~ (N).
///
/// # Errors
/// If the batches differ in length.
pub fn deform<T: Real>(transforms: &[BoneTransform<T>], points: &[[T; 3]], deformed: &mut [[T; 3]]) -> Result<()> {
    expect_length("blended transforms", transforms.len(), points.len())?;
    expect_length("deformed points", deformed.len(), points.len())?;
    for ((deformed, transform), &point) in deformed.iter_mut().zip(transforms).zip(points) {
        *deformed = apply(transform, point);
    }
    Ok(())
}

/// The full Jacobians J = dx_d/dx_c (N), from the blended transforms (N) and the weights' gradients (N, 3, J).
///
/// # Errors
/// If the batches differ in length.
pub fn skinning_jacobians<T: Real>(
    transforms: &[BoneTransform<T>],
    gradients: &[T],
    bones: &[BoneTransform<T>],
    points: &[[T; 3]],
    jacobians: &mut [Jacobian<T>],
) -> Result<()> {
    expect_length("blended transforms", transforms.len(), points.len())?;
    expect_weights("weight gradients", gradients.len(), 3 * points.len(), bones.len())?;
    expect_length("Jacobians", jacobians.len(), points.len())?;
    blend_jacobians(transforms, gradients, bones, points, jacobians);
    Ok(())
}

/// Pulls cotangents of x_d (N) back to the weights (N, J) and, with the weights held, to x_c (N).
///
/// # Errors
/// If the batches differ in length.
pub fn deform_backward<T: Real>(
    transforms: &[BoneTransform<T>],
    bones: &[BoneTransform<T>],
    points: &[[T; 3]],
    deformed_cotangents: &[[T; 3]],
    weight_cotangents: &mut [T],
    point_cotangents: &mut [[T; 3]],
) -> Result<()> {
    expect_length("blended transforms", transforms.len(), points.len())?;
    expect_length("cotangents of deformed points", deformed_cotangents.len(), points.len())?;
    expect_weights("cotangents of weights", weight_cotangents.len(), points.len(), bones.len())?;
    expect_length("cotangents of points", point_cotangents.len(), points.len())?;
    let rows = weight_cotangents.chunks_exact_mut(bones.len());
    let batch = transforms.iter().zip(points).zip(deformed_cotangents).zip(rows).zip(point_cotangents);
    for ((((transform, &point), &cotangent), weight_cotangents), point_cotangent) in batch {
        project(&outer(cotangent, point), bones, weight_cotangents);
        for (c, value) in point_cotangent.iter_mut().enumerate() {
            *value += (0..3).map(|r| transform[4 * r + c] * cotangent[r]).sum();
        }
    }
    Ok(())
}

/// Pulls cotangents of J (N) back to the weights (N, J), their gradients (N, 3, J) and, with both held, to x_c (N).
///
/// # Errors
/// If the batches differ in length.
pub fn jacobians_backward<T: Real>(
    gradients: &[T],
    bones: &[BoneTransform<T>],
    points: &[[T; 3]],
    jacobian_cotangents: &[Jacobian<T>],
    weight_cotangents: &mut [T],
    gradient_cotangents: &mut [T],
    point_cotangents: &mut [[T; 3]],
) -> Result<()> {
    let (points_len, bones_len) = (points.len(), bones.len());
    expect_weights("weight gradients", gradients.len(), 3 * points_len, bones_len)?;
    expect_length("cotangents of Jacobians", jacobian_cotangents.len(), points_len)?;
    expect_weights("cotangents of weights", weight_cotangents.len(), points_len, bones_len)?;
    expect_length("cotangents of weight gradients", gradient_cotangents.len(), gradients.len())?;
    expect_length("cotangents of points", point_cotangents.len(), points_len)?;
    let rows = gradients.chunks_exact(3 * bones_len);
    let row_cotangents = gradient_cotangents.chunks_exact_mut(3 * bones_len);
    let weight_rows = weight_cotangents.chunks_exact_mut(bones_len);
    let batch = points.iter().zip(jacobian_cotangents).zip(rows).zip(row_cotangents).zip(weight_rows);
    for (((((&point, cotangent), rows), row_cotangents), weight_cotangents), point_cotangent) in
        batch.zip(point_cotangents)
    {
        let slopes = blend_rows::<T, 3>(rows, bones);
        let [x, y, z] = *cotangent;
        let zero = T::zero();
        let blended = [x[0], x[1], x[2], zero, y[0], y[1], y[2], zero, z[0], z[1], z[2], zero];
        project(&blended, bones, weight_cotangents);
        for (axis, row) in row_cotangents.chunks_exact_mut(bones_len).enumerate() {
            let column = [x[axis], y[axis], z[axis]];
            project(&outer(column, point), bones, row);
            for (c, value) in point_cotangent.iter_mut().enumerate() {
                *value += (0..3).map(|r| slopes[axis][4 * r + c] * column[r]).sum();
            }
        }
    }
    Ok(())
}

/// J from A, the slopes G_k and x_c.
#[inline(always)]
pub(crate) fn jacobian_from_slopes<T: Real>(
    transform: &BoneTransform<T>,
    slopes: &[BoneTransform<T>; 3],
    point: [T; 3],
) -> Jacobian<T> {
    let [x, y, z] = [apply(&slopes[0], point), apply(&slopes[1], point), apply(&slopes[2], point)];
    std::array::from_fn(|r| [transform[4 * r] + x[r], transform[4 * r + 1] + y[r], transform[4 * r + 2] + z[r]])
}

/// weights (N, J) x bones (J, 12), summed in the order of the bones.
pub(crate) fn blend<T: Real>(weights: &[T], bones: &[BoneTransform<T>], transforms: &mut [BoneTransform<T>]) {
    vectorised(
        #[inline(always)]
        || {
            let joints = bones.len();
            let mut tiles = transforms.chunks_exact_mut(TILE);
            let mut tile_weights = weights.chunks_exact(TILE * joints);
            for (tile, weights) in tiles.by_ref().zip(tile_weights.by_ref()) {
                tile.copy_from_slice(&blend_rows::<T, TILE>(weights, bones));
            }
            let rest = tile_weights.remainder().chunks_exact(joints);
            for (transform, weights) in tiles.into_remainder().iter_mut().zip(rest) {
                [*transform] = blend_rows::<T, 1>(weights, bones);
            }
        },
    );
}

/// J of each point, from its A and its weights' gradients (3, J).
pub(crate) fn blend_jacobians<T: Real>(
    transforms: &[BoneTransform<T>],
    gradients: &[T],
    bones: &[BoneTransform<T>],
    points: &[[T; 3]],
    jacobians: &mut [Jacobian<T>],
) {
    vectorised(
        #[inline(always)]
        || {
            let rows = gradients.chunks_exact(3 * bones.len());
            for (((jacobian, transform), &point), rows) in jacobians.iter_mut().zip(transforms).zip(points).zip(rows) {
                *jacobian = jacobian_from_slopes(transform, &blend_rows::<T, 3>(rows, bones), point);
            }
        },
    );
}

/// `ROWS` rows of weights (ROWS, J) x bones (J, 12).
#[inline(always)]
fn blend_rows<T: Real, const ROWS: usize>(weights: &[T], bones: &[BoneTransform<T>]) -> [BoneTransform<T>; ROWS] {
    let mut sums = [[T::zero(); 12]; ROWS];
    for (joint, bone) in bones.iter().enumerate() {
        for (row, sum) in sums.iter_mut().enumerate() {
            add_scaled(sum, weights[row * bones.len() + joint], bone);
        }
    }
    sums
}

#[inline(always)]
fn add_scaled<T: Real>(sum: &mut BoneTransform<T>, weight: T, bone: &BoneTransform<T>) {
    for (sum, &value) in sum.iter_mut().zip(bone) {
        *sum += weight * value;
    }
}

/// Adds the inner product of a 3 x 4 cotangent with each bone to that bone's weight.
fn project<T: Real>(cotangent: &BoneTransform<T>, bones: &[BoneTransform<T>], weight_cotangents: &mut [T]) {
    for (value, bone) in weight_cotangents.iter_mut().zip(bones) {
        *value += cotangent.iter().zip(bone).map(|(&c, &b)| c * b).sum();
    }
}

/// v x~^T, 3 x 4.
fn outer<T: Real>(v: [T; 3], x: [T; 3]) -> BoneTransform<T> {
    std::array::from_fn(|index| {
        let (r, c) = (index / 4, index % 4);
        if c < 3 { v[r] * x[c] } else { v[r] }
    })
}

#[cfg(test)]
mod tests {
    use xavatar_network::SkinningWeights;

    use super::*;
    use crate::warp::softmax_field::{generator, numbers, posed, vectors};
    use crate::{Error, ExactWarp, Warp};

    const POINTS: usize = 7;
    const JOINTS: usize = 6;
    const STEP: f64 = 1e-5;

    /// (f(x + h) - f(x - h)) / 2h for every element of `x`.
    fn differences(x: &[f64], f: impl Fn(&[f64]) -> f64) -> Vec<f64> {
        let along = |index: usize| {
            let mut moved = x.to_vec();
            moved[index] += STEP;
            let above = f(&moved);
            moved[index] -= 2.0 * STEP;
            (above - f(&moved)) / (2.0 * STEP)
        };
        (0..x.len()).map(along).collect()
    }

    fn assert_close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
            assert!((found - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{index}: {found} != {expected}");
        }
    }

    fn grouped<const N: usize>(values: &[f64]) -> Vec<[f64; N]> {
        values.as_chunks::<N>().0.to_vec()
    }

    /// c . x_d + C . J as a function of weights (N, J), their gradients (N, 3, J) and points (N, 3), all free.
    fn objective(
        bones: &[BoneTransform<f64>],
        (weights, gradients, points): (&[f64], &[f64], &[f64]),
        (deformed_cotangents, jacobian_cotangents): (&[f64], &[f64]),
    ) -> f64 {
        let points = grouped::<3>(points);
        let mut transforms = vec![[0.0; 12]; POINTS];
        let mut deformed = vec![[0.0; 3]; POINTS];
        let mut jacobians = vec![[[0.0; 3]; 3]; POINTS];
        blend_transforms(weights, bones, &mut transforms).unwrap();
        deform(&transforms, &points, &mut deformed).unwrap();
        skinning_jacobians(&transforms, gradients, bones, &points, &mut jacobians).unwrap();
        let jacobians = jacobians.as_flattened().as_flattened().iter().zip(jacobian_cotangents);
        deformed.as_flattened().iter().zip(deformed_cotangents).chain(jacobians).map(|(a, b)| a * b).sum()
    }

    // J = d/dx_c [sum_j w_j(x_c) B_j x_c], the weights' own dependence included
    #[test]
    fn jacobians_match_finite_differences_of_the_warp() {
        let (field, bones) = posed::<f64>(1, JOINTS, 1.0);
        let points: Vec<[f64; 3]> = vectors(&mut generator(2), POINTS, 0.7);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let mut workspace = Default::default();
        let (mut transforms, mut jacobians) = (vec![[0.0; 12]; POINTS], vec![[[0.0; 3]; 3]; POINTS]);
        warp.transforms_and_jacobians(&mut workspace, &points, &mut transforms, &mut jacobians);
        for (point, jacobian) in points.iter().zip(&jacobians) {
            for (r, row) in jacobian.iter().enumerate() {
                let expected = differences(point, |x| {
                    let (point, mut transform) = ([x[0], x[1], x[2]], [[0.0; 12]]);
                    warp.transforms(&mut Default::default(), &[point], &mut transform);
                    apply(&transform[0], point)[r]
                });
                assert_close(row, &expected);
            }
        }
        // The warp and the batch kernels are the same formula.
        let (mut weights, mut gradients) = (vec![0.0; POINTS * JOINTS], vec![0.0; 3 * POINTS * JOINTS]);
        field.weights_and_gradients(&mut (), &points, &mut weights, &mut gradients);
        let (mut blended, mut again) = (transforms.clone(), jacobians.clone());
        blend_transforms(&weights, &bones, &mut blended).unwrap();
        skinning_jacobians(&blended, &gradients, &bones, &points, &mut again).unwrap();
        assert_eq!((blended, again), (transforms, jacobians));
    }

    // d(c . x_d + C . J) / d(w, dw/dx, x_c) by the two backward passes, summed into the same cotangents
    #[test]
    fn backward_passes_match_finite_differences() {
        let (_, bones) = posed::<f64>(3, JOINTS, 1.0);
        let mut generator = generator(4);
        let weights = numbers(&mut generator, POINTS * JOINTS);
        let gradients = numbers(&mut generator, 3 * POINTS * JOINTS);
        let points = numbers(&mut generator, 3 * POINTS);
        let cotangents: (Vec<f64>, Vec<f64>) =
            (numbers(&mut generator, 3 * POINTS), numbers(&mut generator, 9 * POINTS));
        let both = (&cotangents.0[..], &cotangents.1[..]);

        let rows = grouped::<3>(&points);
        let mut transforms = vec![[0.0; 12]; POINTS];
        blend_transforms(&weights, &bones, &mut transforms).unwrap();
        let mut to_weights = vec![0.0; weights.len()];
        let mut to_gradients = vec![0.0; gradients.len()];
        let mut to_points = vec![[0.0; 3]; POINTS];
        let to_deformed = grouped::<3>(&cotangents.0);
        deform_backward(&transforms, &bones, &rows, &to_deformed, &mut to_weights, &mut to_points).unwrap();
        let to_jacobians: Vec<Jacobian<f64>> = grouped::<9>(&cotangents.1)
            .iter()
            .map(|c| [[c[0], c[1], c[2]], [c[3], c[4], c[5]], [c[6], c[7], c[8]]])
            .collect();
        jacobians_backward(
            &gradients,
            &bones,
            &rows,
            &to_jacobians,
            &mut to_weights,
            &mut to_gradients,
            &mut to_points,
        )
        .unwrap();

        assert_close(&to_weights, &differences(&weights, |w| objective(&bones, (w, &gradients, &points), both)));
        assert_close(&to_gradients, &differences(&gradients, |g| objective(&bones, (&weights, g, &points), both)));
        let expected = differences(&points, |x| objective(&bones, (&weights, &gradients, x), both));
        assert_close(to_points.as_flattened(), &expected);
    }

    #[test]
    fn a_row_of_a_tile_and_a_row_alone_blend_to_the_same_bits() {
        let (_, bones) = posed::<f32>(5, 55, 1.0);
        let weights: Vec<f32> = numbers(&mut generator(6), 11 * 55);
        let mut together = vec![[0.0; 12]; 11];
        blend_transforms(&weights, &bones, &mut together).unwrap();
        for (row, expected) in weights.chunks_exact(55).zip(&together) {
            let mut alone = [[0.0; 12]];
            blend_transforms(row, &bones, &mut alone).unwrap();
            assert_eq!(alone[0], *expected);
        }
    }

    #[test]
    fn batches_of_other_lengths_are_refused() {
        let bones = [[0.0_f64; 12]; 2];
        let mut out = [[0.0; 12]; 3];
        let error = blend_transforms(&[0.5; 5], &bones, &mut out).expect_err("five weights for three points");
        assert!(matches!(error, Error::Length { found: 5, expected: 6, .. }), "{error}");
        assert!(blend_transforms(&[], &[], &mut out).is_err());
        assert!(deform(&out, &[[0.0; 3]; 2], &mut [[0.0; 3]; 2]).is_err());
        assert!(skinning_jacobians(&out, &[0.0; 18], &bones, &[[0.0; 3]; 3], &mut [[[0.0; 3]; 3]; 2]).is_err());
    }
}
