//! Linear blend shapes: offsets = sum_k c_k D_k over V vertices, K directions.
//!
//! One contiguous row a direction, so that adding it is a streaming multiply-add; rows that are zero everywhere (most
//! pose correctives of a sparse model) take no memory and no time. Parallel over vertices, in a fixed order of k.

use glam::Vec3;
use rayon::prelude::*;

/// Vertices of one task: its offsets stay in the first-level cache while the directions stream by.
const VERTICES_PER_TASK: usize = 1024;

/// Columns taken at once: two cache lines of the file's row.
const COLUMNS_PER_PASS: usize = 16;

/// K directions of V vertices, metres per unit of coefficient. `Default` has none.
#[derive(Clone, Debug, Default)]
pub struct BlendShapes {
    /// (K) rows of (V, 3); empty where a direction moves nothing.
    directions: Vec<Vec<f32>>,
}

impl BlendShapes {
    /// Takes `columns` of a file's (V, 3, `stride`) array.
    pub fn from_columns<T>(values: &[T], stride: usize, columns: impl Iterator<Item = usize>) -> Self
    where
        T: Copy + Sync + Into<f64>,
    {
        let columns: Vec<usize> = columns.collect();
        let directions = columns
            .par_chunks(COLUMNS_PER_PASS)
            .flat_map_iter(|columns| {
                let mut directions = vec![Vec::with_capacity(values.len() / stride); columns.len()];
                for row in values.chunks_exact(stride) {
                    for (direction, column) in directions.iter_mut().zip(columns) {
                        direction.push(row[*column].into() as f32);
                    }
                }
                directions.into_iter().map(|row| if row.iter().all(|offset| *offset == 0.0) { Vec::new() } else { row })
            })
            .collect();
        Self { directions }
    }

    /// These directions (K) of (V, 3) numbers each, or empty where one moves nothing.
    pub fn from_directions(directions: Vec<Vec<f32>>) -> Self {
        let kept = |row: Vec<f32>| if row.iter().all(|offset| *offset == 0.0) { Vec::new() } else { row };
        Self { directions: directions.into_iter().map(kept).collect() }
    }

    /// The `columns` of these directions, for these vertices.
    pub(super) fn of_vertices(&self, vertices: &[usize], columns: impl IntoIterator<Item = usize>) -> Self {
        let direction = |column: usize| {
            let direction = &self.directions[column];
            let row: Vec<f32> = match direction.is_empty() {
                true => Vec::new(),
                false => {
                    vertices.iter().flat_map(|vertex| direction[3 * vertex..3 * vertex + 3].iter().copied()).collect()
                }
            };
            if row.iter().all(|offset| *offset == 0.0) { Vec::new() } else { row }
        };
        Self { directions: columns.into_iter().map(direction).collect() }
    }

    /// The longest offset of any of these vertices in any of the `columns`.
    pub(super) fn largest_offset(&self, columns: impl IntoIterator<Item = usize>, vertices: &[usize]) -> f32 {
        let rows = columns.into_iter().map(|column| &self.directions[column]).filter(|direction| !direction.is_empty());
        let offset = |direction: &Vec<f32>, vertex: usize| Vec3::from_slice(&direction[3 * vertex..]).length();
        rows.flat_map(|direction| vertices.iter().map(move |vertex| offset(direction, *vertex))).fold(0.0, f32::max)
    }

    /// K.
    pub fn count(&self) -> usize {
        self.directions.len()
    }

    /// The directions (K) of (V, 3) numbers; empty where one moves nothing.
    pub fn directions(&self) -> impl Iterator<Item = &[f32]> {
        self.directions.iter().map(Vec::as_slice)
    }

    /// V, as far as the directions say: none if all of them move nothing.
    pub(super) fn vertices(&self) -> Option<usize> {
        self.directions.iter().find(|direction| !direction.is_empty()).map(|direction| direction.len() / 3)
    }

    /// Adds the combination given by `coefficients` (K) to `vertices` (V).
    pub(super) fn add_to(&self, vertices: &mut [Vec3], coefficients: &[f32]) {
        let active: Vec<(&[f32], f32)> = self
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
            let first = task * VERTICES_PER_TASK * 3;
            let mut offsets = [0.0; VERTICES_PER_TASK * 3];
            for (direction, coefficient) in &active {
                for (offset, component) in offsets.iter_mut().zip(&direction[first..]) {
                    *offset += component * coefficient;
                }
            }
            for (vertex, offset) in block.iter_mut().zip(offsets.chunks_exact(3)) {
                *vertex += Vec3::from_slice(offset);
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
