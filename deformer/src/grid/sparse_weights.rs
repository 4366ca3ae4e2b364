//! Skinning weights of a grid's nodes, of each node only the few bones that count: compressed sparse rows.
//!
//! R nodes, J bones. A node's weights are not negative and sum to one.

use xavatar_network::Real;

use crate::{BoneTransform, Error, Result};

/// Weights at or below this are dropped when a dense row is kept; the rest are scaled to sum to one. Moves no point that
/// hangs on bones a metre apart by more than some millimetres, and leaves two or three bones a node.
const NEGLIGIBLE: f64 = 1e-3;

/// Rows of (bone, weight).
#[derive(Clone, Debug, PartialEq)]
pub struct SparseWeights<T> {
    joints: usize,
    /// Row n is `offsets[n]..offsets[n + 1]` of the lists below (R + 1).
    offsets: Vec<u32>,
    bones: Vec<u8>,
    weights: Vec<T>,
}

impl<T: Real> SparseWeights<T> {
    /// Rows of (bone, weight) over `joints` bones; each row is scaled to sum to one.
    ///
    /// # Errors
    /// If a row is empty, names a bone twice or one that does not exist, or its weights are negative, not finite or all zero;
    /// or if there are more than 256 bones.
    pub fn new(joints: usize, rows: impl IntoIterator<Item = impl AsRef<[(usize, T)]>>) -> Result<Self> {
        if joints == 0 || joints > usize::from(u8::MAX) + 1 {
            let (found, expected) = (joints.to_string(), "1 to 256, so that a bone is one byte".to_owned());
            return Err(Error::Skeleton { name: "the number of bones of skinning weights", found, expected });
        }
        let mut sparse = Self { joints, offsets: vec![0], bones: Vec::new(), weights: Vec::new() };
        for (node, row) in rows.into_iter().enumerate() {
            let row = row.as_ref();
            let total: T = row.iter().map(|&(_, weight)| weight).sum();
            let twice = |index: usize| row[..index].iter().any(|&(bone, _)| bone == row[index].0);
            let wrong = |index: usize| {
                row[index].0 >= joints || row[index].1.is_nan() || row[index].1 < T::zero() || twice(index)
            };
            if !(total > T::zero() && total.is_finite()) || (0..row.len()).any(wrong) {
                return Err(Error::Value {
                    name: "a node's skinning weights",
                    found: format!("{row:?} (node {node})"),
                    expected: format!("different bones below {joints} with weights that are not negative nor all zero"),
                });
            }
            sparse.bones.extend(row.iter().map(|&(bone, _)| bone as u8));
            sparse.weights.extend(row.iter().map(|&(_, weight)| weight / total));
            sparse.offsets.push(sparse.bones.len() as u32);
        }
        Ok(sparse)
    }

    /// Keeps of dense rows (R, J) the weights above 0.001, scaled to sum to one.
    pub(crate) fn of_dense(joints: usize, dense: &[T]) -> Result<Self> {
        let rows = dense.chunks_exact(joints).map(|row| {
            let greatest = row.iter().copied().fold(T::zero(), T::max);
            let bound = greatest.min(T::of(NEGLIGIBLE));
            let kept = row.iter().enumerate().filter(|&(_, &weight)| weight > bound || weight == greatest);
            kept.map(|(bone, &weight)| (bone, weight)).collect::<Vec<_>>()
        });
        Self::new(joints, rows)
    }

    /// Joins rows of consecutive nodes.
    pub(crate) fn joined(parts: Vec<Self>, joints: usize) -> Self {
        let mut all = Self { joints, offsets: vec![0], bones: Vec::new(), weights: Vec::new() };
        for part in parts {
            let first = all.bones.len() as u32;
            all.offsets.extend(part.offsets[1..].iter().map(|offset| first + offset));
            all.bones.extend(part.bones);
            all.weights.extend(part.weights);
        }
        all
    }

    /// J.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// R: how many rows there are.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bones of a node and their weights.
    #[inline(always)]
    pub fn row(&self, node: usize) -> (&[u8], &[T]) {
        let range = self.range(node);
        (&self.bones[range.clone()], &self.weights[range])
    }

    #[inline(always)]
    pub(crate) fn range(&self, node: usize) -> std::ops::Range<usize> {
        self.offsets[node] as usize..self.offsets[node + 1] as usize
    }

    pub(crate) fn weights(&self) -> &[T] {
        &self.weights
    }

    /// The places of the rows (R + 1) and all their weights.
    pub(crate) fn offsets_and_weights_mut(&mut self) -> (&[u32], &mut [T]) {
        (&self.offsets, &mut self.weights)
    }

    /// The node's blended transform, padded to 16.
    #[inline(always)]
    pub(crate) fn blended(&self, node: usize, bones: &[[T; 16]]) -> [T; 16] {
        let mut sum = [T::zero(); 16];
        let (row, weights) = self.row(node);
        for (&bone, &weight) in row.iter().zip(weights) {
            let bone = &bones[usize::from(bone)];
            for index in 0..16 {
                sum[index] += weight * bone[index];
            }
        }
        sum
    }
}

/// Bone transforms padded to 16 numbers, so that a blend is a whole vector a bone.
pub(crate) fn padded<T: Real>(bones: &[BoneTransform<T>]) -> Vec<[T; 16]> {
    let pad = |bone: &BoneTransform<T>| std::array::from_fn(|index| if index < 12 { bone[index] } else { T::zero() });
    bones.iter().map(pad).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dense_rows_keep_what_counts_and_sum_to_one() {
        let dense = [0.5, 0.4995, 0.0005, 0.0, 1e-4, 9e-5, 0.0, 1.0];
        let sparse = SparseWeights::<f64>::of_dense(4, &dense).unwrap();
        assert_eq!((sparse.len(), sparse.row(0).0, sparse.row(1).0), (2, &[0, 1][..], &[3][..]));
        assert!((sparse.row(0).1.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert_eq!(SparseWeights::of_dense(2, &[3e-4, 1e-4]).unwrap().row(0), (&[0][..], &[1.0][..]));
    }

    #[test]
    fn rows_that_are_no_weights_are_refused() {
        for row in [
            vec![],
            vec![(0, 0.0)],
            vec![(0, 1.0), (0, 1.0)],
            vec![(3, 1.0)],
            vec![(0, 2.0), (1, -1.0)],
            vec![(0, f64::NAN)],
        ] {
            assert!(SparseWeights::new(3, [&row[..]]).is_err(), "{row:?}");
        }
        assert!(SparseWeights::<f64>::new(257, [[(0, 1.0)]]).is_err());
    }
}
