//! Cholesky's factor of a large symmetric matrix, A = L L^T, by blocks: almost all of the work is products of matrices.
//!
//! Of each block of columns: the factor of its diagonal block, L_21 = A_21 L_11^-T below it, and A_22 -= L_21 L_21^T. n unknowns, row-major, double
//! precision, on the calling thread.

use nalgebra::{DMatrix, DVector};
use xavatar_vector::{Matrix, MatrixMut, Write, product};

/// Columns of a block.
const BLOCK: usize = 64;

/// L, below its diagonal and on it (n, n).
#[derive(Clone, Debug)]
pub struct Factor {
    rows: Vec<f64>,
    count: usize,
}

impl Factor {
    /// The factor of a symmetric matrix, whose lower triangle is read; none if it is not positive definite.
    pub fn of(matrix: &DMatrix<f64>) -> Option<Self> {
        let count = matrix.nrows();
        // Columns below the diagonal become rows left of it when the matrix is read the other way round.
        let mut factor = Self { rows: matrix.transpose().as_slice().to_vec(), count };
        let mut negated = Vec::new();
        for first in (0..count).step_by(BLOCK) {
            let end = (first + BLOCK).min(count);
            factor.factor_rows(first, end)?;
            let width = end - first;
            let panel: Vec<f64> =
                (end..count).flat_map(|row| factor.row(row)[first..end].to_vec()).collect::<Vec<f64>>();
            negated.clear();
            negated.extend(panel.iter().map(|value| -value));
            for top in (end..count).step_by(BLOCK) {
                let across = BLOCK.min(count - top);
                let (height, skipped) = (count - top, (top - end) * width);
                product(
                    MatrixMut::new(&mut factor.rows[top * count + top..], height, across, count),
                    Write::Add,
                    Matrix::new(&negated[skipped..], height, width, width),
                    Matrix::new(&panel[skipped..], across, width, width).transposed(),
                );
            }
        }
        Some(factor)
    }

    /// x of A x = b.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        self.solve_all(&DMatrix::from_column_slice(self.count, 1, right.as_slice())).column(0).into_owned()
    }

    /// X of A X = B, both (n, m).
    pub fn solve_all(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let width = right.ncols();
        let mut rows: Vec<Vec<f64>> = right.row_iter().map(|row| row.iter().copied().collect()).collect();
        for at in 0..self.count {
            let (done, rest) = rows.split_at_mut(at);
            for (earlier, entry) in done.iter().zip(self.row(at)) {
                rest[0].iter_mut().zip(earlier).for_each(|(value, earlier)| *value -= entry * earlier);
            }
            rest[0].iter_mut().for_each(|value| *value /= self.row(at)[at]);
        }
        for at in (0..self.count).rev() {
            let (above, rest) = rows.split_at_mut(at);
            rest[0].iter_mut().for_each(|value| *value /= self.row(at)[at]);
            for (earlier, entry) in above.iter_mut().zip(self.row(at)) {
                earlier.iter_mut().zip(&rest[0]).for_each(|(value, found)| *value -= entry * found);
            }
        }
        DMatrix::from_row_iterator(self.count, width, rows.into_iter().flatten())
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.rows[row * self.count..(row + 1) * self.count]
    }

    /// The columns of one block, all rows from its diagonal on.
    fn factor_rows(&mut self, first: usize, end: usize) -> Option<()> {
        for row in first..self.count {
            for column in first..end.min(row + 1) {
                let (upper, lower) = self.rows.split_at(row * self.count);
                let own = &lower[..self.count];
                let other = if column == row { own } else { &upper[column * self.count..(column + 1) * self.count] };
                let sum: f64 = own[first..column].iter().zip(&other[first..column]).map(|(one, also)| one * also).sum();
                let left = own[column] - sum;
                let value = if column < row { left / other[column] } else { left.sqrt() };
                if column == row && (value <= 0.0 || value.is_nan()) {
                    return None;
                }
                self.rows[row * self.count + column] = value;
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn solutions_solve_their_equations_on_either_side_of_a_block() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for count in [1, BLOCK - 1, BLOCK, 2 * BLOCK + 7] {
            let root = DMatrix::from_fn(count, count, |_, _| random.random::<f64>() - 0.5);
            let matrix = &root * root.transpose() + DMatrix::identity(count, count);
            let right = DMatrix::from_fn(count, 3, |_, _| random.random::<f64>());
            let factor = Factor::of(&matrix).unwrap();
            assert!((&matrix * factor.solve_all(&right) - &right).amax() < 1e-10, "{count}");
            let one: DVector<f64> = right.column(1).into_owned();
            assert!((factor.solve(&one) - factor.solve_all(&right).column(1)).amax() == 0.0);
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let mut matrix = DMatrix::identity(100, 100);
        matrix[(80, 80)] = -1.0;
        assert!(Factor::of(&matrix).is_none());
        matrix[(80, 80)] = f64::NAN;
        assert!(Factor::of(&matrix).is_none());
    }
}
