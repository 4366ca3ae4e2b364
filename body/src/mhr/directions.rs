//! The strongest directions among many: principal components of coefficients that are all as likely.

use glam::DVec3;
use nalgebra::{DMatrix, SymmetricEigen};

use crate::imported::Direction;
use crate::smplx;

/// Of directions, each by its offsets of the vertices (V), the `count` orthonormal mixtures that move the vertices most, and their share of the
/// motion of all.
pub(super) fn strongest(all: &[Vec<DVec3>], count: usize, name: &str) -> (Vec<Direction>, f64) {
    let dot = |one: &[DVec3], other: &[DVec3]| one.iter().zip(other).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let products = DMatrix::from_fn(all.len(), all.len(), |row, column| dot(&all[row], &all[column]));
    let total = products.trace();
    let SymmetricEigen { eigenvectors, eigenvalues } = products.symmetric_eigen();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|one, other| eigenvalues[*other].total_cmp(&eigenvalues[*one]));
    order.truncate(count);
    let direction = |(number, column): (usize, &usize)| {
        let mut offsets = vec![DVec3::ZERO; all.first().map_or(0, Vec::len)];
        for (share, own) in eigenvectors.column(*column).iter().zip(all) {
            offsets.iter_mut().zip(own).for_each(|(offset, own)| *offset += *own * *share);
        }
        Direction { name: format!("{name} {}", number + 1), offsets, joints: vec![DVec3::ZERO; smplx::joint::COUNT] }
    };
    let kept: f64 = order.iter().map(|column| eigenvalues[*column]).sum();
    (order.iter().enumerate().map(direction).collect(), if total > 0.0 { kept / total } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_mixtures_are_found() {
        let x = |length: f64| vec![DVec3::X * length, DVec3::ZERO];
        // Two that move the same vertex along, one that moves the other one less.
        let all = [x(3.0), x(4.0), vec![DVec3::ZERO, DVec3::Y]];
        let (found, share) = strongest(&all, 1, "shape");
        assert!((found[0].offsets[0].x.abs() - 5.0).abs() < 1e-12 && found[0].offsets[1].length() < 1e-12);
        assert!((share - 25.0 / 26.0).abs() < 1e-12 && found[0].name == "shape 1");
        assert_eq!(strongest(&all, 10, "shape").0.len(), 3);
    }
}
