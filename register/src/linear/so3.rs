//! Rotations as matrices R, and small turns d of them: R exp(hat(d)). Radians.
//!
//! log R is the axis-angle; log(R exp(hat(d))) = log R + Jr^-1(log R) d + O(d^2), Jr the right Jacobian of the exponential map.
//! All are finite for angles in [0, pi].

use glam::{DMat3, DQuat, DVec3};

/// The matrix with hat(v) x = v x x.
pub fn hat(v: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, v.z, -v.y), DVec3::new(-v.z, 0.0, v.x), DVec3::new(v.y, -v.x, 0.0))
}

/// The rotation of an axis-angle.
pub fn exp(axis_angle: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_scaled_axis(axis_angle))
}

/// The unit quaternion of a rotation, of the two the one with w >= 0.
pub fn quaternion(rotation: &DMat3) -> DQuat {
    let quaternion = DQuat::from_mat3(rotation).normalize();
    if quaternion.w < 0.0 { -quaternion } else { quaternion }
}

/// The axis-angle of a rotation, of length [0, pi].
pub fn log(rotation: &DMat3) -> DVec3 {
    let quaternion = quaternion(rotation);
    let sine = quaternion.xyz().length();
    if sine < 1e-9 { quaternion.xyz() * 2.0 } else { quaternion.xyz() * (2.0 * sine.atan2(quaternion.w) / sine) }
}

/// Jr^-1 at an axis-angle: I + hat(r) / 2 + c hat(r)^2, c = (1 - (x / 2) cot(x / 2)) / x^2, x = |r|.
pub fn right_jacobian_inverse(axis_angle: DVec3) -> DMat3 {
    let squared = axis_angle.length_squared();
    let half = squared.sqrt() / 2.0;
    let c = if squared < 1e-6 { 1.0 / 12.0 + squared / 720.0 } else { (1.0 - half / half.tan()) / squared };
    let turn = hat(axis_angle);
    DMat3::IDENTITY + turn * 0.5 + turn * turn * c
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotations() -> impl Iterator<Item = DVec3> {
        let axis = DVec3::new(0.48, -0.6, 0.64);
        [0.0, 1e-5, 1e-3, 0.4, 2.0, 3.1].into_iter().map(move |angle| axis * angle)
    }

    #[test]
    fn logarithm_and_exponential_are_inverse() {
        for axis_angle in rotations() {
            assert!(log(&exp(axis_angle)).distance(axis_angle) < 1e-12, "{axis_angle}");
        }
    }

    // d log(R exp(hat(d))) / dd = Jr^-1(log R) at d = 0
    #[test]
    fn the_right_jacobian_is_that_of_finite_differences() {
        const STEP: f64 = 1e-6;
        for axis_angle in rotations() {
            let rotation = exp(axis_angle);
            for axis in DVec3::AXES {
                let moved = |step: f64| log(&(rotation * exp(axis * step)));
                let numeric = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
                assert!(numeric.distance(right_jacobian_inverse(axis_angle) * axis) < 1e-8, "{axis_angle}");
            }
        }
    }
}
