//! The SMPL-X skeleton at rest, as far as motions need it: where the pelvis is, and which way bones point.
//!
//! An avatar knows its own; motions are also read where none is at hand. Then joints are those of an average adult in the
//! T-pose: a motion's floor is off by a centimetre or two, and arms that hang by a few degrees. J joints; metres.

use glam::Vec3;

use xavatar_body::Skeleton;
use xavatar_body::smplx::{self, joint};

/// Joints in the T-pose.
#[derive(Clone, Debug, PartialEq)]
pub struct RestPose {
    joints: Vec<Vec3>,
}

impl RestPose {
    /// Of an avatar's or a body's joints in the canonical pose of its skeleton. Joints of SMPL-X that the skeleton does not have are
    /// where they are in an average adult, seen from the nearest one above.
    pub fn of_canonical(skeleton: &Skeleton, joints: &[Vec3]) -> Self {
        let own = skeleton.at_rest(joints);
        let Self { joints: average } = Self::default();
        let mut joints: Vec<Vec3> = Vec::with_capacity(average.len());
        for (joint, (name, parent)) in smplx::skeleton().joints.iter().zip(&smplx::skeleton().parents).enumerate() {
            let known = skeleton.joint(name).and_then(|joint| own.get(joint)).copied();
            joints.push(known.unwrap_or_else(|| match *parent {
                Some(parent) => joints[parent] + (average[joint] - average[parent]),
                None => average[joint],
            }));
        }
        Self { joints }
    }

    /// Where the root's joint is.
    pub fn pelvis(&self) -> Vec3 {
        self.joints[0]
    }

    /// The joints (J).
    pub fn joints(&self) -> &[Vec3] {
        &self.joints
    }
}

impl Default for RestPose {
    fn default() -> Self {
        let mut joints = vec![Vec3::ZERO; smplx::skeleton().joints.len()];
        for (joint, place) in MIDDLE {
            joints[joint] = place.into();
        }
        let hands = joint::LEFT_HAND.zip(joint::RIGHT_HAND).zip(LEFT_HAND);
        for ((left, right), [x, y, z]) in LEFT.into_iter().chain(hands) {
            joints[left] = Vec3::new(x, y, z);
            joints[right] = Vec3::new(-x, y, z);
        }
        Self { joints }
    }
}

/// Those in the middle, of the built-in subject (`assets/mannequin.toml`).
const MIDDLE: [(usize, [f32; 3]); 7] = [
    (joint::PELVIS, [0.0, -0.35, 0.0]),
    (joint::SPINE1, [0.0, -0.24, -0.012]),
    (joint::SPINE2, [0.0, -0.11, -0.018]),
    (joint::SPINE3, [0.0, 0.0, -0.014]),
    (joint::NECK, [0.0, 0.165, -0.018]),
    (joint::HEAD, [0.0, 0.245, -0.002]),
    (joint::JAW, [0.0, 0.262, 0.022]),
];
/// Left joints with their right twins, and where the left ones are.
const LEFT: [((usize, usize), [f32; 3]); 9] = [
    ((joint::LEFT_HIP, joint::RIGHT_HIP), [0.088, -0.42, 0.0]),
    ((joint::LEFT_KNEE, joint::RIGHT_KNEE), [0.100, -0.83, 0.005]),
    ((joint::LEFT_ANKLE, joint::RIGHT_ANKLE), [0.104, -1.225, -0.022]),
    ((joint::LEFT_FOOT, joint::RIGHT_FOOT), [0.118, -1.282, 0.095]),
    ((joint::LEFT_COLLAR, joint::RIGHT_COLLAR), [0.055, 0.105, -0.005]),
    ((joint::LEFT_SHOULDER, joint::RIGHT_SHOULDER), [0.165, 0.115, -0.015]),
    ((joint::LEFT_ELBOW, joint::RIGHT_ELBOW), [0.425, 0.108, -0.025]),
    ((joint::LEFT_WRIST, joint::RIGHT_WRIST), [0.672, 0.107, -0.012]),
    ((joint::LEFT_EYE, joint::RIGHT_EYE), [0.031, 0.314, 0.078]),
];
/// The joints of the left hand.
const LEFT_HAND: [[f32; 3]; joint::HAND] = [
    [0.768, 0.108, 0.026],
    [0.810, 0.108, 0.033],
    [0.835, 0.107, 0.037],
    [0.772, 0.110, 0.002],
    [0.819, 0.110, 0.004],
    [0.847, 0.109, 0.005],
    [0.752, 0.105, -0.046],
    [0.784, 0.105, -0.055],
    [0.803, 0.104, -0.060],
    [0.764, 0.108, -0.022],
    [0.807, 0.108, -0.027],
    [0.833, 0.107, -0.030],
    [0.700, 0.098, 0.026],
    [0.731, 0.090, 0.055],
    [0.753, 0.085, 0.077],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_joints_are_the_mirror_image_of_left_ones() {
        let rest = RestPose::default();
        let names = &smplx::skeleton().joints;
        for (joint, name) in names.iter().enumerate() {
            if let Some(left) = name.strip_prefix("right_") {
                let twin = names.iter().position(|other| other.strip_prefix("left_") == Some(left)).unwrap();
                assert_eq!(rest.joints[joint], rest.joints[twin] * Vec3::new(-1.0, 1.0, 1.0), "{name}");
            }
            assert!(joint == 0 || rest.joints[joint] != Vec3::ZERO, "{name}");
        }
    }
}
