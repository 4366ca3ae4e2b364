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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::softmax_field::{generator, numbers, vectors};

    const POINTS: usize = 6;

    fn jacobians(values: &[f64]) -> Vec<Jacobian<f64>> {
        // Near a rotation by a right angle, as a bent joint has.
        let turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let matrix = |v: &[f64; 9]| std::array::from_fn(|r| std::array::from_fn(|c| turn[r][c] + 0.3 * v[3 * r + c]));
        values.as_chunks::<9>().0.iter().map(matrix).collect()
    }

    // n_d = s u / |u|, u = J^-T grad f:  d(c . n_d) / d(grad f, J)
    #[test]
    fn backward_matches_finite_differences() {
        let mut generator = generator(21);
        let gradients: Vec<f64> = numbers(&mut generator, 3 * POINTS);
        let matrices: Vec<f64> = numbers(&mut generator, 9 * POINTS);
        let cotangents: Vec<[f64; 3]> = vectors(&mut generator, POINTS, 1.0);
        for side in [GradientSide::Outward, GradientSide::Inward] {
            let objective = |gradients: &[f64], matrices: &[f64]| -> f64 {
                let mut normals = vec![[0.0; 3]; POINTS];
                let gradients = gradients.as_chunks::<3>().0;
                assert_eq!(deformed_normals(gradients, &jacobians(matrices), side, &mut normals).unwrap(), 0);
                normals.as_flattened().iter().zip(cotangents.as_flattened()).map(|(a, b)| a * b).sum()
            };
            let (mut to_gradients, mut to_jacobians) = (vec![[0.0; 3]; POINTS], vec![[[0.0; 3]; 3]; POINTS]);
            let rows = gradients.as_chunks::<3>().0;
            deformed_normals_backward(
                rows,
                &jacobians(&matrices),
                side,
                &cotangents,
                &mut to_gradients,
                &mut to_jacobians,
            )
            .unwrap();
            let step = 1e-6;
            let difference = |values: &[f64], index: usize, f: &dyn Fn(&[f64]) -> f64| {
                let at = |offset: f64| {
                    let mut moved = values.to_vec();
                    moved[index] += offset;
                    f(&moved)
                };
                (at(step) - at(-step)) / (2.0 * step)
            };
            for (index, found) in to_gradients.as_flattened().iter().enumerate() {
                let expected = difference(&gradients, index, &|gradients| objective(gradients, &matrices));
                assert!((found - expected).abs() < 1e-7 * (1.0 + expected.abs()), "{index}: {found} != {expected}");
            }
            for (index, found) in to_jacobians.as_flattened().as_flattened().iter().enumerate() {
                let expected = difference(&matrices, index, &|matrices| objective(&gradients, matrices)) / 0.3;
                assert!((found - expected).abs() < 1e-7 * (1.0 + expected.abs()), "{index}: {found} != {expected}");
            }
        }
    }

    #[test]
    fn normals_are_perpendicular_to_deformed_tangents_and_change_side_with_the_field() {
        let mut generator = generator(22);
        let gradients: Vec<[f64; 3]> = vectors(&mut generator, POINTS, 1.0);
        let jacobians = jacobians(&numbers(&mut generator, 9 * POINTS));
        let (mut outward, mut inward) = (vec![[0.0; 3]; POINTS], vec![[0.0; 3]; POINTS]);
        deformed_normals(&gradients, &jacobians, GradientSide::Outward, &mut outward).unwrap();
        deformed_normals(&gradients, &jacobians, GradientSide::Inward, &mut inward).unwrap();
        for index in 0..POINTS {
            let [x, y, z] = gradients[index];
            for tangent in [[y, -x, 0.0], [0.0, z, -y]] {
                assert!(dot(outward[index], multiply(&jacobians[index], tangent)).abs() < 1e-12);
            }
            assert!((dot(outward[index], outward[index]) - 1.0).abs() < 1e-12);
            assert_eq!(inward[index], outward[index].map(|value| -value));
        }
    }

    #[test]
    fn points_without_a_normal_are_counted_and_pull_nothing() {
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (gradients, jacobians) = ([[0.0; 3], [1.0; 3], [f64::NAN; 3]], [identity, [[1.0; 3]; 3], identity]);
        let mut normals = [[9.0; 3]; 3];
        assert_eq!(deformed_normals(&gradients, &jacobians, GradientSide::Outward, &mut normals).unwrap(), 3);
        assert_eq!(normals, [[0.0; 3]; 3]);
        let (mut to_gradients, mut to_jacobians) = ([[9.0; 3]; 3], [[[9.0; 3]; 3]; 3]);
        let side = GradientSide::Inward;
        deformed_normals_backward(&gradients, &jacobians, side, &[[1.0; 3]; 3], &mut to_gradients, &mut to_jacobians)
            .unwrap();
        assert_eq!((to_gradients, to_jacobians), ([[0.0; 3]; 3], [[[0.0; 3]; 3]; 3]));
    }
}
