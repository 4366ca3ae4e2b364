//! What the geometry field is told of a pose: c = [theta_b / pi, psi], the angles of the skeleton's conditioning joints, then the
//! expression (METHOD section 2).

use std::f32::consts::PI;

use crate::body::{Pose, Skeleton};

/// Which numbers of a pose are the condition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Condition {
    /// Joints whose rotations are in it, in this order.
    joints: Vec<usize>,
    /// Coefficients of the expression.
    expressions: usize,
}

impl Condition {
    /// The condition of poses of a skeleton with so many expression coefficients.
    pub fn new(skeleton: &Skeleton, expressions: usize) -> Self {
        Self { joints: skeleton.conditioning.clone(), expressions }
    }

    /// How many numbers it has.
    pub fn width(&self) -> usize {
        self.angles() + self.expressions
    }

    /// How many of them are angles: the first.
    pub fn angles(&self) -> usize {
        3 * self.joints.len()
    }

    /// How many are expression coefficients: the last.
    pub fn expressions(&self) -> usize {
        self.expressions
    }

    /// The condition of a pose.
    ///
    /// # Panics
    /// If the pose is of another skeleton.
    pub fn of(&self, pose: &Pose) -> Vec<f32> {
        let angles = self.joints.iter().flat_map(|joint| (pose.rotations[*joint].0 / PI).to_array());
        angles.chain(self.expression(&pose.expression)).collect()
    }

    /// The condition of the pose at rest with an expression.
    pub fn of_expression(&self, expression: &[f32]) -> Vec<f32> {
        std::iter::repeat_n(0.0, self.angles()).chain(self.expression(expression)).collect()
    }

    /// No condition: zeros.
    pub fn none(&self) -> Vec<f32> {
        vec![0.0; self.width()]
    }

    /// The coefficients, those that are left out zero.
    fn expression<'a>(&self, coefficients: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        coefficients.iter().copied().chain(std::iter::repeat(0.0)).take(self.expressions)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::body::smplx;

    #[test]
    fn angles_of_the_conditioning_joints_come_before_the_expression() {
        let condition = Condition::new(smplx::skeleton(), smplx::EXPRESSIONS);
        assert_eq!((condition.width(), condition.angles()), (73, 63));
        let mut pose = smplx::skeleton().rest_pose();
        pose.rotations[0].0 = Vec3::ONE;
        pose.rotations[1].0 = Vec3::new(PI, 0.0, -PI);
        pose.rotations[21].0 = Vec3::Y * PI / 2.0;
        pose.rotations[22].0 = Vec3::ONE;
        pose.expression = vec![0.25];
        let of_pose = condition.of(&pose);
        assert_eq!((&of_pose[..4], &of_pose[60..65]), (&[1.0, 0.0, -1.0, 0.0][..], &[0.0, 0.5, 0.0, 0.25, 0.0][..]));
        assert_eq!(of_pose.len(), 73);
        assert_eq!(condition.of_expression(&[0.25])[62..65], [0.0, 0.25, 0.0]);
    }
}
