//! A pose of one skeleton on another: joints of the same name turn alike.
//!
//! SMPL, SMPL+H and SMPL-X name what they share alike, MANO and FLAME what they are of a body, so that motions of one drive the others. Coefficients mean something else in
//! every family: they go along only between skeletons of one family.

use super::{Pose, PoseAxisAngle, Skeleton};

/// A pose on another skeleton, and what became of the joints that only one of the two has.
#[derive(Clone, Debug, PartialEq)]
pub struct Transferred {
    /// The pose.
    pub pose: Pose,
    /// Joints that turn in the pose that was given and are not in the other skeleton.
    pub left_out: Vec<String>,
    /// Joints of the other skeleton that the pose says nothing of: they are at rest.
    pub at_rest: Vec<String>,
}

impl Skeleton {
    /// Whether poses of this skeleton mean something on another: most of its joints have namesakes here.
    pub fn corresponds_to(&self, other: &Self) -> bool {
        let namesakes = other.joints.iter().filter(|name| self.joint(name).is_some()).count();
        2 * namesakes > other.joints.len()
    }

    /// Whether it is that of a whole body, not of a hand or a head.
    pub fn is_whole_body(&self) -> bool {
        ["pelvis", "head"].iter().all(|name| self.joint(name).is_some())
    }

    /// A pose of this skeleton on another.
    pub fn transfer(&self, pose: &Pose, to: &Self) -> Transferred {
        let same_family = self.family == to.family;
        let rotation = |name: &String| self.joint(name).and_then(|joint| pose.rotations.get(joint)).copied();
        let turns = |rotation: &PoseAxisAngle| rotation.0 != glam::Vec3::ZERO;
        let is_lost = |(name, rotation): &(&String, &PoseAxisAngle)| turns(rotation) && to.joint(name).is_none();
        let coefficients = |values: &Vec<f32>| if same_family { values.clone() } else { Vec::new() };
        Transferred {
            pose: Pose {
                rotations: to.joints.iter().map(|name| rotation(name).unwrap_or_default()).collect(),
                shape: coefficients(&pose.shape),
                expression: coefficients(&pose.expression),
                translation: pose.translation,
            },
            left_out: self.joints.iter().zip(&pose.rotations).filter(is_lost).map(|(name, _)| name.clone()).collect(),
            at_rest: to.joints.iter().filter(|name| self.joint(name).is_none()).cloned().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::{smpl, smplx};
    use super::*;

    #[test]
    fn a_body_drives_hands_and_heads_but_not_anything() {
        use super::super::{flame, mano};
        let body = smplx::skeleton();
        for other in [mano::skeleton("left"), mano::skeleton("right"), flame::skeleton(), smpl::skeleton().clone()] {
            assert!(body.corresponds_to(&other), "{}", other.family);
        }
        assert!(
            !mano::skeleton("left").corresponds_to(body)
                && !mano::skeleton("left").corresponds_to(&mano::skeleton("right"))
        );
        assert!(body.is_whole_body() && !flame::skeleton().is_whole_body() && !mano::skeleton("left").is_whole_body());
    }

    #[test]
    fn shared_joints_turn_alike_and_the_others_are_named() {
        let (from, to) = (smplx::skeleton(), smpl::skeleton());
        let mut pose = from.rest_pose();
        let turn = |name: &str, pose: &mut Pose| {
            pose.rotations[from.joint(name).unwrap()] = PoseAxisAngle(Vec3::new(0.1, 0.2, 0.3));
        };
        turn("left_elbow", &mut pose);
        turn("jaw", &mut pose);
        pose.shape = vec![1.0];
        let transferred = from.transfer(&pose, to);
        assert_eq!(transferred.pose.rotations[to.joint("left_elbow").unwrap()].0.y, 0.2);
        assert_eq!(transferred.left_out, ["jaw"]);
        assert_eq!(transferred.at_rest, ["left_hand", "right_hand"]);
        assert!(transferred.pose.shape.is_empty());

        let back = to.transfer(&transferred.pose, from).pose;
        assert_eq!(back.rotations[from.joint("left_elbow").unwrap()].0.z, 0.3);
        assert_eq!(from.transfer(&pose, from).pose, pose);
    }
}
