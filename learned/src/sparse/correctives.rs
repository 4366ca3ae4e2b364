//! Sparse pose correctives: of each vertex the joints that correct it, with a block of four directions each.
//!
//! c_v = sum_(j in support of v) sum_k x_jk P_vjk, x_j = q_j - (0, 0, 0, 1). V vertices, J joints; metres for a feature of one.

use glam::DVec3;
use rayon::prelude::*;
use xavatar_body::{BlendShapes, Correctives};

/// Features of a joint.
pub(crate) const PER_JOINT: usize = 4;

/// A vertex's blocks, by group: joint less one.
pub type VertexBlocks = Vec<(usize, [DVec3; PER_JOINT])>;

/// The correctives of V vertices by J - 1 groups of features.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseCorrectives {
    /// (V).
    pub vertices: Vec<VertexBlocks>,
}

impl SparseCorrectives {
    /// None, of V vertices.
    pub fn none(vertices: usize) -> Self {
        Self { vertices: vec![Vec::new(); vertices] }
    }

    /// What features (4 (J - 1)) do to every vertex at rest (V).
    pub fn offsets(&self, features: &[f64]) -> Vec<DVec3> {
        let of_block = |(group, block): &(usize, [DVec3; PER_JOINT])| -> DVec3 {
            block.iter().zip(&features[PER_JOINT * group..]).map(|(direction, feature)| *direction * *feature).sum()
        };
        self.vertices.par_iter().map(|blocks| blocks.iter().map(of_block).sum()).collect()
    }

    /// How many blocks there are.
    pub fn blocks(&self) -> usize {
        self.vertices.iter().map(Vec::len).sum()
    }

    /// The blocks none of whose directions is as long as `length`.
    pub fn shorter_than(&self, length: f64) -> Self {
        let is_short = |(_, block): &&(usize, [DVec3; PER_JOINT])| block.iter().all(|offset| offset.length() < length);
        let of_vertex = |blocks: &VertexBlocks| blocks.iter().filter(is_short).copied().collect();
        Self { vertices: self.vertices.iter().map(of_vertex).collect() }
    }

    /// The share of blocks that there are, of all that there could be for so many groups.
    pub fn density(&self, groups: usize) -> f64 {
        self.blocks() as f64 / (groups * self.vertices.len()).max(1) as f64
    }

    /// As a body of J joints has them.
    pub fn to_body(&self, joints: usize) -> Correctives {
        let mut directions = vec![Vec::new(); PER_JOINT * (joints - 1)];
        for (vertex, blocks) in self.vertices.iter().enumerate() {
            for (group, block) in blocks {
                for (feature, offset) in block.iter().enumerate() {
                    let row: &mut Vec<f32> = &mut directions[PER_JOINT * group + feature];
                    row.resize(3 * self.vertices.len(), 0.0);
                    row[3 * vertex..3 * vertex + 3].copy_from_slice(&offset.as_vec3().to_array());
                }
            }
        }
        let shapes = BlendShapes::from_directions(directions);
        Correctives::Quaternions { first_joint: 1, coefficient: None, shapes }
    }

    /// Those of a body whose features are those of its joints but the root; none of any other body.
    pub fn of_body(correctives: &Correctives, vertices: usize) -> Option<Self> {
        let Correctives::Quaternions { first_joint, shapes, .. } = correctives else { return None };
        let directions: Vec<&[f32]> = shapes.directions().skip(PER_JOINT * (1 - first_joint)).collect();
        let at = |direction: &[f32], vertex: usize| {
            direction
                .get(3 * vertex..3 * vertex + 3)
                .map_or(DVec3::ZERO, |offset| glam::Vec3::from_slice(offset).as_dvec3())
        };
        let blocks = |vertex: usize| -> VertexBlocks {
            let groups = directions.as_chunks::<PER_JOINT>().0.iter().enumerate();
            let of_group = groups.map(|(group, rows)| (group, rows.map(|row| at(row, vertex))));
            of_group.filter(|(_, block)| block.iter().any(|offset| *offset != DVec3::ZERO)).collect()
        };
        Some(Self { vertices: (0..vertices).into_par_iter().map(blocks).collect() })
    }

    /// How well the blocks are those of `truth`: the harmonic mean of the shares that are right and that were found.
    pub fn support_f1(&self, truth: &Self) -> f64 {
        let (mut both, mut found, mut wanted) = (0, 0, 0);
        for (own, other) in self.vertices.iter().zip(&truth.vertices) {
            found += own.len();
            wanted += other.len();
            both += own.iter().filter(|(group, _)| other.iter().any(|(of, _)| of == group)).count();
        }
        2.0 * both as f64 / (found + wanted).max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_survive_the_way_through_a_body() {
        let block = |scale: f64| [1.0, -2.0, 0.5, 0.25].map(|value| DVec3::new(value, 2.0, -value) * scale);
        let sparse = SparseCorrectives {
            vertices: vec![vec![(1, block(1.0))], Vec::new(), vec![(0, block(0.5)), (1, block(2.0))]],
        };
        assert_eq!(SparseCorrectives::of_body(&sparse.to_body(3), 3).unwrap(), sparse);
        let offsets = sparse.offsets(&[0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 0.0]);
        assert_eq!(offsets[0], block(1.0)[0] * 2.0);
        assert_eq!(offsets[2], block(0.5)[2] + block(2.0)[0] * 2.0);
        assert_eq!(sparse.density(2), 0.5);
    }

    #[test]
    fn a_support_with_one_right_and_one_missing_is_two_thirds() {
        let zero = [DVec3::ZERO; 4];
        let truth = SparseCorrectives { vertices: vec![vec![(0, zero), (1, zero)]] };
        let found = SparseCorrectives { vertices: vec![vec![(1, zero)]] };
        assert_eq!(found.support_f1(&truth), 2.0 / 3.0);
    }
}
