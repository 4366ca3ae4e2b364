//! The gradient of a root, by the implicit function theorem (thesis ch. 4.2.3; METHOD section 3).
//!
//! d_w(x_c, B) = x_d at fixed x_d gives dx_c = -J^-1 sum_j dw_j B_j x_c: nothing flows through the iterations.
//! In reverse: lambda = -J^-T xbar_c is a cotangent of the deformed point, and [`crate::deform_backward`] pulls it back
//! to the weights, wbar_j = lambda . (B_j x_c). K roots; -lambda is the cotangent of x_d.

use xavatar_network::Real;

use crate::affine::{inverse, multiply_transposed};
use crate::error::expect_length;
use crate::{Jacobian, Result};

/// Turns cotangents of roots x_c (K) into cotangents lambda of the deformed point, from the full Jacobians there (K).
///
/// Where a Jacobian is singular the root has no derivative: lambda is zero there. Returns how many such roots there are.
///
/// # Errors
/// If the batches differ in length.
pub fn root_cotangents<T: Real>(
    jacobians: &[Jacobian<T>],
    root_cotangents: &[[T; 3]],
    deformed_cotangents: &mut [[T; 3]],
) -> Result<usize> {
    expect_length("cotangents of roots", root_cotangents.len(), jacobians.len())?;
    expect_length("cotangents of deformed points", deformed_cotangents.len(), jacobians.len())?;
    let mut singular = 0;
    for ((jacobian, &cotangent), deformed) in jacobians.iter().zip(root_cotangents).zip(deformed_cotangents) {
        *deformed = match inverse(jacobian) {
            Some(inverse) => multiply_transposed(&inverse, cotangent).map(|value| -value),
            None => {
                singular += 1;
                [T::zero(); 3]
            }
        };
    }
    Ok(singular)
}
