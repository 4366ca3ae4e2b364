//! Which part each vertex of an imported body is: hands by their joints, the face by where it is on the head, and what is known to be inside of it.

use glam::DVec3;

use crate::smplx::joint;
use crate::{Part, PartLabelSource, PartLabels, smplx};
use xavatar_formats::ArrayMap;

/// The face begins so far before the head's joint, ends so far above the eyes and below the lowest vertex of the jaw, metres.
const BEFORE_HEAD: f64 = 0.012;
const ABOVE_EYES: f64 = 0.065;
const BELOW_JAW: f64 = 0.005;

/// The lists of vertices of the parts, for vertices (V), of which some are inside the face, joints (55) and weights (V, 55).
pub(crate) fn of_parts(
    template: &[DVec3],
    joints: &[DVec3],
    weights: &[Vec<f64>],
    is_inside: impl Fn(usize) -> bool,
) -> ArrayMap {
    let skeleton = smplx::skeleton();
    let part = |name: &str| skeleton.part_named(name).unwrap_or_default();
    let sum = |row: &[f64], of: &[usize]| of.iter().map(|joint| row[*joint]).sum::<f64>();
    let hand =
        |wrist: usize, fingers: std::ops::Range<usize>| std::iter::once(wrist).chain(fingers).collect::<Vec<_>>();
    let hands = [
        (part("left_hand"), hand(joint::LEFT_WRIST, joint::LEFT_HAND)),
        (part("right_hand"), hand(joint::RIGHT_WRIST, joint::RIGHT_HAND)),
    ];
    let eyes = [joint::LEFT_EYE, joint::RIGHT_EYE];
    let head = [joint::HEAD, joint::JAW, joint::LEFT_EYE, joint::RIGHT_EYE];
    let top = (joints[eyes[0]].y + joints[eyes[1]].y) / 2.0 + ABOVE_EYES;
    let of_jaw = template.iter().zip(weights).filter(|(_, row)| row[joint::JAW] > 0.5);
    let bottom = of_jaw.map(|(vertex, _)| vertex.y).fold(f64::INFINITY, f64::min) - BELOW_JAW;
    let label = |vertex: usize| -> (Part, bool) {
        let (place, row) = (template[vertex], &weights[vertex]);
        if let Some((part, _)) = hands.iter().find(|(_, hand)| sum(row, hand) > 0.5) {
            return (*part, false);
        }
        let is_inside = is_inside(vertex) || sum(row, &eyes) > 0.5;
        let is_before = place.z > joints[joint::HEAD].z + BEFORE_HEAD && (bottom..top).contains(&place.y);
        match sum(row, &head) > 0.5 && (is_inside || is_before) {
            true => (part("face"), is_inside),
            false => (part("body"), false),
        }
    };
    let (parts, detail) = (0..template.len()).map(label).unzip();
    PartLabels { parts, detail, source: PartLabelSource::SkinningWeights }.to_vertex_labels(skeleton)
}
