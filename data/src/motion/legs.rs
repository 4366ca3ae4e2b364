//! A path on other legs: t' = s (J_0 + t) - J'_0 with s = |J'_knee - J'_hip| + |J'_ankle - J'_knee| over the same of the legs that it was made on.
//!
//! Angles stay; a step is as long as the legs that make it, so that feet neither slide nor leave the floor, y = 0. Joints at rest, in the order of
//! SMPL and SMPL-X, which begin alike; metres.

use glam::Vec3;
use xavatar_body::Pose;
use xavatar_body::smplx::joint::sides::{ANKLES, HIPS, KNEES};

/// Moves poses from a body with joints at `from` (J) to one with joints at `to` (J); the ratio of the legs' lengths.
pub fn onto_legs(poses: &mut [Pose], from: &[Vec3], to: &[Vec3]) -> f32 {
    let [own, other] = [from, to].map(leg);
    let ratio = if own > 0.0 && other > 0.0 { other / own } else { 1.0 };
    let root = |joints: &[Vec3]| joints.first().copied().unwrap_or_default();
    for pose in poses {
        pose.translation = (root(from) + pose.translation) * ratio - root(to);
    }
    ratio
}

/// The length of the left leg.
fn leg(joints: &[Vec3]) -> f32 {
    let between = |one: usize, other: usize| match (joints.get(one), joints.get(other)) {
        (Some(one), Some(other)) => one.distance(*other),
        _ => 0.0,
    };
    between(HIPS[0], KNEES[0]) + between(KNEES[0], ANKLES[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pelvis_is_as_high_as_the_legs_are_long() {
        let mut from = vec![Vec3::ZERO; 55];
        from[0] = Vec3::new(0.0, 0.9, 0.0);
        (from[HIPS[0]], from[KNEES[0]], from[ANKLES[0]]) = (Vec3::Y * 0.8, Vec3::Y * 0.4, Vec3::ZERO);
        let to: Vec<Vec3> = from.iter().map(|place| *place * 1.5 + Vec3::Y * 0.2).collect();
        let mut poses = [Pose { translation: Vec3::new(1.0, 0.1, -2.0), ..Pose::default() }];
        assert!((onto_legs(&mut poses, &from, &to) - 1.5).abs() < 1e-6);
        let pelvis = to[0] + poses[0].translation;
        assert!(pelvis.distance(Vec3::new(1.5, 1.5, -3.0)) < 1e-5, "{pelvis}");
        assert_eq!(onto_legs(&mut poses, &[], &[]), 1.0);
    }
}
