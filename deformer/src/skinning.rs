//! Forward linear blend skinning and its derivatives (thesis ch. 4.2.2): x_d = sum_j w_j(x_c) B_j x_c.
//!
//! With A = sum_j w_j B_j and G_k = sum_j (dw_j / dx_k) B_j, 3 x 4 each, and x~ = (x_c, 1):
//! x_d = A x~, and column k of J = dx_d/dx_c is A's column k + G_k x~.
//! N points, J bones, k an axis; weights (N, J), their gradients (N, 3, J) as fields give them. Metres.
//! Cotangents, named `*_cotangents`, are added to: zero them first. Kernels are serial; callers work in row blocks.

use pulp::Arch;
use xavatar_network::Real;

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
    let rows = gradients.chunks_exact(3 * bones.len());
    for (((jacobian, transform), &point), rows) in jacobians.iter_mut().zip(transforms).zip(points).zip(rows) {
        let mut slopes = [[T::zero(); 12]; 3];
        blend(rows, bones, &mut slopes);
        *jacobian = jacobian_from_slopes(transform, &slopes, point);
    }
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
        let mut slopes = [[T::zero(); 12]; 3];
        blend(rows, bones, &mut slopes);
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
    let moved = slopes.map(|slope| apply(&slope, point));
    std::array::from_fn(|r| std::array::from_fn(|c| transform[4 * r + c] + moved[c][r]))
}

/// weights (N, J) x bones (J, 12), summed in the order of the bones whatever the machine's vectors.
pub(crate) fn blend<T: Real>(weights: &[T], bones: &[BoneTransform<T>], transforms: &mut [BoneTransform<T>]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            let joints = bones.len();
            let mut tiles = transforms.chunks_exact_mut(TILE);
            let mut tile_weights = weights.chunks_exact(TILE * joints);
            for (tile, weights) in tiles.by_ref().zip(tile_weights.by_ref()) {
                let mut sums = [[T::zero(); 12]; TILE];
                for (joint, bone) in bones.iter().enumerate() {
                    for (row, sum) in sums.iter_mut().enumerate() {
                        add_scaled(sum, weights[row * joints + joint], bone);
                    }
                }
                tile.copy_from_slice(&sums);
            }
            let rest = tile_weights.remainder().chunks_exact(joints);
            for (transform, weights) in tiles.into_remainder().iter_mut().zip(rest) {
                *transform = [T::zero(); 12];
                for (&weight, bone) in weights.iter().zip(bones) {
                    add_scaled(transform, weight, bone);
                }
            }
        },
    );
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
