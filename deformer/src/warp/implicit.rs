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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::softmax_field::{SoftmaxField, generator, posed, vectors};
    use crate::{BoneTransform, ExactWarp, SearchSettings, StartGroups, Warp, deform, deform_backward, search};
    use xavatar_network::SkinningWeights;

    const JOINTS: usize = 4;

    fn roots(field: &SoftmaxField<f64>, bones: &[BoneTransform<f64>], points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let settings = SearchSettings { tolerance: 1e-14, ..SearchSettings::default() };
        let warp = ExactWarp::new(field, bones).unwrap();
        let found = search(&warp, &StartGroups::all(JOINTS).unwrap(), points, None, &settings).unwrap();
        assert_eq!(found.points.len(), points.len(), "a gentle pose has one root a point");
        found.points
    }

    // d/dsigma of d_w(x_c(sigma), B) = x_d at fixed x_d:  dx_c/dsigma = -J^-1 d d_w/dsigma
    #[test]
    fn implicit_gradient_matches_finite_differences_of_the_search() {
        let (mut field, bones) = posed::<f64>(11, JOINTS, 0.4);
        let mut generator = generator(12);
        let canonical: Vec<[f64; 3]> = vectors(&mut generator, 8, 0.5);
        let cotangents: Vec<[f64; 3]> = vectors(&mut generator, 8, 1.0);
        let mut transforms = vec![[0.0; 12]; 8];
        let mut jacobians = vec![[[0.0; 3]; 3]; 8];
        let mut deformed = vec![[0.0; 3]; 8];
        ExactWarp::new(&field, &bones).unwrap().transforms_and_jacobians(
            &mut Default::default(),
            &canonical,
            &mut transforms,
            &mut jacobians,
        );
        deform(&transforms, &canonical, &mut deformed).unwrap();

        let mut lambda = vec![[0.0; 3]; 8];
        assert_eq!(root_cotangents(&jacobians, &cotangents, &mut lambda).unwrap(), 0);
        let (mut to_weights, mut to_points) = (vec![0.0; 8 * JOINTS], vec![[0.0; 3]; 8]);
        deform_backward(&transforms, &bones, &canonical, &lambda, &mut to_weights, &mut to_points).unwrap();
        let objective = |roots: &[[f64; 3]]| -> f64 {
            roots.as_flattened().iter().zip(cotangents.as_flattened()).map(|(a, b)| a * b).sum()
        };
        let weights = |field: &SoftmaxField<f64>| {
            let mut weights = vec![0.0; 8 * JOINTS];
            field.weights(&mut (), &canonical, &mut weights);
            weights
        };
        let step = 1e-5;
        for (joint, axis) in (0..JOINTS).flat_map(|joint| (0..3).map(move |axis| (joint, axis))) {
            let centre = field.centres[joint][axis];
            let mut at = |moved: f64| {
                field.centres[joint][axis] = moved;
                (objective(&roots(&field, &bones, &deformed)), weights(&field))
            };
            let (above, below) = (at(centre + step), at(centre - step));
            field.centres[joint][axis] = centre;
            let expected = (above.0 - below.0) / (2.0 * step);
            let slopes = above.1.iter().zip(&below.1).map(|(a, b)| (a - b) / (2.0 * step));
            let found: f64 = slopes.zip(&to_weights).map(|(slope, cotangent)| slope * cotangent).sum();
            assert!((found - expected).abs() < 1e-7 * (1.0 + expected.abs()), "{joint} {axis}: {found} != {expected}");
        }
    }

    #[test]
    fn singular_roots_are_counted_and_pull_nothing() {
        let jacobians = [[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]], [[1.0; 3]; 3], [[f64::NAN; 3]; 3]];
        let mut lambda = [[9.0; 3]; 3];
        assert_eq!(root_cotangents(&jacobians, &[[1.0; 3]; 3], &mut lambda).unwrap(), 2);
        assert_eq!(lambda, [[-1.0, -0.5, -0.25], [0.0; 3], [0.0; 3]]);
        assert!(root_cotangents(&jacobians, &[[1.0; 3]; 2], &mut lambda).is_err());
    }
}
