//! The SMPL-X skeleton at rest, as far as motions need it: where the pelvis is, and which way bones point.
//!
//! An avatar knows its own; motions are also read where none is at hand. Then joints are those of an average adult in the
//! T-pose: a motion's floor is off by a centimetre or two, and arms that hang by a few degrees. J joints; metres.

use std::f32::consts::FRAC_PI_6;

use glam::{Quat, Vec3};

use xavatar_body::smplx;
use xavatar_formats::{Error, Result};

/// Joints in the T-pose.
#[derive(Clone, Debug, PartialEq)]
pub struct RestPose {
    joints: Vec<Vec3>,
}

impl RestPose {
    /// Of an avatar's or a body's joints in the canonical pose, which is the T-pose but for hips turned +-pi/6 about z.
    ///
    /// # Errors
    /// [`Error::Value`] if they are not SMPL-X's in number.
    pub fn of_canonical(joints: &[Vec3]) -> Result<Self> {
        let count = smplx::skeleton().joints.len();
        let mut joints = joints.to_vec();
        if joints.len() != count {
            let (found, expected) = (joints.len().to_string(), count.to_string());
            return Err(Error::Value { name: "canonical joints".into(), found, expected });
        }
        for (hip, angle) in [(1, FRAC_PI_6), (2, -FRAC_PI_6)] {
            let (undo, pivot) = (Quat::from_rotation_z(-angle), joints[hip]);
            for joint in (hip + 1..count).filter(|joint| is_below(*joint, hip)) {
                joints[joint] = pivot + undo * (joints[joint] - pivot);
            }
        }
        Ok(Self { joints })
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
        let mirrored = |[x, y, z]: [f32; 3]| Vec3::new(-x, y, z);
        let middle = [(0, PELVIS), (3, SPINE[0]), (6, SPINE[1]), (9, SPINE[2]), (12, NECK), (15, HEAD), (22, JAW)];
        let mut joints = vec![Vec3::ZERO; smplx::skeleton().joints.len()];
        for (joint, place) in middle {
            joints[joint] = place.into();
        }
        for (joint, place) in LEFT {
            joints[joint] = place.into();
            joints[right_of(joint)] = mirrored(place);
        }
        Self { joints }
    }
}

/// The right twin of a left joint: hands are 15 apart, all others neighbours.
fn right_of(left: usize) -> usize {
    if left >= 25 { left + 15 } else { left + 1 }
}

fn is_below(joint: usize, ancestor: usize) -> bool {
    let parents = &smplx::skeleton().parents;
    std::iter::successors(Some(joint), |joint| parents[*joint]).any(|above| above == ancestor)
}

const PELVIS: [f32; 3] = [0.0, -0.35, 0.0];
const SPINE: [[f32; 3]; 3] = [[0.0, -0.24, -0.012], [0.0, -0.11, -0.018], [0.0, 0.0, -0.014]];
const NECK: [f32; 3] = [0.0, 0.165, -0.018];
const HEAD: [f32; 3] = [0.0, 0.245, -0.002];
const JAW: [f32; 3] = [0.0, 0.262, 0.022];
/// The left side; those of the built-in subject (`assets/mannequin.toml`).
const LEFT: [(usize, [f32; 3]); 24] = [
    (1, [0.088, -0.42, 0.0]),
    (4, [0.100, -0.83, 0.005]),
    (7, [0.104, -1.225, -0.022]),
    (10, [0.118, -1.282, 0.095]),
    (13, [0.055, 0.105, -0.005]),
    (16, [0.165, 0.115, -0.015]),
    (18, [0.425, 0.108, -0.025]),
    (20, [0.672, 0.107, -0.012]),
    (23, [0.031, 0.314, 0.078]),
    (25, [0.768, 0.108, 0.026]),
    (26, [0.810, 0.108, 0.033]),
    (27, [0.835, 0.107, 0.037]),
    (28, [0.772, 0.110, 0.002]),
    (29, [0.819, 0.110, 0.004]),
    (30, [0.847, 0.109, 0.005]),
    (31, [0.752, 0.105, -0.046]),
    (32, [0.784, 0.105, -0.055]),
    (33, [0.803, 0.104, -0.060]),
    (34, [0.764, 0.108, -0.022]),
    (35, [0.807, 0.108, -0.027]),
    (36, [0.833, 0.107, -0.030]),
    (37, [0.700, 0.098, 0.026]),
    (38, [0.731, 0.090, 0.055]),
    (39, [0.753, 0.085, 0.077]),
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
