//! A skeleton as data: joints and their tree, the parts they move, and the pose that is canonical (thesis A.3.3).
//!
//! G_j = G_parent(j) [R_j | t_j]: each joint turns about its own rest position. Transforms are rest -> posed, so that rotations
//! of zero give identities. J joints, the root first; metres, radians.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use serde::{Deserialize, Serialize};

use super::{Part, PartGroup, Pose, PoseAxisAngle, Role};
use xavatar_formats::{Error, Result};

/// Joints and parts are counted in a byte where there are many: a vertex's bones, a point's label.
const MOST: usize = 255;

/// The joints of a body and all that is said of them. Fields may be set freely; [`check`](Self::check) says whether they agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Skeleton {
    /// The family of body models that has it, as messages name it: `SMPL-X`.
    pub family: String,
    /// The joints' names (J).
    pub joints: Vec<String>,
    /// The joint that each hangs on, which comes before it (J); none for the root, the first.
    pub parents: Vec<Option<usize>>,
    /// The parts of the body; every joint moves one of them.
    pub parts: Vec<PartGroup>,
    /// The joints that the search for a point starts from whose part is not known.
    pub starts: Vec<usize>,
    /// The joints' rotations in the canonical pose (J).
    pub canonical: Vec<PoseAxisAngle>,
    /// The joints whose rotations the fields are told, in this order.
    pub conditioning: Vec<usize>,
}

impl Skeleton {
    /// Checks what every algorithm here relies on.
    ///
    /// # Errors
    /// [`Error::Value`] naming what does not agree: a joint without a name, parent, part or canonical rotation, one that is named
    /// twice or hangs on a later one, a part that starts from what it does not hold, or too many of either.
    pub fn check(&self) -> Result<()> {
        let count = self.joints.len();
        let wrong = |name: String, found: String, expected: String| Err(Error::Value { name, found, expected });
        if !(1..=MOST).contains(&count) || !(1..=MOST).contains(&self.parts.len()) {
            let found = format!("{count} joints in {} parts", self.parts.len());
            return wrong("a skeleton".into(), found, format!("1 to {MOST} of either"));
        }
        for (what, found) in [("parents", self.parents.len()), ("canonical rotations", self.canonical.len())] {
            if found != count {
                return wrong(format!("number of {what}"), found.to_string(), format!("{count}, one a joint"));
            }
        }
        for (joint, (name, parent)) in self.joints.iter().zip(&self.parents).enumerate() {
            if self.joint(name) != Some(joint) {
                return wrong("a joint's name".into(), format!("{name}, twice"), "a name of its own".into());
            }
            if parent.map_or(joint != 0, |parent| parent >= joint) {
                return wrong(format!("the parent of {name}"), format!("{parent:?}"), "a joint before it".into());
            }
            let parts = self.parts.iter().filter(|part| part.joints.contains(&joint)).count();
            if parts != 1 {
                return wrong(format!("number of parts that {name} moves"), parts.to_string(), "1".into());
            }
            if !self.canonical[joint].0.is_finite() {
                let found = self.canonical[joint].0.to_string();
                return wrong(format!("the canonical rotation of {name}"), found, "finite".into());
            }
        }
        for part in &self.parts {
            let own = part.starts.iter().chain(part.detail.iter().flat_map(|detail| &detail.joints));
            if part.starts.is_empty() || own.into_iter().any(|joint| !part.joints.contains(joint)) {
                let found = format!("{:?}", part.starts);
                return wrong(format!("the starts of the part {}", part.name), found, "some of its joints".into());
            }
        }
        let known = self.parts.iter().flat_map(|part| &part.joints).chain(&self.starts).chain(&self.conditioning);
        if let Some(joint) = known.into_iter().find(|joint| **joint >= count) {
            return wrong("a joint of a list".into(), joint.to_string(), format!("below {count}"));
        }
        if self.starts.is_empty() {
            return wrong("starts of a point of no known part".into(), "none".into(), "some joints".into());
        }
        Ok(())
    }

    /// That `other`, which is that of `name`, is this skeleton: the same joints on the same tree.
    ///
    /// # Errors
    /// [`Error::Value`] with both families if it is not.
    pub fn require(&self, other: &Self, name: &str) -> Result<()> {
        if self.joints == other.joints && self.parents == other.parents {
            return Ok(());
        }
        Err(Error::Value {
            name: name.into(),
            found: format!("of {}", other.description()),
            expected: format!("of {}", self.description()),
        })
    }

    /// The family and the number of joints: `the SMPL-X skeleton (55 joints)`.
    pub fn description(&self) -> String {
        format!("the {} skeleton ({} joints)", self.family, self.joints.len())
    }

