//! The rotation that takes points nearest to others (Kabsch 1976).

use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

/// The rotation that takes weighted points nearest to others, both about their means: from, to, weight. None if they lie on a line.
pub fn rotation_between(moved: &[(DVec3, DVec3, f64)]) -> Option<DMat3> {
    let total: f64 = moved.iter().map(|(_, _, weight)| weight).sum();
    let from = moved.iter().map(|(from, _, weight)| *from * *weight).sum::<DVec3>() / total;
    let to = moved.iter().map(|(_, to, weight)| *to * *weight).sum::<DVec3>() / total;
    let product = |(a, b, weight): &(DVec3, DVec3, f64)| {
        let (a, b) = (*a - from, *b - to);
        Matrix3::from_fn(|row, column| a[row] * b[column]) * *weight
    };
    nearest_rotation(moved.iter().map(product).sum()).filter(|turn| turn.is_finite())
}

/// The rotation R that makes tr(R H) largest; none if points lie on a line.
fn nearest_rotation(covariance: Matrix3<f64>) -> Option<DMat3> {
    let decomposed = covariance.svd(true, true);
    let (u, vt) = (decomposed.u?, decomposed.v_t?);
    let values = decomposed.singular_values;
    let second =
        values.iter().copied().fold([0.0, 0.0], |[a, b]: [f64; 2], v| if v > a { [v, a] } else { [a, b.max(v)] })[1];
    if second.is_nan() || second <= 1e-6 {
        return None;
    }
    let sign = (vt.transpose() * u.transpose()).determinant().signum();
    let weakest = values.imin();
    let mut flip = Matrix3::identity();
    flip[(weakest, weakest)] = sign;
    let rotation = vt.transpose() * flip * u.transpose();
    Some(DMat3::from_cols_slice(rotation.as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::so3;

    #[test]
    fn a_rotation_is_found_from_points_that_it_turned_even_in_a_plane() {
        let turn = so3::exp(DVec3::new(0.3, 2.0, -0.8));
        let points = [DVec3::new(0.1, 0.0, 0.0), DVec3::new(-0.1, 0.5, 0.0), DVec3::new(0.2, -0.3, 0.0)];
        let is_turn = |found: DMat3| (found - turn).to_cols_array().iter().all(|entry| entry.abs() < 1e-12);
        let mut covariance = Matrix3::zeros();
        for point in points {
            let turned = turn * point;
            covariance += Matrix3::from_fn(|row, column| point[row] * turned[column]);
        }
        assert!(is_turn(nearest_rotation(covariance).unwrap()));
        assert!(nearest_rotation(Matrix3::from_fn(|row, column| points[0][row] * points[0][column])).is_none());
    }

    #[test]
    fn points_may_be_anywhere_and_count_differently() {
        let turn = so3::exp(DVec3::new(0.3, 2.0, -0.8));
        let points = [DVec3::ZERO, DVec3::new(0.4, 0.0, 0.0), DVec3::new(0.0, 0.3, 0.0), DVec3::new(0.1, 0.1, 0.2)];
        let moved = points.map(|point| (point, turn * point + DVec3::ONE, 1.0));
        let is_turn = |found: DMat3| (found - turn).to_cols_array().iter().all(|entry| entry.abs() < 1e-12);
        assert!(is_turn(rotation_between(&moved).unwrap()));
        assert!(is_turn(rotation_between(&moved[..3]).unwrap()), "in a plane");
        assert_eq!(rotation_between(&moved[..2]), None, "on a line");
        let wrong = (DVec3::X, DVec3::ZERO, 0.0);
        assert!(is_turn(rotation_between(&[&moved[..], &[wrong]].concat()).unwrap()), "what has no weight");
    }
}
