//! Small dense least squares in double precision: plain, and with unknowns that must not be negative.

/// A column that is this much shorter after those before it are taken out of it depends on them.
const DEPENDENT: f64 = 1e-12;
/// A gradient below this share of the largest does not let an unknown in.
const FLAT: f64 = 1e-12;

/// x >= 0 with the smallest |A x - b| (Lawson and Hanson 1974), for the columns of A.
pub(crate) fn non_negative(columns: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; columns.len()];
    let mut active: Vec<usize> = Vec::new();
    let mut is_active = vec![false; columns.len()];
    let scale = columns.iter().map(|column| dot(column, b).abs()).fold(0.0, f64::max);
    for _ in 0..3 * columns.len() {
        let residual = residual(columns, &active, &x, b);
        let gradient = |column: usize| dot(&columns[column], &residual);
        let steepest = (0..columns.len()).filter(|column| !is_active[*column]).map(|column| (column, gradient(column)));
        let Some((entering, slope)) = steepest.max_by(|one, other| one.1.total_cmp(&other.1)) else { break };
        if slope <= FLAT * scale {
            break;
        }
        active.push(entering);
        is_active[entering] = true;
        loop {
            let chosen: Vec<&[f64]> = active.iter().map(|column| columns[*column].as_slice()).collect();
            let solution = solved(&chosen, b);
            // As far towards the solution as none turns negative.
            let limits = active.iter().zip(&solution).filter(|(_, to)| **to <= 0.0);
            let share = limits.map(|(column, to)| x[*column] / (x[*column] - to)).fold(1.0, f64::min);
            for (column, to) in active.iter().zip(&solution) {
                x[*column] += share * (to - x[*column]);
            }
            if share >= 1.0 {
                break;
            }
            let before = active.len();
            active.retain(|column| {
                is_active[*column] = x[*column] > DEPENDENT;
                x[*column] = if is_active[*column] { x[*column] } else { 0.0 };
                is_active[*column]
            });
            if active.len() == before || active.is_empty() {
                break;
            }
        }
        if !is_active[entering] {
            break;
        }
    }
    x
}

/// x with the smallest |A x - b|; zero for columns that depend on those before them. By orthogonalisation, twice.
pub(crate) fn solved(columns: &[&[f64]], b: &[f64]) -> Vec<f64> {
    let count = columns.len();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    let mut upper = vec![vec![0.0; count]; count];
    for (index, column) in columns.iter().enumerate() {
        let mut rest = column.to_vec();
        let length = dot(column, column).sqrt();
        for _ in 0..2 {
            for (other, direction) in basis.iter().enumerate() {
                let along = dot(direction, &rest);
                upper[other][index] += along;
                rest.iter_mut().zip(direction).for_each(|(rest, direction)| *rest -= along * direction);
            }
        }
        let left = dot(&rest, &rest).sqrt();
        upper[index][index] = if left > DEPENDENT * length { left } else { 0.0 };
        let inverse = if left > DEPENDENT * length { 1.0 / left } else { 0.0 };
        basis.push(rest.into_iter().map(|value| value * inverse).collect());
    }
    let mut x = vec![0.0; count];
    for index in (0..count).rev() {
        if upper[index][index] > 0.0 {
            let known: f64 = (index + 1..count).map(|later| upper[index][later] * x[later]).sum();
            x[index] = (dot(&basis[index], b) - known) / upper[index][index];
        }
    }
    x
}

fn residual(columns: &[Vec<f64>], active: &[usize], x: &[f64], b: &[f64]) -> Vec<f64> {
    let mut residual = b.to_vec();
    for column in active {
        residual.iter_mut().zip(&columns[*column]).for_each(|(residual, value)| *residual -= x[*column] * value);
    }
    residual
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn random(rows: usize, columns: usize, seed: u64) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut column = || (0..rows).map(|_| random.random::<f64>() * 2.0 - 1.0).collect::<Vec<f64>>();
        ((0..columns).map(|_| column()).collect(), column())
    }

    #[test]
    fn residuals_are_orthogonal_to_the_columns() {
        let (columns, b) = random(12, 7, 3);
        let chosen: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let all: Vec<usize> = (0..7).collect();
        let left = residual(&columns, &all, &solved(&chosen, &b), &b);
        assert!(columns.iter().all(|column| dot(column, &left).abs() < 1e-12));
        // A column twice changes nothing.
        let twice: Vec<&[f64]> = chosen.iter().copied().chain([chosen[2]]).collect();
        assert_eq!(solved(&twice, &b)[7], 0.0);
    }

    // The conditions of Karush, Kuhn and Tucker say what is smallest.
    #[test]
    fn no_unknown_is_negative_and_none_could_help() {
        for seed in 0..20 {
            let (columns, b) = random(10, 30, seed);
            let x = non_negative(&columns, &b);
            let active: Vec<usize> = (0..30).filter(|column| x[*column] > 0.0).collect();
            let left = residual(&columns, &active, &x, &b);
            for (column, value) in columns.iter().zip(&x) {
                let slope = dot(column, &left);
                assert!(*value >= 0.0 && slope < 1e-9 && (*value == 0.0 || slope > -1e-9), "{seed}: {value} {slope}");
            }
        }
    }
}
