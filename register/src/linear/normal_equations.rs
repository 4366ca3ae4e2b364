//! H x = -g of weighted rows: H = sum w a a^T, g = sum w r a for residuals r(x) = r + a x, with a of few entries.
//!
//! Only entries of columns that are solved for are kept. H is filled below its diagonal; sums go in the order of the rows.

use nalgebra::{DMatrix, DVector};

use super::columns::Unknowns;

/// One residual's derivative by the unknowns, as its entries that are not zero.
#[derive(Clone, Debug, Default)]
pub struct Row {
    places: Vec<usize>,
    values: Vec<f64>,
}

impl Row {
    /// Begins a new row.
    pub fn clear(&mut self) {
        self.places.clear();
        self.values.clear();
    }

    /// Adds an entry, if its column is solved for. No column twice.
    pub fn push(&mut self, unknowns: &Unknowns, column: usize, value: f64) {
        if let Some(place) = unknowns.place(column).filter(|_| value != 0.0) {
            self.places.push(place);
            self.values.push(value);
        }
    }

    /// Numbers of unknowns with the derivatives by them.
    pub fn entries(&self) -> impl Iterator<Item = (usize, f64)> {
        self.places.iter().copied().zip(self.values.iter().copied())
    }
}

/// The sums over a frame's rows.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// H, symmetric; only the lower triangle is filled.
    pub matrix: DMatrix<f64>,
    /// g.
    pub gradient: DVector<f64>,
    /// sum w r^2.
    pub cost: f64,
}

impl NormalEquations {
    /// Of no rows.
    pub fn new(unknowns: usize) -> Self {
        Self { matrix: DMatrix::zeros(unknowns, unknowns), gradient: DVector::zeros(unknowns), cost: 0.0 }
    }

    /// Adds w r^2 of a residual r whose derivative is `row`.
    pub fn add(&mut self, row: &Row, residual: f64, weight: f64) {
        let count = self.gradient.len();
        let matrix = self.matrix.as_mut_slice();
        for (&column, &value) in row.places.iter().zip(&row.values) {
            let weighted = weight * value;
            self.gradient[column] += weighted * residual;
            let of_column = &mut matrix[column * count..(column + 1) * count];
            for (&place, &other) in row.places.iter().zip(&row.values) {
                of_column[place] += weighted * other;
            }
        }
        self.cost += weight * residual * residual;
    }

    /// Adds w r^2 of a residual of one unknown alone, with derivative 1.
    pub fn add_single(&mut self, place: Option<usize>, residual: f64, weight: f64) {
        if let Some(place) = place {
            self.matrix[(place, place)] += weight;
            self.gradient[place] += weight * residual;
        }
        self.cost += weight * residual * residual;
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns::{Besides, Extents};
    use super::*;

    // (2 + 3 a + b)^2 + 4 (1 - b)^2 is least where both are zero: b = 1, a = -1.
    #[test]
    fn the_solution_makes_both_residuals_zero() {
        let extents = Extents { joints: 1, shapes: 0, expressions: 0 };
        let unknowns = Unknowns::new(extents, &[0], Besides::default());
        let mut equations = NormalEquations::new(unknowns.count());
        let mut row = Row::default();
        for (entries, residual, weight) in [([3.0, 1.0], 2.0, 1.0), ([0.0, -1.0], 1.0, 4.0)] {
            row.clear();
            entries.into_iter().enumerate().for_each(|(column, value)| row.push(&unknowns, column, value));
            row.push(&unknowns, extents.translation().start, 7.0);
            equations.add(&row, residual, weight);
        }
        equations.add_single(Some(2), 0.5, 1.0);
        let solved = equations.matrix.cholesky().unwrap().solve(&-equations.gradient);
        assert!((solved - DVector::from_vec(vec![-1.0, 1.0, -0.5])).norm() < 1e-12);
        assert_eq!(equations.cost, 4.0 + 4.0 + 0.25);
    }
}
