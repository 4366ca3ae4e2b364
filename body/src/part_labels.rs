//! Which part of its body each vertex of a model is. V vertices.
//!
//! A scan point's part is that of its nearest registered body vertex.

use super::{BodyModel, Part};

/// Where part labels come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PartLabelSource {
    /// X-Avatar's `*_vertex_labels.pkl`.
    VertexLabels(std::path::PathBuf),
    /// The official `MANO_SMPLX_vertex_ids.pkl` and `SMPL-X__FLAME_vertex_ids.npy` of this folder.
    ManoAndFlame(std::path::PathBuf),
    /// The part of the joint with the largest skinning weight: no file was found.
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

/// The part of each vertex, and which of them are its [`Detail`](super::Detail).
#[derive(Clone, Debug, PartialEq)]
pub struct PartLabels {
    /// (V).
    pub parts: Vec<Part>,
    /// Vertices of eyes and mouth (V), sampled densely; from skinning weights or FLAME ids, the eyeballs only.
    pub detail: Vec<bool>,
    /// What the labels were read from.
    pub source: PartLabelSource,
}

impl PartLabels {
    /// The part of the joint with the largest weight of each vertex.
    pub fn from_skinning_weights(model: &BodyModel) -> Self {
        let skeleton = model.skeleton();
        let parts = skeleton.parts_of_joints();
        let is_detail = |joint: usize| {
            let detail = skeleton.parts[parts[joint].index()].detail.as_ref();
            detail.is_some_and(|detail| detail.joints.contains(&joint))
        };
        let rows = model.skinning_weights().chunks_exact(skeleton.joints.len());
        let joints: Vec<usize> = rows.map(largest).collect();
        Self {
            parts: joints.iter().map(|joint| parts[*joint]).collect(),
            detail: joints.iter().map(|joint| is_detail(*joint)).collect(),
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
    use super::super::families::smplx::{self, tests::model_of_weights};
    use super::*;

    #[test]
    fn the_largest_weight_decides() {
        let joints = smplx::skeleton().joints.len();
        let mut weights = vec![0.0; 3 * joints];
        weights[3] = 1.0;
        weights[joints + 15] = 0.4;
        weights[joints + 23] = 0.6;
        weights[2 * joints + 19] = 0.5;
        weights[2 * joints + 21] = 0.5;
        let labels = PartLabels::from_skinning_weights(&model_of_weights(weights));
        let [body, face] = ["body", "face"].map(|name| smplx::skeleton().part_named(name).unwrap());
        assert_eq!(labels.parts, [body, face, body]);
        assert_eq!(labels.detail, [false, true, false]);
    }
}
