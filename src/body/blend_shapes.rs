//! Linear blend shapes: offsets = sum_k c_k D_k over V vertices, K directions.
//!
//! One contiguous row a direction, so that adding it is a streaming multiply-add; rows that are zero everywhere (most
//! pose correctives of a sparse model) take no memory and no time. Parallel over vertices, in a fixed order of k.

use glam::Vec3;
use rayon::prelude::*;

/// Vertices of one task: its offsets stay in the first-level cache while the directions stream by.
const VERTICES_PER_TASK: usize = 1024;

/// K directions of V vertices, metres per unit of coefficient.
#[derive(Clone, Debug)]
pub(super) struct BlendShapes {
    /// (K) rows of V; empty where a direction moves nothing.
    directions: Vec<Vec<Vec3>>,
}

impl BlendShapes {
    /// Takes `columns` of the file's (V, 3, `stride`) array.
    pub(super) fn from_columns(values: &[f64], stride: usize, columns: impl Iterator<Item = usize>) -> Self {
        let columns: Vec<usize> = columns.collect();
        let directions = columns
            .into_par_iter()
            .map(|column| {
                let component = |row: &[f64], axis: usize| row[axis * stride + column] as f32;
                let rows = values.chunks_exact(3 * stride);
                let direction: Vec<Vec3> =
                    rows.map(|row| Vec3::new(component(row, 0), component(row, 1), component(row, 2))).collect();
                if direction.iter().all(|offset| *offset == Vec3::ZERO) { Vec::new() } else { direction }
            })
            .collect();
        Self { directions }
    }

    /// Adds the combination given by `coefficients` (K) to `vertices` (V).
    pub(super) fn add_to(&self, vertices: &mut [Vec3], coefficients: &[f32]) {
        let active: Vec<(&[Vec3], f32)> = self
            .directions
            .iter()
            .zip(coefficients)
            .filter(|(direction, coefficient)| !direction.is_empty() && **coefficient != 0.0)
            .map(|(direction, coefficient)| (direction.as_slice(), *coefficient))
            .collect();
        if active.is_empty() {
            return;
        }
        vertices.par_chunks_mut(VERTICES_PER_TASK).enumerate().for_each(|(task, block)| {
            let first = task * VERTICES_PER_TASK;
            for (direction, coefficient) in &active {
                for (vertex, offset) in block.iter_mut().zip(&direction[first..]) {
                    *vertex += *offset * *coefficient;
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_the_file_become_directions() {
        let (vertices, stride) = (2500, 7);
        let values: Vec<f64> =
            (0..vertices * 3 * stride).map(|i| if i % stride == 4 { 0.0 } else { (i % 101) as f64 }).collect();
        let shapes = BlendShapes::from_columns(&values, stride, 3..6);
        let mut offsets = vec![Vec3::ONE; vertices];
        shapes.add_to(&mut offsets, &[2.0, 5.0, -1.0]);
        for (vertex, offset) in offsets.iter().enumerate() {
            for axis in 0..3 {
                let at = |column: usize| values[(vertex * 3 + axis) * stride + column] as f32;
                assert_eq!(offset[axis], 1.0 + 2.0 * at(3) - at(5));
            }
        }
    }
}