    /// The place of the joint with this name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint == name)
    }

    /// The parts with their groups.
    pub fn parts(&self) -> impl Iterator<Item = (Part, &PartGroup)> + Clone {
        (0..).map(Part).zip(&self.parts)
    }

    /// The parts of a role.
    pub fn parts_of(&self, role: Role) -> impl Iterator<Item = Part> + Clone {
        self.parts().filter(move |(_, group)| group.role == role).map(|(part, _)| part)
    }

    /// The part with this name.
    pub fn part_named(&self, name: &str) -> Option<Part> {
        self.parts().find(|(_, group)| group.name == name).map(|(part, _)| part)
    }

    /// What a part is.
    ///
    /// # Panics
    /// If the part is another skeleton's.
    pub fn role(&self, part: Part) -> Role {
        self.parts[part.index()].role
    }

    /// The part that each joint moves (J).
    pub fn parts_of_joints(&self) -> Vec<Part> {
        let of_joint = |joint: usize| self.parts().find(|(_, group)| group.joints.contains(&joint));
        (0..self.joints.len()).map(|joint| of_joint(joint).map_or(Part::default(), |(part, _)| part)).collect()
    }

    /// The pose with all rotations zero.
    pub fn rest_pose(&self) -> Pose {
        Pose { rotations: vec![PoseAxisAngle::default(); self.joints.len()], ..Pose::default() }
    }

    /// The pose at rest but for joints of these names, turned by an axis times an angle, radians.
    ///
    /// # Errors
    /// [`Error::Value`] naming a joint that is not here.
    pub fn turned<'a>(&self, turns: impl IntoIterator<Item = (&'a str, Vec3)>) -> Result<Pose> {
        let mut pose = self.rest_pose();
        for (name, turn) in turns {
            let joint = self.joint(name).ok_or_else(|| Error::Value {
                name: "a joint of the pose".into(),
                found: name.into(),
                expected: format!("one of {}", self.joints.join(", ")),
            })?;
            pose.rotations[joint] = PoseAxisAngle(turn);
        }
        Ok(pose)
    }

    /// This skeleton with the head bowed by `angle` in its canonical pose, radians, half of it in the neck: long hair then hangs clear of
    /// the back, where it belongs to the head alone. Only as far as there are joints of these names.
    #[must_use]
    pub fn bowed(&self, angle: f32) -> Self {
        let mut bowed = self.clone();
        for joint in ["neck", "head"].iter().filter_map(|name| self.joint(name)) {
            bowed.canonical[joint].0.x += angle / 2.0;
        }
        bowed
    }

    /// The canonical pose of a shape, without expression.
    pub fn canonical_pose(&self, shape: &[f32]) -> Pose {
        Pose { rotations: self.canonical.clone(), shape: shape.to_vec(), ..Pose::default() }
    }

    /// The joints at rest (J), of those in the canonical pose.
    pub fn at_rest(&self, canonical: &[Vec3]) -> Vec<Vec3> {
        let mut joints = canonical.to_vec();
        for pivot in 0..joints.len() {
            let turn = self.canonical.get(pivot).copied().unwrap_or_default();
            if turn == PoseAxisAngle::default() {
                continue;
            }
            // The joints above are at rest by now: what is below turns back rigidly.
            let (undo, place) = (rotation(PoseAxisAngle(-turn.0)), joints[pivot]);
            for joint in (pivot + 1..joints.len()).filter(|joint| self.hangs_on(*joint, pivot)) {
                joints[joint] = place + undo * (joints[joint] - place);
            }
        }
        joints
    }

    /// Whether a joint is below another in the tree.
    fn hangs_on(&self, joint: usize, ancestor: usize) -> bool {
        let above = |joint: usize| self.parents.get(joint).copied().flatten();
        std::iter::successors(above(joint), |joint| above(*joint)).any(|above| above == ancestor)
    }

    /// The rest -> posed transform of each joint (J) from the rest positions (J) and the rotations relative to the parents (J).
    pub(super) fn bone_transforms(&self, rest: &[Vec3], rotations: &[Mat3A]) -> Vec<Affine3A> {
        let mut transforms: Vec<Affine3A> = Vec::with_capacity(rest.len());
        for ((rest, rotation), parent) in rest.iter().zip(rotations).zip(&self.parents) {
            let pivot = Vec3A::from(*rest);
            let turn = Affine3A { matrix3: *rotation, translation: pivot - *rotation * pivot };
            transforms.push(match parent {
                None => turn,
                Some(parent) => transforms[*parent] * turn,
            });
        }
        transforms
    }
}

