//! Bones as segments, for the bone and joint losses (thesis eq. 4.12, after SNARF).
//!
//! A bone is the segment from a joint's parent to the joint: J - 1. Points on bones are inside the body; at a joint
//! the bones that meet there, its parent's and its own, have skinning weights 1/2 and 1/2.

use glam::Vec3;

use super::Skeleton;

/// The segment from a joint's parent to the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bone {
    /// The joint at the end.
    pub joint: usize,
    /// Its parent, at the start.
    pub parent: usize,
    /// Where the parent is.
    pub start: Vec3,
    /// Where the joint is.
    pub end: Vec3,
}

impl Bone {
    /// `count` points evenly from start to end, both included; at least two.
    pub fn points(&self, count: usize) -> impl Iterator<Item = Vec3> + use<> {
        let (start, end) = (self.start, self.end);
        (0..count).map(move |point| start.lerp(end, point as f32 / (count.max(2) - 1) as f32))
    }
}

impl Skeleton {
    /// The bones between joints at these positions (J), by ascending `joint`.
    pub fn bones(&self, positions: &[Vec3]) -> Vec<Bone> {
        let bone = |(joint, parent): (usize, &Option<usize>)| {
            let parent = (*parent)?;
            Some(Bone { joint, parent, start: positions[parent], end: positions[joint] })
        };
        self.parents.iter().enumerate().filter_map(bone).collect()
    }

    /// The skinning weights (J) that hold at the place of a joint: 1/2 for it and for its parent, 1 for the root at its own.
    pub fn joint_weights(&self, joint: usize) -> Vec<f32> {
        let mut weights = vec![0.0; self.joints.len()];
        weights[joint] += 0.5;
        weights[self.parents[joint].unwrap_or(joint)] += 0.5;
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::super::families::smplx;
    use super::*;

    #[test]
    fn points_run_from_the_parent_to_the_joint() {
        let skeleton = smplx::skeleton();
        let joints: Vec<Vec3> = (0..skeleton.joints.len()).map(|joint| Vec3::new(joint as f32, 1.0, 0.0)).collect();
        let bones = skeleton.bones(&joints);
        assert_eq!(bones.len(), 54);
        let bone = bones[21 - 1];
        assert_eq!((bone.joint, bone.parent), (21, 19));
        let points: Vec<f32> = bone.points(5).map(|point| point.x).collect();
        assert_eq!(points, [19.0, 19.5, 20.0, 20.5, 21.0]);
    }

    #[test]
    fn weights_at_joints_sum_to_one() {
        let skeleton = smplx::skeleton();
        for joint in 0..skeleton.joints.len() {
            assert_eq!(skeleton.joint_weights(joint).iter().sum::<f32>(), 1.0);
        }
        assert_eq!(skeleton.joint_weights(0)[0], 1.0);
        assert_eq!(skeleton.joint_weights(40)[21], 0.5);
    }
}
