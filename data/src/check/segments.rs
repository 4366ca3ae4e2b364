//! The body cut into limbs: which vertices, faces and bones each has.
//!
//! A vertex belongs to the limb of the joint with its largest skinning weight. V vertices, F faces.

use glam::Vec3;

use xavatar_body::{BodyModel, JOINT_NAMES, JOINTS, PARENTS, PosedBody};

/// The limbs, in the order in which they are reported.
const LIMBS: [&str; 14] = [
    "head",
    "torso",
    "left upper arm",
    "right upper arm",
    "left forearm",
    "right forearm",
    "left hand",
    "right hand",
    "left thigh",
    "right thigh",
    "left shin",
    "right shin",
    "left foot",
    "right foot",
];
/// Where along a bone a point is surely inside the body.
const ALONG_BONE: [f32; 3] = [0.35, 0.5, 0.65];

/// A limb of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Limb(usize);

/// The limbs of a body model.
pub(super) struct Segments {
    /// The limb of each face (F).
    pub of_faces: Vec<Limb>,
}

impl Limb {
    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..LIMBS.len()).map(Self)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        LIMBS[self.0]
    }

    /// Its place among all.
    pub fn index(self) -> usize {
        self.0
    }

    /// Whether clothes leave it as it is: the hands.
    pub fn is_bare(self) -> bool {
        self.name().ends_with("hand")
    }

    /// Whether hair or a garment may surround it widely: head, torso, thighs and shins.
    pub fn may_be_wide(self) -> bool {
        let name = self.name();
        matches!(name, "head" | "torso") || name.ends_with("thigh") || name.ends_with("shin")
    }

    fn of_joint(joint: usize) -> Self {
        let name = JOINT_NAMES[joint];
        let (side, rest) = name.split_once('_').unwrap_or(("", name));
        let limb = match rest {
            "hip" => "thigh",
            "knee" => "shin",
            "ankle" | "foot" => "foot",
            "shoulder" => "upper arm",
            "elbow" => "forearm",
            "wrist" => "hand",
            "neck" | "head" | "jaw" | "eye" => "head",
            _ if rest.ends_with(['1', '2', '3']) && !side.is_empty() => "hand",
            _ => "torso",
        };
        let is_named = |name: &&str| *name == limb || name.split_once(' ') == Some((side, limb));
        Self(LIMBS.iter().position(is_named).unwrap_or(1))
    }
}

impl Segments {
    pub fn of(body: &BodyModel) -> Self {
        let largest = |row: &[f32]| (0..row.len()).max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap_or(0);
        let of_vertices: Vec<Limb> =
            body.skinning_weights().chunks_exact(JOINTS).map(|row| Limb::of_joint(largest(row))).collect();
        // A face at a border belongs to the limb of its first corner.
        Self { of_faces: body.faces().iter().map(|face| of_vertices[face[0] as usize]).collect() }
    }

    /// Points inside a posed body, deep in each limb.
    pub fn cores(body: &PosedBody) -> Vec<(Limb, Vec3)> {
        let mut cores = Vec::new();
        for joint in 1..JOINTS {
            let parent = PARENTS[joint];
            let (name, limb) = (JOINT_NAMES[parent], Limb::of_joint(parent));
            // Fingers are too thin, and jaw and eyes too near to the surface.
            let in_finger = limb.is_bare() && !name.ends_with("wrist");
            if !in_finger && name != "head" {
                cores.extend(ALONG_BONE.map(|share| (limb, body.joints[parent].lerp(body.joints[joint], share))));
            }
        }
        cores
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_joint_has_the_limb_that_it_moves() {
        for (joint, limb) in [
            ("pelvis", "torso"),
            ("spine3", "torso"),
            ("left_collar", "torso"),
            ("jaw", "head"),
            ("right_eye", "head"),
            ("neck", "head"),
            ("left_shoulder", "left upper arm"),
            ("right_elbow", "right forearm"),
            ("left_wrist", "left hand"),
            ("right_thumb3", "right hand"),
            ("left_index1", "left hand"),
            ("right_hip", "right thigh"),
            ("left_knee", "left shin"),
            ("right_ankle", "right foot"),
            ("left_foot", "left foot"),
        ] {
            let number = JOINT_NAMES.iter().position(|name| *name == joint).unwrap();
            assert_eq!(Limb::of_joint(number).name(), limb, "{joint}");
        }
    }
}