/// The rotation matrix of an axis-angle vector.
pub(super) fn rotation(pose: PoseAxisAngle) -> Mat3A {
    let angle = pose.0.length();
    // Below this the quadratic term is under f32's resolution, and the axis is noise.
    if angle < 1e-6 {
        let [x, y, z] = pose.0.to_array();
        return Mat3A::from_cols(Vec3A::new(1.0, z, -y), Vec3A::new(-z, 1.0, x), Vec3A::new(y, -x, 1.0));
    }
    Mat3A::from_axis_angle(pose.0 / angle, angle)
}

#[cfg(test)]
mod tests {
    use super::super::families::smplx;
    use super::*;

    #[test]
    fn small_rotations_are_continuous() {
        for angle in [0.0, 0.5e-6, 0.999e-6, 1.001e-6, 2e-6] {
            let axis = Vec3::new(0.6, 0.0, 0.8);
            let matrix = rotation(PoseAxisAngle(axis * angle));
            let turned = matrix * Vec3A::Y;
            assert!((turned - Vec3A::from(Vec3::Y + angle * axis.cross(Vec3::Y))).length() < 1e-7);
        }
    }

    #[test]
    fn a_turned_joint_moves_only_its_descendants_and_keeps_its_own_place() {
        let skeleton = smplx::skeleton();
        let joints = skeleton.joints.len();
        let rest: Vec<Vec3> =
            (0..joints).map(|joint| Vec3::new(joint as f32, (joint * joint % 7) as f32, 0.5)).collect();
        let mut rotations = vec![Mat3A::IDENTITY; joints];
        rotations[16] = rotation(PoseAxisAngle(Vec3::new(0.3, -0.8, 0.4)));
        let transforms = skeleton.bone_transforms(&rest, &rotations);
        assert!((transforms[16].transform_point3(rest[16]) - rest[16]).length() < 1e-4);
        for (joint, transform) in transforms.iter().enumerate() {
            let ancestors = std::iter::successors(Some(joint), |joint| skeleton.parents[*joint]);
            let descends = ancestors.into_iter().any(|ancestor| ancestor == 16);
            assert_eq!(*transform != Affine3A::IDENTITY, descends, "joint {joint}");
        }
    }

    #[test]
    fn joints_at_rest_are_canonical_ones_turned_back() {
        let mut skeleton = smplx::skeleton().clone();
        // Turned joints below turned ones too.
        skeleton.canonical[4] = PoseAxisAngle(Vec3::new(0.2, -0.4, 0.3));
        let rest: Vec<Vec3> = (0..55).map(|joint| Vec3::new(joint as f32, (joint * joint % 7) as f32, 0.5)).collect();
        let rotations: Vec<Mat3A> = skeleton.canonical.iter().map(|pose| rotation(*pose)).collect();
        let transforms = skeleton.bone_transforms(&rest, &rotations);
        let canonical: Vec<Vec3> =
            transforms.iter().zip(&rest).map(|(transform, rest)| transform.transform_point3(*rest)).collect();
        assert!(canonical[10].distance(rest[10]) > 1.0);
        for (found, expected) in skeleton.at_rest(&canonical).iter().zip(&rest) {
            assert!(found.distance(*expected) < 1e-4, "{found}");
        }
        assert_eq!(skeleton.at_rest(&[]), []);
    }

    #[test]
    fn what_does_not_agree_is_named() {
        let broken = |change: fn(&mut Skeleton)| {
            let mut skeleton = smplx::skeleton().clone();
            change(&mut skeleton);
            skeleton.check().unwrap_err().to_string()
        };
        type Change = fn(&mut Skeleton);
        let expected: [(Change, &str); 9] = [
            (|skeleton| skeleton.joints.clear(), "0 joints in 4 parts"),
            (|skeleton| skeleton.parents.truncate(54), "number of parents is 54, expected 55"),
            (|skeleton| skeleton.joints[3] = "pelvis".into(), "pelvis, twice"),
            (|skeleton| skeleton.parents[4] = Some(7), "the parent of left_knee is Some(7)"),
            (|skeleton| skeleton.parents[4] = None, "the parent of left_knee is None"),
            (|skeleton| skeleton.parts[0].joints.retain(|joint| *joint != 4), "that left_knee moves is 0"),
            (|skeleton| skeleton.parts[2].starts.push(4), "the starts of the part left_hand"),
            (|skeleton| skeleton.conditioning.push(55), "55, expected below 55"),
            (|skeleton| skeleton.canonical[1].0.x = f32::NAN, "the canonical rotation of left_hip"),
        ];
        for (change, message) in expected {
            let found = broken(change);
            assert!(found.contains(message), "{found}");
        }
        assert!(smplx::skeleton().check().is_ok());
    }
}
