//! What programs expect of a skeleton beside the format: which way bones point, and a node that moves the figure.
//!
//! A joint's frame may be turned by any Q_j without anything moving: with R_j its local rotation and l_j its place in its parent's frame,
//!
//! ```text
//! R'_j = Q_p^-1 R_j Q_j,   l'_j = Q_p^-1 l_j,   InvBind'_j = Q_j^-1 InvBind_j,   so G'_j InvBind'_j = G_j InvBind_j
//! ```
//!
//! for the parent p of j (Q_p is the identity above the root). Bones along limbs are those whose Q_j turns an axis toward the child.

use glam::{Affine3A, Quat, Vec3};

use super::rig::{Joint, RiggedMesh};

/// A shorter bone points nowhere, metres.
const SHORTEST_BONE: f32 = 1e-4;

/// A program that an avatar is written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Bones lie along the limbs by their Y axes, as Blender draws them.
    Blender,
    /// Bones are upright; a node `Armature` at the origin moves the figure.
    Unity,
    /// Bones lie along the limbs by their X axes, as in Epic's mannequins; a node `root` at the origin moves the figure.
    Unreal,
    /// Bones are upright.
    Godot,
}

/// The axis of a joint's frame that runs along its bone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoneAxis {
    /// X.
    X,
    /// Y.
    Y,
}

impl Engine {
    /// Which way its bones point; none if upright.
    pub fn bone_axis(self) -> Option<BoneAxis> {
        match self {
            Self::Blender => Some(BoneAxis::Y),
            Self::Unreal => Some(BoneAxis::X),
            Self::Unity | Self::Godot => None,
        }
    }

    /// What it calls the node above the skeleton.
    pub fn root(self) -> Option<&'static str> {
        match self {
            Self::Unity => Some("Armature"),
            Self::Unreal => Some("root"),
            Self::Blender | Self::Godot => None,
        }
    }
}

impl BoneAxis {
    fn direction(self) -> Vec3 {
        match self {
            Self::X => Vec3::X,
            Self::Y => Vec3::Y,
        }
    }
}

impl RiggedMesh {
    /// The rig as an engine expects it; it moves as before.
    #[must_use]
    pub fn for_engine(mut self, engine: Engine) -> Self {
        self.root = engine.root().map(str::to_owned);
        match engine.bone_axis() {
            Some(axis) => self.with_bones_along(axis),
            None => self,
        }
    }

    /// The rig with bones along the limbs: an axis of each joint's frame points at the joint's child, or away from its parent where there is
    /// none; between several children. It moves as before, but only the clip's rotations are those of its joints now.
    #[must_use]
    pub fn with_bones_along(mut self, axis: BoneAxis) -> Self {
        let turns: Vec<Quat> = bones(&self.joints)
            .into_iter()
            .map(|bone| bone.map_or(Quat::IDENTITY, |bone| Quat::from_rotation_arc(axis.direction(), bone)))
            .collect();
        let above: Vec<Quat> =
            self.joints.iter().map(|joint| joint.parent.map_or(Quat::IDENTITY, |parent| turns[parent])).collect();
        let turned = |joint: usize, rotation: Quat| (above[joint].inverse() * rotation * turns[joint]).normalize();
        for (index, joint) in self.joints.iter_mut().enumerate() {
            joint.translation = above[index].inverse() * joint.translation;
            joint.rotation = turned(index, joint.rotation);
            joint.inverse_bind = Affine3A::from_quat(turns[index].inverse()) * joint.inverse_bind;
        }
        for rotations in &mut self.animation.rotations {
            rotations.iter_mut().enumerate().for_each(|(joint, rotation)| *rotation = turned(joint, *rotation));
        }
        self
    }
}

/// Where each joint's bone points, in its own frame, whose axes are parallel to the world's in the rest pose.
fn bones(joints: &[Joint]) -> Vec<Option<Vec3>> {
    let mut sums = vec![Vec3::ZERO; joints.len()];
    for joint in joints {
        if let Some(parent) = joint.parent {
            sums[parent] += joint.translation;
        }
    }
    let bone = |(joint, sum): (&Joint, Vec3)| {
        let along = [sum, joint.translation].into_iter().find(|along| along.length() > SHORTEST_BONE)?;
        along.try_normalize()
    };
    joints.iter().zip(sums).map(bone).collect()
}
