//! Normals of the deformed surface, and their reverse (thesis ch. 4.2.2; METHOD section 3).
//!
//! n_d = s u / |u| with u = J^-T grad f: canonical gradients grad f, Jacobians J of the skinning, and the sign s that
//! turns the gradient outward (-1 for an occupancy, which falls outward; +1 for a signed distance). N points.

use xavatar_network::Real;

use crate::affine::{dot, inverse, multiply, multiply_transposed};
use crate::error::expect_length;
use crate::{Jacobian, Result};

/// Which way the field's gradient points on the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GradientSide {
    /// Outward: a signed distance.
    Outward,
    /// Inward: an occupancy.
    Inward,
}

impl GradientSide {
    fn sign<T: Real>(self) -> T {
        match self {
            Self::Outward => T::one(),
            Self::Inward => -T::one(),
        }
    }
}

/// Writes the unit outward normals of the deformed surface (N).
///
/// A point whose gradient vanishes or whose Jacobian is singular has none: zero is written. Returns how many there are.
///
/// # Errors
/// If the batches differ in length.
pub fn deformed_normals<T: Real>(
    gradients: &[[T; 3]],
    jacobians: &[Jacobian<T>],
    side: GradientSide,
    normals: &mut [[T; 3]],
) -> Result<usize> {
    expect_length("Jacobians", jacobians.len(), gradients.len())?;
    expect_length("normals", normals.len(), gradients.len())?;
    let mut without = 0;
    for ((&gradient, jacobian), normal) in gradients.iter().zip(jacobians).zip(normals) {
        *normal = match covector(gradient, jacobian) {
            Some(Covector { direction, .. }) => direction.map(|value| side.sign::<T>() * value),
            None => {
                without += 1;
                [T::zero(); 3]
            }
        };
    }
    Ok(without)
}

/// Pulls cotangents of the normals (N) back to the gradients (N) and the Jacobians (N), which are overwritten.
///
/// Points without a normal get zeros.
///
/// # Errors
/// If the batches differ in length.
pub fn deformed_normals_backward<T: Real>(
    gradients: &[[T; 3]],
    jacobians: &[Jacobian<T>],
    side: GradientSide,
    normal_cotangents: &[[T; 3]],
    gradient_cotangents: &mut [[T; 3]],
    jacobian_cotangents: &mut [Jacobian<T>],
) -> Result<()> {
    expect_length("Jacobians", jacobians.len(), gradients.len())?;
    expect_length("cotangents of normals", normal_cotangents.len(), gradients.len())?;
    expect_length("cotangents of gradients", gradient_cotangents.len(), gradients.len())?;
    expect_length("cotangents of Jacobians", jacobian_cotangents.len(), gradients.len())?;
    let batch = gradients.iter().zip(jacobians).zip(normal_cotangents);
    for (((&gradient, jacobian), &cotangent), (to_gradient, to_jacobian)) in
        batch.zip(gradient_cotangents.iter_mut().zip(jacobian_cotangents))
    {
        let Some(Covector { direction, length, inverse }) = covector(gradient, jacobian) else {
            *to_gradient = [T::zero(); 3];
            *to_jacobian = [[T::zero(); 3]; 3];
            continue;
        };
        let along = dot(direction, cotangent);
        let scale = side.sign::<T>() / length;
        let tangent: [T; 3] = std::array::from_fn(|r| scale * (cotangent[r] - along * direction[r]));
        *to_gradient = multiply(&inverse, tangent);
        *to_jacobian = direction.map(|value| to_gradient.map(|pulled| -length * value * pulled));
    }
    Ok(())
}

/// u = J^-T grad f in parts.
struct Covector<T> {
    direction: [T; 3],
    length: T,
    inverse: Jacobian<T>,
}

fn covector<T: Real>(gradient: [T; 3], jacobian: &Jacobian<T>) -> Option<Covector<T>> {
    let inverse = inverse(jacobian)?;
    let u = multiply_transposed(&inverse, gradient);
    let length = dot(u, u).sqrt();
    (length > T::zero() && length.is_finite()).then(|| Covector {
        direction: u.map(|value| value / length),
        length,
        inverse,
    })
}
