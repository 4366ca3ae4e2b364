//! A weak camera: p = s (R v)_xy + t, with R of a quaternion x y z w of any length but zero (Wang 4.4; METHOD-BODY section 11).
//!
//! It is told by seven numbers, the quaternion, t_x, t_y and s. B pictures, V points of each.

use candle_core::{Result, Tensor};

/// Numbers of a camera.
pub(super) const NUMBERS: usize = 7;
/// One that looks along z: x is right, y up, and a metre half a picture.
pub(super) const PLAIN: [f64; NUMBERS] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];

/// Where cameras (B, 7) see points (B, V, 3): (B, V, 2).
///
/// # Errors
/// candle's, if the shapes are others.
pub fn projected(points: &Tensor, cameras: &Tensor) -> Result<Tensor> {
    let quaternions = cameras.narrow(1, 0, 4)?;
    let lengths = quaternions.sqr()?.sum_keepdim(1)?.sqrt()?;
    let unit = quaternions.broadcast_div(&lengths)?;
    let [x, y, z, w] = [unit.narrow(1, 0, 1)?, unit.narrow(1, 1, 1)?, unit.narrow(1, 2, 1)?, unit.narrow(1, 3, 1)?];
    let twice = |one: Tensor, other: Tensor| (one + other)? * 2.0;
    let diagonal = |one: &Tensor, other: &Tensor| twice(one.sqr()?, other.sqr()?)?.affine(-1.0, 1.0);
    let right = [diagonal(&y, &z)?, twice((&x * &y)?, (&z * &w)?.neg()?)?, twice((&x * &z)?, (&y * &w)?)?];
    let up = [twice((&x * &y)?, (&z * &w)?)?, diagonal(&x, &z)?, twice((&y * &z)?, (&x * &w)?.neg()?)?];
    let axes = Tensor::stack(&[Tensor::cat(&right, 1)?, Tensor::cat(&up, 1)?], 2)?;
    let sizes = cameras.narrow(1, 6, 1)?.unsqueeze(2)?;
    points.matmul(&axes)?.broadcast_mul(&sizes)?.broadcast_add(&cameras.narrow(1, 4, 2)?.unsqueeze(1)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{largest_difference, reference, tensor};

    #[test]
    fn points_are_where_the_references_camera_sees_them() {
        let golden = reference("registration_terms");
        let points = tensor(&golden["source"].repeat(3), &[3, 42, 3]);
        let parts = [("quaternion", 4), ("image_translation", 2), ("image_scale", 1)];
        let cameras: Vec<Tensor> = parts.iter().map(|(name, width)| tensor(&golden[*name], &[3, *width])).collect();
        let found = projected(&points, &Tensor::cat(&cameras, 1).unwrap()).unwrap();
        let found: Vec<f64> = found.flatten_all().unwrap().to_vec1().unwrap();
        assert!(largest_difference(&found, &golden["projected"]) < 1e-12);
    }
}
