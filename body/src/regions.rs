//! Regions of the body's surface, finer than its parts, by which errors are told apart: feet, legs, torso, arms, head, hands, face.
//!
//! A vertex of a hand or a face belongs to it, as its part's label says; any other to the region of the joint with its largest
//! skinning weight, by the joints' names. V vertices, J joints.

use serde::{Deserialize, Serialize};

use super::{BodyModel, PartLabels, Role};

/// A region of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// From the ankles on.
    Feet,
    /// Thighs and shins.
    Legs,
    /// Pelvis, spine and collars; whatever no name places elsewhere.
    Torso,
    /// Upper arms and forearms.
    Arms,
    /// Neck and scalp, as far as they are not labelled as face.
    Head,
    /// Hands, from the wrists on.
    Hands,
    /// What is labelled as face.
    Face,
    /// Farther from the registered body than skin and tight clothes are: hair, skirts, boots.
    OffBody,
}

impl Region {
    /// All of them, from the ground up.
    pub const ALL: [Self; 8] =
        [Self::Feet, Self::Legs, Self::Torso, Self::Arms, Self::Head, Self::Hands, Self::Face, Self::OffBody];

    /// The region of each vertex (V) of a body.
    #[must_use]
    pub fn of_vertices(body: &BodyModel, labels: &PartLabels) -> Vec<Self> {
        let skeleton = body.skeleton();
        let largest = |row: &[f32]| (0..row.len()).max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap_or(0);
        let rows = body.skinning_weights().chunks_exact(skeleton.joints.len());
        let region = |(row, part): (&[f32], _)| match skeleton.role(part) {
            Role::Hands => Self::Hands,
            Role::Face => Self::Face,
            Role::Body => Self::of_joint(&skeleton.joints[largest(row)]),
        };
        rows.zip(labels.parts.iter().copied()).map(region).collect()
    }

    /// The region that a joint moves, by the names that SMPL's descendants share.
    fn of_joint(name: &str) -> Self {
        let rest = name.strip_prefix("left_").or(name.strip_prefix("right_")).unwrap_or(name);
        match rest {
            "hip" | "knee" => Self::Legs,
            "ankle" | "foot" => Self::Feet,
            "shoulder" | "elbow" => Self::Arms,
            "neck" | "head" | "jaw" | "eye" => Self::Head,
            // Where wrists and fingers are a part of the body.
            "wrist" | "hand" => Self::Hands,
            _ => Self::Torso,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smplx;

    #[test]
    fn joints_of_both_sides_are_in_the_region_that_they_move() {
        let names = |region: Region| -> Vec<&str> {
            let joints = smplx::skeleton().joints.iter().map(String::as_str);
            joints.take(22).filter(|name| Region::of_joint(name) == region).collect()
        };
        assert_eq!(names(Region::Feet), ["left_ankle", "right_ankle", "left_foot", "right_foot"]);
        assert_eq!(names(Region::Legs), ["left_hip", "right_hip", "left_knee", "right_knee"]);
        assert_eq!(names(Region::Arms), ["left_shoulder", "right_shoulder", "left_elbow", "right_elbow"]);
        assert_eq!(names(Region::Head), ["neck", "head"]);
        assert_eq!(names(Region::Torso).len(), 6, "pelvis, three of the spine, two collars");
    }
}
