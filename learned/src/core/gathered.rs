//! Normal equations H = sum a a^T, g = sum r a of many rows: those with entries in the same places are one product of matrices.
//!
//! Vertices that the same joints move have the same places, where correctives are dense all of them. Sums go in the order of the places.

use std::collections::BTreeMap;

use xavatar_register::linear::{NormalEquations, Row};
use xavatar_vector::{Matrix, MatrixMut, Write, product};

/// Rows by their places.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    blocks: BTreeMap<Vec<usize>, Block>,
}

/// Rows with entries in the same places.
#[derive(Debug, Default)]
struct Block {
    /// Row by row.
    values: Vec<f64>,
    residuals: Vec<f64>,
}

impl Gathered {
    /// Adds r^2 of a residual whose derivative is `row`.
    pub fn add(&mut self, row: &Row, residual: f64) {
        let places = row.entries().map(|(place, _)| place).collect();
        let block = self.blocks.entry(places).or_default();
        block.values.extend(row.entries().map(|(_, value)| value));
        block.residuals.push(residual);
    }

    /// The sums, by so many unknowns.
    pub fn equations(self, unknowns: usize) -> NormalEquations {
        let mut sums = NormalEquations::new(unknowns);
        for (places, Block { values, residuals }) in self.blocks {
            let (rows, width) = (residuals.len(), places.len());
            let derivatives = || Matrix::new(&values, rows, width, width);
            let (mut matrix, mut gradient) = (vec![0.0; width * width], vec![0.0; width]);
            let squares = MatrixMut::new(&mut matrix, width, width, width);
            product(squares, Write::Replace, derivatives().transposed(), derivatives());
            let pulls = MatrixMut::new(&mut gradient, width, 1, 1);
            product(pulls, Write::Replace, derivatives().transposed(), Matrix::new(&residuals, rows, 1, 1));
            for (own, column) in places.iter().enumerate() {
                sums.gradient[*column] += gradient[own];
                for (other, place) in places.iter().enumerate() {
                    sums.matrix[(*place, *column)] += matrix[own * width + other];
                }
            }
            sums.cost += residuals.iter().map(|residual| residual * residual).sum::<f64>();
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use xavatar_register::linear::{Besides, Extents, Unknowns};

    use super::*;

    #[test]
    fn the_sums_are_those_of_the_rows_one_by_one() {
        let extents = Extents { joints: 3, shapes: 0, expressions: 0 };
        let unknowns = Unknowns::new(extents, &[0, 1, 2], Besides::default());
        let (mut gathered, mut plain) = (Gathered::default(), NormalEquations::new(unknowns.count()));
        let mut row = Row::default();
        for number in 0..12_usize {
            row.clear();
            let first = 3 * (number % 2);
            (first..first + 4).for_each(|column| row.push(&unknowns, column, ((number * 7 + column) as f64).sin()));
            let residual = (number as f64).cos();
            gathered.add(&row, residual);
            plain.add(&row, residual, 1.0);
        }
        let sums = gathered.equations(unknowns.count());
        assert!((sums.matrix - plain.matrix).amax() < 1e-14 && (sums.gradient - plain.gradient).amax() < 1e-14);
        assert!((sums.cost - plain.cost).abs() < 1e-14);
    }
}
