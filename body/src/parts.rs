//! Part groups: which joints a point's correspondence search starts from (thesis A.3.2), and which vertices are which part.
//!
//! A scan point's part is that of its nearest registered body vertex. V vertices.

use super::skeleton::JOINTS;

/// A part of the body with its own group of bones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// Torso, arms and legs.
    Body,
    /// Head and neck, eyes and mouth included.
    Face,
    /// Left hand from the wrist on.
    LeftHand,
    /// Right hand from the wrist on.
    RightHand,
}

/// The starts of a point whose part is not known.
pub const FULL_GROUP: [usize; 45] = {
    let mut joints = [0; 45];
    let body = [0, 1, 2, 4, 5, 15, 16, 17, 18, 19];
    let mut at = 0;
    while at < 45 {
        joints[at] = if at < body.len() { body[at] } else { 20 + at - body.len() };
        at += 1;
    }
    joints
};

impl Part {
    /// All parts.
    pub const ALL: [Self; 4] = [Self::Body, Self::Face, Self::LeftHand, Self::RightHand];

    /// The joints that the search for a point of this part starts from.
    pub const fn joints(self) -> &'static [usize] {
        match self {
            Self::Body => &[0, 1, 2, 4, 5, 16, 17, 18, 19],
            Self::Face => &[12, 15, 22],
            Self::LeftHand => &[20, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39],
            Self::RightHand => &[21, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51, 52, 53, 54],
        }
    }

    /// The part that a joint moves: neck, head, jaw and eyes are the face; a wrist belongs to its hand.
    pub const fn of_joint(joint: usize) -> Self {
        match joint {
            12 | 15 | 22..=24 => Self::Face,
            20 | 25..=39 => Self::LeftHand,
            21 | 40..=54 => Self::RightHand,
            _ => Self::Body,
        }
    }
}

/// Where part labels come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PartLabelSource {
    /// X-Avatar's `*_vertex_labels.pkl`.
    VertexLabels(std::path::PathBuf),
    /// The official `MANO_SMPLX_vertex_ids.pkl` and `SMPL-X__FLAME_vertex_ids.npy` of this folder.
    ManoAndFlame(std::path::PathBuf),
    /// The group of the joint with the largest skinning weight: no file was found.
    SkinningWeights,
}

impl std::fmt::Display for PartLabelSource {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::VertexLabels(path) => write!(formatter, "{}", path.display()),
            Self::ManoAndFlame(folder) => write!(formatter, "the MANO and FLAME vertex ids in {}", folder.display()),
            Self::SkinningWeights => formatter.write_str("the largest skinning weight"),
        }
    }
}

/// The part of each vertex, and which of them are eyes or mouth.
#[derive(Clone, Debug, PartialEq)]
pub struct PartLabels {
    /// (V).
    pub parts: Vec<Part>,
    /// Vertices of eyes and mouth (V), sampled densely; from skinning weights or FLAME ids, the eyeballs only.
    pub eyes_mouth: Vec<bool>,
    /// What the labels were read from.
    pub source: PartLabelSource,
}

impl PartLabels {
    /// The part of the joint with the largest weight of each vertex; `weights` (V, J).
    pub fn from_skinning_weights(weights: &[f32]) -> Self {
        let joints: Vec<usize> = weights.chunks_exact(JOINTS).map(largest).collect();
        Self {
            parts: joints.iter().map(|joint| Part::of_joint(*joint)).collect(),
            eyes_mouth: joints.iter().map(|joint| matches!(joint, 23 | 24)).collect(),
            source: PartLabelSource::SkinningWeights,
        }
    }

    /// The vertices of one part, in ascending order.
    pub fn vertices_of(&self, part: Part) -> Vec<usize> {
        (0..self.parts.len()).filter(|vertex| self.parts[*vertex] == part).collect()
    }
}

/// The first of the largest.
fn largest(weights: &[f32]) -> usize {
    (0..weights.len()).rev().max_by(|a, b| weights[*a].total_cmp(&weights[*b])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_starts_from_joints_that_move_its_own_part() {
        for part in Part::ALL {
            assert!(part.joints().iter().all(|joint| Part::of_joint(*joint) == part), "{part:?}");
        }
        let hands = Part::LeftHand.joints().iter().chain(Part::RightHand.joints());
        assert!(hands.chain(Part::Body.joints()).all(|joint| FULL_GROUP.contains(joint)));
        assert_eq!(FULL_GROUP[9..12], [19, 20, 21]);
        assert_eq!(FULL_GROUP[44], 54);
    }

    #[test]
    fn the_largest_weight_decides() {
        let mut weights = vec![0.0; 3 * JOINTS];
        weights[3] = 1.0;
        weights[JOINTS + 15] = 0.4;
        weights[JOINTS + 23] = 0.6;
        weights[2 * JOINTS + 19] = 0.5;
        weights[2 * JOINTS + 21] = 0.5;
        let labels = PartLabels::from_skinning_weights(&weights);
        assert_eq!(labels.parts, [Part::Body, Part::Face, Part::Body]);
        assert_eq!(labels.eyes_mouth, [false, true, false]);
    }
}
