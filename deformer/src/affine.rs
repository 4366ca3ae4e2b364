//! The small matrices of the deformer: bone transforms (3 x 4, row-major) and Jacobians (3 x 3, rows).
//!
//! A bone transform B maps canonical to posed space: B x = R x + t, in metres. Generic twins of what glam offers for f32.

use glam::Affine3A;
use xavatar_network::Real;

use crate::{Error, Result};

/// A row-major 3 x 4 matrix [R | t] that maps canonical to posed points.
pub type BoneTransform<T> = [T; 12];

/// A 3 x 3 matrix; `jacobian[r][c]` is the derivative of coordinate r of the deformed point along canonical axis c.
pub type Jacobian<T> = [[T; 3]; 3];

/// The row-major form of a glam transform.
pub fn bone_transform(transform: &Affine3A) -> BoneTransform<f32> {
    let [x, y, z] = transform.matrix3.transpose().to_cols_array_2d();
    let t = transform.translation;
    [x[0], x[1], x[2], t.x, y[0], y[1], y[2], t.y, z[0], z[1], z[2], t.z]
}

/// Refuses bone transforms that are absent or hold a NaN or an infinity.
pub(crate) fn expect_finite_bones<T: Real>(bones: &[BoneTransform<T>]) -> Result<()> {
    let found = match bones.iter().position(|bone| bone.iter().any(|value| !value.is_finite())) {
        Some(bone) => format!("{:?} at bone {bone}", bones[bone]),
        None if bones.is_empty() => "an empty list".to_owned(),
        None => return Ok(()),
    };
    Err(Error::Skeleton { name: "the frame's bone transforms", found, expected: "finite 3 x 4 matrices".to_owned() })
}

/// B x.
#[inline(always)]
pub(crate) fn apply<T: Real>(b: &BoneTransform<T>, x: [T; 3]) -> [T; 3] {
    [
        b[0] * x[0] + b[1] * x[1] + b[2] * x[2] + b[3],
        b[4] * x[0] + b[5] * x[1] + b[6] * x[2] + b[7],
        b[8] * x[0] + b[9] * x[1] + b[10] * x[2] + b[11],
    ]
}

/// R of B = [R | t].
#[inline(always)]
pub(crate) fn rotation<T: Real>(b: &BoneTransform<T>) -> Jacobian<T> {
    [[b[0], b[1], b[2]], [b[4], b[5], b[6]], [b[8], b[9], b[10]]]
}

/// B^-1, if R is far enough from singular.
pub(crate) fn inverse_transform<T: Real>(b: &BoneTransform<T>) -> Option<BoneTransform<T>> {
    let [x, y, z] = inverse(&rotation(b))?;
    let t = multiply(&[x, y, z], [b[3], b[7], b[11]]);
    Some([x[0], x[1], x[2], -t[0], y[0], y[1], y[2], -t[1], z[0], z[1], z[2], -t[2]])
}

/// M^-1; none if M is singular to working precision or not finite.
#[inline(always)]
pub(crate) fn inverse<T: Real>(m: &Jacobian<T>) -> Option<Jacobian<T>> {
    let [a, b, c] = *m;
    let columns = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, columns[0]);
    let volume = (dot(a, a) * dot(b, b) * dot(c, c)).sqrt();
    // Written so that a NaN or infinity anywhere fails the comparison.
    if !(determinant.abs() > T::epsilon() * volume && volume < T::infinity()) {
        return None;
    }
    let scale = T::one() / determinant;
    let row = |r: usize| [columns[0][r] * scale, columns[1][r] * scale, columns[2][r] * scale];
    Some([row(0), row(1), row(2)])
}

/// M v.
#[inline(always)]
pub(crate) fn multiply<T: Real>(m: &Jacobian<T>, v: [T; 3]) -> [T; 3] {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// M^T v.
#[inline(always)]
pub(crate) fn multiply_transposed<T: Real>(m: &Jacobian<T>, v: [T; 3]) -> [T; 3] {
    std::array::from_fn(|c| m[0][c] * v[0] + m[1][c] * v[1] + m[2][c] * v[2])
}

/// a . b.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a x b.
#[inline(always)]
fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a - b.
#[inline(always)]
pub(crate) fn subtract<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    #[test]
    fn glam_transforms_keep_their_meaning_and_invert() {
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
        let affine =
            Affine3A::from_scale_rotation_translation(Vec3::new(1.0, 1.2, 0.9), turn, Vec3::new(0.1, -2.0, 3.0));
        let bone = bone_transform(&affine);
        let x = Vec3::new(0.4, -0.7, 0.2);
        let there = apply(&bone, x.to_array());
        assert!(Vec3::from_array(there).distance(affine.transform_point3(x)) < 1e-6);
        let back = apply(&inverse_transform(&bone).expect("regular"), there);
        assert!(Vec3::from_array(back).distance(x) < 1e-5);
    }

    #[test]
    fn singular_and_non_finite_matrices_have_no_inverse() {
        let plane = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]];
        assert!(inverse(&plane).is_none());
        assert!(inverse(&[[0.0_f32; 3]; 3]).is_none());
        for bad in [f64::NAN, f64::INFINITY, f64::MAX] {
            assert!(inverse(&[[bad, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, bad, 1.0]]).is_none());
        }
    }

    #[test]
    fn small_matrices_are_not_mistaken_for_singular_ones() {
        let m = [[1e-6, 0.0, 0.0], [0.0, 2e-6, 0.0], [0.0, 1e-6, 1e-6_f64]];
        let inverted = inverse(&m).expect("regular");
        let e = multiply(&m, multiply(&inverted, [1.0, 2.0, 3.0]));
        assert!(e.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
