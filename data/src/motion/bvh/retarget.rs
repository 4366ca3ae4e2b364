//! Another skeleton's rotations, as SMPL-X's.
//!
//! A BVH file at rest stands in a pose of its own, with its own axes; SMPL-X rests in a T-pose, Y up, facing +Z. With W_b(t) the
//! rotation of bone b in the file's world, C the turn from the file's axes to SMPL-X's, both found from the skeleton at rest,
//! and A_j the turn from SMPL-X's bone at rest to the file's,
//!
//! F_j(t) = W_b(t) C^-1 A_j,    theta_j = F_parent(j)^-1 F_j,
//!
//! so that a bone points where the file's does. A_j is the smallest such turn on top of the parent's for upper arms, forearms,
//! thighs, shins and fingers; hands keep the forearm's; all other joints are assumed to rest as SMPL-X's do: back and head
//! upright, collar bones sideways, feet flat and pointing forward. Joints without a bone follow their parents. Bone lengths are
//! the avatar's; the path is scaled by the ratio of the legs, which settles the file's unit too. Double precision.

use glam::{DMat3, DQuat, DVec3, Vec3};

use super::names::Bones;
use super::parse::Bvh;
use super::{RestPose, joint_names};
use crate::motion::UpAxis;
use xavatar_body::{Pose, PoseAxisAngle, smplx};

/// Without these there is no person: pelvis, hips, knees, ankles, shoulders, elbows.
const REQUIRED: [usize; 11] = [0, 1, 2, 4, 5, 7, 8, 16, 17, 18, 19];
/// Joints whose bones are turned to point as the file's, and where each bone ends.
const ALIGNED: [(usize, usize); 28] = [
    (1, 4),
    (2, 5),
    (4, 7),
    (5, 8),
    (16, 18),
    (17, 19),
    (18, 20),
    (19, 21),
    (25, 26),
    (26, 27),
    (28, 29),
    (29, 30),
    (31, 32),
    (32, 33),
    (34, 35),
    (35, 36),
    (37, 38),
    (38, 39),
    (40, 41),
    (41, 42),
    (43, 44),
    (44, 45),
    (46, 47),
    (47, 48),
    (49, 50),
    (50, 51),
    (52, 53),
    (53, 54),
];
/// Above this, the report says that the rest poses differ, degrees.
const NOTABLE_TURN: f64 = 20.0;

/// A file's skeleton, matched with SMPL-X's.
pub(super) struct Retargeting<'a> {
    bvh: &'a Bvh,
    bones: Bones,
    /// C^-1: its columns are left, up and forward in the file's axes.
    from_smplx: DQuat,
    /// A_j.
    alignment: Vec<DQuat>,
    /// Metres of the avatar per unit of the file.
    scale: f64,
    pelvis: DVec3,
}

