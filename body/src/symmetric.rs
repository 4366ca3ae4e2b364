//! Eigenvalues of small symmetric matrices by Jacobi's rotations, which are accurate to the last bits of the largest.

/// Sweeps after which it has converged: each squares what is off the diagonal.
const SWEEPS: usize = 30;
/// Entries off the diagonal that are this small beside those on it are zero.
const NEGLIGIBLE: f64 = 1e-18;

/// The eigenvalues of a symmetric matrix, largest first, and their unit vectors, a row each.
pub(crate) fn eigen(mut matrix: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    let count = matrix.len();
    let mut vectors: Vec<Vec<f64>> =
        (0..count).map(|row| (0..count).map(|at| f64::from(u8::from(at == row))).collect()).collect();
    for _ in 0..SWEEPS {
        let mut is_diagonal = true;
        for p in 0..count {
            for q in p + 1..count {
                let off = matrix[p][q];
                if off.abs() <= NEGLIGIBLE * (matrix[p][p] * matrix[q][q]).abs().sqrt() {
                    continue;
                }
                is_diagonal = false;
                let slope = (matrix[q][q] - matrix[p][p]) / (2.0 * off);
                let tangent = slope.signum() / (slope.abs() + slope.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                let sine = tangent * cosine;
                let turn = |row: &mut [f64]| {
                    let (a, b) = (row[p], row[q]);
                    (row[p], row[q]) = (cosine * a - sine * b, sine * a + cosine * b);
                };
                matrix.iter_mut().for_each(|row| turn(row));
                for at in 0..count {
                    let (a, b) = (matrix[p][at], matrix[q][at]);
                    (matrix[p][at], matrix[q][at]) = (cosine * a - sine * b, sine * a + cosine * b);
                    let (a, b) = (vectors[p][at], vectors[q][at]);
                    (vectors[p][at], vectors[q][at]) = (cosine * a - sine * b, sine * a + cosine * b);
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|one, other| matrix[*other][*other].total_cmp(&matrix[*one][*one]));
    (order.iter().map(|at| matrix[*at][*at].max(0.0)).collect(), order.iter().map(|at| vectors[*at].clone()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_are_stretched_by_their_values() {
        let matrix: Vec<Vec<f64>> = (0..6).map(|row| (0..6).map(|at| 1.0 / (row + at + 1) as f64).collect()).collect();
        let (values, vectors) = eigen(matrix.clone());
        assert!(values.is_sorted_by(|one, other| one >= other));
        for (value, vector) in values.iter().zip(&vectors) {
            let length: f64 = vector.iter().map(|entry| entry * entry).sum();
            assert!((length - 1.0).abs() < 1e-14);
            for (row, entry) in matrix.iter().zip(vector) {
                let stretched: f64 = row.iter().zip(vector).map(|(a, b)| a * b).sum();
                assert!((stretched - value * entry).abs() < 1e-14, "{stretched} {}", value * entry);
            }
        }
    }
}
