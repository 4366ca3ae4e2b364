//! The body cut into limbs: which vertices, faces and bones each has.
//!
//! A vertex belongs to the limb of the joint with its largest skinning weight. V vertices, F faces.

use glam::Vec3;

use super::surface_points::SurfacePoints;

use xavatar_body::{BodyModel, PosedBody};

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
    of_faces: Vec<Limb>,
    /// Joints and their parents between which a line lies deep in a limb: the limb, the parent, the joint.
    bones: Vec<(Limb, usize, usize)>,
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

    /// Whether the other limbs hang on it.
    pub fn is_trunk(self) -> bool {
        self.name() == "torso"
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

    /// The limb of a joint, by the names that SMPL's descendants share.
    fn of_joint(name: &str) -> Self {
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
        let skeleton = body.skeleton();
        let largest = |row: &[f32]| (0..row.len()).max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap_or(0);
        let rows = body.skinning_weights().chunks_exact(skeleton.joints.len());
        let of_vertices: Vec<Limb> = rows.map(|row| Limb::of_joint(&skeleton.joints[largest(row)])).collect();
        let bone = |joint: usize| {
            let parent = skeleton.parents[joint]?;
            let name = &skeleton.joints[parent];
            let limb = Limb::of_joint(name);
            // Fingers are too thin, and jaw and eyes too near to the surface.
            let in_finger = limb.is_bare() && !name.ends_with("wrist");
            (!in_finger && name != "head").then_some((limb, parent, joint))
        };
        Self {
            // A face at a border belongs to the limb of its first corner.
            of_faces: body.faces().iter().map(|face| of_vertices[face[0] as usize]).collect(),
            bones: (0..skeleton.joints.len()).filter_map(bone).collect(),
        }
    }

    /// The limb of one of the points of a body's surface.
    pub fn limb_at(&self, body: &SurfacePoints, point: usize) -> Limb {
        self.of_faces[body.faces[point] as usize]
    }

    /// Points inside a posed body, deep in each limb.
    pub fn cores(&self, body: &PosedBody) -> impl Iterator<Item = (Limb, Vec3)> {
        self.bones.iter().flat_map(|&(limb, parent, joint)| {
            ALONG_BONE.map(|share| (limb, body.joints[parent].lerp(body.joints[joint], share)))
        })
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
            assert_eq!(Limb::of_joint(joint).name(), limb, "{joint}");
        }
    }
}
