//! A skeleton whose bones have lengths of their own, and stretch what hangs on them.
//!
//! Bone j runs from its parent p to joint j and has the scale b_j; the root's is 1. M_j = M_p R_j, P_j = P_p + b_j M_p O_j; what follows joint j
//! is as large as its matter's bone: A_j = [b_m(j) M_j | P_j - b_m(j) M_j J_j], J_j the joint at rest. One rotation a joint, also where bones
//! branch: on a chain it is Wang's product of [s R | s R O] (5.3).

use glam::{DMat3, DVec3};

/// Offsets and matter of a tree of joints (J).
#[derive(Clone, Debug, PartialEq)]
pub struct ScaledSkeleton {
    /// The joint that each hangs on, which comes before it; none for the root.
    pub parents: Vec<Option<usize>>,
    /// From the parent at rest; the root's from the origin.
    pub offsets: Vec<DVec3>,
    /// The bone that each joint's flesh is as large as.
    pub matter: Vec<usize>,
}

/// A skeleton in a pose (J).
#[derive(Clone, Debug, PartialEq)]
pub struct PosedSkeleton {
    /// M.
    pub turns: Vec<DMat3>,
    /// P.
    pub places: Vec<DVec3>,
    /// b of the matter.
    pub sizes: Vec<f64>,
    /// J.
    pub rest: Vec<DVec3>,
}

impl ScaledSkeleton {
    /// Of joints at rest (J) with these names. Flesh is as large as the bone that leaves its joint: of several the neck, the middle finger or the
    /// first; at a leaf and at the head it is as large as the bone that ends there.
    pub fn of(names: &[String], parents: &[Option<usize>], rest: &[DVec3]) -> Self {
        let offset = |(joint, parent): (usize, &Option<usize>)| rest[joint] - parent.map_or(DVec3::ZERO, |at| rest[at]);
        let is_of_face = |joint: usize| ["jaw", "eye"].iter().any(|word| names[joint].contains(word));
        let matter = |joint: usize| {
            let mut children = (0..parents.len()).filter(|child| parents[*child] == Some(joint) && !is_of_face(*child));
            let is_main = |child: &usize| names[*child] == "neck" || names[*child].contains("middle");
            match (parents[joint], children.clone().find(is_main).or(children.next())) {
                (None, _) | (_, None) => joint,
                (_, Some(child)) => child,
            }
        };
        Self {
            offsets: parents.iter().enumerate().map(offset).collect(),
            matter: (0..parents.len()).map(matter).collect(),
            parents: parents.to_vec(),
        }
    }

    /// The joints at rest (J).
    pub fn rest(&self) -> Vec<DVec3> {
        let mut rest: Vec<DVec3> = Vec::with_capacity(self.offsets.len());
        for (offset, parent) in self.offsets.iter().zip(&self.parents) {
            rest.push(*offset + parent.map_or(DVec3::ZERO, |parent| rest[parent]));
        }
        rest
    }

    /// With bones of these scales (J) and rotations (J), the root moved by `translation`.
    pub fn posed(&self, scales: &[f64], rotations: &[DMat3], translation: DVec3) -> PosedSkeleton {
        let (mut turns, mut places): (Vec<DMat3>, Vec<DVec3>) = Default::default();
        for (joint, parent) in self.parents.iter().enumerate() {
            let (turn, place) = match parent {
                None => (DMat3::IDENTITY, translation + self.offsets[joint]),
                Some(parent) => {
                    (turns[*parent], places[*parent] + turns[*parent] * self.offsets[joint] * scales[joint])
                }
            };
            turns.push(turn * rotations[joint]);
            places.push(place);
        }
        let sizes = self.matter.iter().map(|bone| scales[*bone]).collect();
        PosedSkeleton { turns, places, sizes, rest: self.rest() }
    }
}

impl PosedSkeleton {
    /// A_j of a place at rest.
    pub fn moved(&self, joint: usize, place: DVec3) -> DVec3 {
        self.turns[joint] * (place - self.rest[joint]) * self.sizes[joint] + self.places[joint]
    }

    /// A (J) as a matrix and what is added to it.
    pub fn transforms(&self) -> Vec<(DMat3, DVec3)> {
        let transform = |joint: usize| (self.turns[joint] * self.sizes[joint], self.moved(joint, DVec3::ZERO));
        (0..self.turns.len()).map(transform).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{largest_difference, reference, vectors};

    fn matrices(values: &[f64]) -> Vec<DMat3> {
        values.as_chunks::<9>().0.iter().map(|rows| DMat3::from_cols_array(rows).transpose()).collect()
    }

    // Printed bone i + 1 is what follows our joint i.
    #[test]
    fn on_a_chain_it_is_the_printed_product() {
        let golden = reference("blsm_printed_chain");
        let (rotations, offsets) = (matrices(&golden["joint_rotations"]), vectors(&golden["offsets"]));
        let scales = &golden["joint_scales"];
        let count = scales.len();
        let mut rotations = rotations;
        rotations.resize(count, DMat3::IDENTITY);
        let parents: Vec<Option<usize>> = (0..count).map(|joint| joint.checked_sub(1)).collect();
        let skeleton =
            ScaledSkeleton { parents, offsets, matter: (0..count).map(|joint| (joint + 1).min(count - 1)).collect() };
        let posed = skeleton.posed(scales, &rotations, DVec3::ZERO);
        let rows = |(linear, moved): (DMat3, DVec3)| -> Vec<f64> {
            (0..3).flat_map(|row| [linear.row(row).to_array().to_vec(), vec![moved[row]]].concat()).collect()
        };
        let printed = &golden["printed_rest_to_posed"];
        for (joint, transform) in posed.transforms().into_iter().take(count - 1).enumerate() {
            let expected = &printed[16 * (joint + 1)..16 * (joint + 1) + 12];
            assert!(largest_difference(&rows(transform), expected) < 1e-12, "joint {joint}");
        }
    }

    #[test]
    fn flesh_belongs_to_the_bone_that_leaves_its_joint() {
        let names = ["pelvis", "left_hip", "spine", "collar", "neck", "head", "jaw"].map(str::to_owned);
        let parents = [None, Some(0), Some(0), Some(2), Some(2), Some(4), Some(5)];
        let skeleton = ScaledSkeleton::of(&names, &parents, &[DVec3::Y; 7]);
        assert_eq!(skeleton.matter, [0, 1, 4, 3, 5, 5, 6]);
        assert_eq!(skeleton.rest(), [DVec3::Y; 7]);
    }
}