impl<'a> Retargeting<'a> {
    /// Matches the skeletons, or says which joints have no bone.
    pub(super) fn new(bvh: &'a Bvh, bones: Bones, rest: &RestPose) -> Result<Self, Vec<&'static str>> {
        let missing = joint_names(REQUIRED.into_iter().filter(|joint| bones[*joint].is_none()));
        if !missing.is_empty() {
            return Err(missing);
        }
        let places = rest_places(bvh);
        let place = |joint: usize| bones[joint].map(|bone| places[bone]);
        let bone = |places: &dyn Fn(usize) -> Option<DVec3>, from, to| Some(places(to)? - places(from)?);
        let own = |joint: usize| Some(rest.joints()[joint].as_dvec3());

        let axes = axes(&place).ok_or_else(|| vec!["a body that stands on two legs apart from each other"])?;
        let from_smplx = DQuat::from_mat3(&axes);
        let parents = &smplx::skeleton().parents;
        let mut alignment = vec![DQuat::IDENTITY; parents.len()];
        for (joint, parent) in parents.iter().enumerate().filter_map(|(joint, parent)| Some((joint, (*parent)?))) {
            // Hands and fingers go with the arm; what else is not aligned rests upright.
            let inherited = if is_of_limb(joint) { alignment[parent] } else { DQuat::IDENTITY };
            let end = ALIGNED.iter().find(|(aligned, _)| *aligned == joint).map(|(_, end)| *end);
            let turn = end.and_then(|end| {
                let wanted = axes.transpose() * bone(&place, joint, end)?;
                let (from, to) = (inherited * bone(&own, joint, end)?.try_normalize()?, wanted.try_normalize()?);
                Some(DQuat::from_rotation_arc(from, to))
            });
            alignment[joint] = turn.unwrap_or(DQuat::IDENTITY) * inherited;
        }
        let legs = |places: &dyn Fn(usize) -> Option<DVec3>| -> f64 {
            let bones = [(1, 4), (4, 7), (2, 5), (5, 8)].map(|(from, to)| bone(places, from, to));
            bones.into_iter().flatten().map(DVec3::length).sum()
        };
        let (file, avatar) = (legs(&place), legs(&own));
        let scale = if file > 0.0 && avatar > 0.0 { avatar / file } else { 1.0 };
        Ok(Self { bvh, bones, from_smplx, alignment, scale, pelvis: rest.pelvis().as_dvec3() })
    }

    /// SMPL-X parameters of each frame, in the file's axes; at least one.
    pub(super) fn frames(&self) -> Vec<smplx::Parameters> {
        self.bvh.frames().map(|row| self.frame(row)).collect()
    }

    /// The file's axis that its skeleton at rest stands along.
    pub(super) fn up(&self) -> UpAxis {
        let up = self.from_smplx * DVec3::Y;
        let axes = [UpAxis::Y, UpAxis::Z, UpAxis::MinusY];
        axes.into_iter().find(|axis| up.dot(axis.direction().as_dvec3()) > 0.5).unwrap_or_default()
    }

    /// What became of the bones, a line each.
    pub(super) fn report(&self) -> Vec<String> {
        let joints = &self.bvh.joints;
        let mapped = self.bones.iter().enumerate().filter_map(|(joint, bone)| Some((joint, (*bone)?)));
        let pairs =
            |(joint, bone): (usize, usize)| format!("{} -> {}", joints[bone].name, joint_names([joint].into_iter())[0]);
        let pairs: Vec<String> = mapped.map(pairs).collect();
        let ignored = (0..joints.len()).filter(|bone| !self.bones.contains(&Some(*bone)));
        let ignored: Vec<&str> = ignored.map(|bone| joints[bone].name.as_str()).collect();
        let unmapped = joint_names((0..self.bones.len()).filter(|joint| self.bones[*joint].is_none()));
        let turn = |joint: &usize| self.alignment[*joint].angle_between(DQuat::IDENTITY).to_degrees();
        let turned: Vec<String> = [16, 17, 1, 2]
            .iter()
            .filter(|joint| turn(joint) > NOTABLE_TURN)
            .map(|joint| format!("{} {:.0} degrees", joint_names([*joint].into_iter())[0], turn(joint)))
            .collect();
        let mut report = vec![format!("bones: {} of {} used: {}", pairs.len(), joints.len(), pairs.join(", "))];
        if !ignored.is_empty() {
            report.push(format!("bones left out (their turns go to the next bone below): {}", ignored.join(", ")));
        }
        if !unmapped.is_empty() {
            report.push(format!("joints without a bone, which follow their parents: {}", unmapped.join(", ")));
        }
        if !turned.is_empty() {
            report.push(format!("rest pose: not a T-pose, aligned: {}", turned.join(", ")));
        }
        report.push(format!("scale: 1 unit is {:.4} m, by the length of the legs", self.scale));
        report
    }

    fn frame(&self, row: &[f64]) -> smplx::Parameters {
        let bvh = self.bvh;
        let mut world: Vec<(DQuat, DVec3)> = Vec::with_capacity(bvh.joints.len());
        for (bone, joint) in bvh.joints.iter().enumerate() {
            let (turn, place) = joint.parent.map_or((DQuat::IDENTITY, DVec3::ZERO), |parent| world[parent]);
            let rotation = (turn * bvh.rotation(bone, row)).normalize();
            world.push((rotation, place + turn * bvh.place(bone, row)));
        }
        let parents = &smplx::skeleton().parents;
        let above = |facing: &[DQuat], joint: usize| parents[joint].map_or(DQuat::IDENTITY, |parent| facing[parent]);
        let mut facing = Vec::with_capacity(parents.len());
        for (joint, bone) in self.bones.iter().enumerate() {
            facing.push(match bone {
                Some(bone) => world[*bone].0 * self.from_smplx * self.alignment[joint],
                None => above(&facing, joint),
            });
        }
        let turn = |joint: usize| {
            let parent = above(&facing, joint);
            let turn = parent.inverse() * facing[joint];
            let turn = if turn.w < 0.0 { -turn } else { turn };
            PoseAxisAngle(turn.to_scaled_axis().as_vec3())
        };
        let transl = self.bones[0].map_or(Vec3::ZERO, |bone| (world[bone].1 * self.scale - self.pelvis).as_vec3());
        let rotations = (0..parents.len()).map(turn).collect();
        smplx::Parameters::from(&Pose { rotations, translation: transl, ..Pose::default() })
    }
}

/// Where the file's joints are when nothing is turned.
fn rest_places(bvh: &Bvh) -> Vec<DVec3> {
    let mut places: Vec<DVec3> = Vec::with_capacity(bvh.joints.len());
    for joint in &bvh.joints {
        let parent = joint.parent.map_or(DVec3::ZERO, |parent| places[parent]);
        places.push(parent + joint.offset);
    }
    places
}

/// Left, up and forward of the skeleton at rest, as the nearest axes of its world.
fn axes(place: &dyn Fn(usize) -> Option<DVec3>) -> Option<DMat3> {
    let middle = |left: usize, right: usize| Some((place(left)? + place(right)?) * 0.5);
    let up = nearest_axis(middle(16, 17)? - middle(7, 8)?)?;
    let left = place(1)? - place(2)?;
    let left = nearest_axis(left - up * left.dot(up))?;
    Some(DMat3::from_cols(left, up, left.cross(up)))
}

/// The axis, with its sign, that is closest to a direction.
fn nearest_axis(direction: DVec3) -> Option<DVec3> {
    let sizes = direction.abs();
    let axis = if sizes.x > sizes.y && sizes.x > sizes.z {
        DVec3::X
    } else if sizes.y > sizes.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let along = direction.dot(axis);
    (along.abs() > 1e-9).then(|| axis * along.signum())
}

/// Below a shoulder or a hip, but for feet.
fn is_of_limb(joint: usize) -> bool {
    matches!(joint, 4 | 5 | 18..=21 | 25..)
}
