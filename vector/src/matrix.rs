//! Dense matrix products on slices: C = A B, or C += A B.
//!
//! A thin, bounds-checked face of the `gemm` crate, which picks AVX-512, AVX2 or scalar code at run time.
//! Single-threaded on purpose: callers are parallel over row blocks, so that results do not depend on scheduling.

use crate::Scalar;

/// A read-only matrix laid over a slice. Row-major unless transposed.
#[derive(Clone, Copy)]
pub struct Matrix<'a, T> {
    data: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, T> Matrix<'a, T> {
    /// `rows` x `columns` entries of `data`, consecutive rows `stride` apart.
    ///
    /// # Panics
    /// If the matrix exceeds its slice.
    pub fn new(data: &'a [T], rows: usize, columns: usize, stride: usize) -> Self {
        assert!(columns <= stride && span(rows, columns, stride) <= data.len(), "matrix exceeds its slice");
        Self { data, rows, columns, row_stride: stride, column_stride: 1 }
    }

    /// The same entries with rows and columns exchanged.
    pub fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

/// A writable row-major matrix laid over a slice.
pub struct MatrixMut<'a, T> {
    data: &'a mut [T],
    rows: usize,
    columns: usize,
    stride: usize,
}

impl<'a, T> MatrixMut<'a, T> {
    /// `rows` x `columns` entries of `data`, consecutive rows `stride` apart.
    ///
    /// # Panics
    /// If the matrix exceeds its slice.
    pub fn new(data: &'a mut [T], rows: usize, columns: usize, stride: usize) -> Self {
        assert!(columns <= stride && span(rows, columns, stride) <= data.len(), "matrix exceeds its slice");
        Self { data, rows, columns, stride }
    }
}

fn span(rows: usize, columns: usize, stride: usize) -> usize {
    if rows == 0 || columns == 0 { 0 } else { (rows - 1) * stride + columns }
}

/// Whether a product replaces its destination or is added to it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Write {
    /// destination = product.
    Replace,
    /// destination += product.
    Add,
}

/// destination = left * right, or destination += left * right, on the calling thread.
///
/// # Panics
/// If the extents disagree.
pub fn product<T: Scalar>(destination: MatrixMut<T>, write: Write, left: Matrix<T>, right: Matrix<T>) {
    assert!(
        left.rows == destination.rows && left.columns == right.rows && right.columns == destination.columns,
        "matrix extents disagree"
    );
    // SAFETY: the constructors checked that every (row, column) of the three matrices lies inside its slice; the
    // destination is borrowed exclusively, so it overlaps neither operand.
    unsafe {
        gemm::gemm(
            destination.rows,
            destination.columns,
            left.columns,
            destination.data.as_mut_ptr(),
            1,
            destination.stride as isize,
            write == Write::Add,
            left.data.as_ptr(),
            left.column_stride as isize,
            left.row_stride as isize,
            right.data.as_ptr(),
            right.column_stride as isize,
            right.row_stride as isize,
            T::one(),
            T::one(),
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // A (2, 3) B (3, 2) by the definition, once replaced and once added, with padded strides and a transpose.
    #[test]
    fn product_follows_the_definition() {
        let left = [1.0, 2.0, 3.0, -9.0, 4.0, 5.0, 6.0, -9.0];
        let right_transposed = [7.0, 9.0, 11.0, 8.0, 10.0, 12.0];
        let mut destination = [1.0f64; 6];
        let operands = || (Matrix::new(&left, 2, 3, 4), Matrix::new(&right_transposed, 2, 3, 3).transposed());
        let (a, b) = operands();
        product(MatrixMut::new(&mut destination, 2, 2, 3), Write::Replace, a, b);
        assert_eq!(destination, [58.0, 64.0, 1.0, 139.0, 154.0, 1.0]);
        let (a, b) = operands();
        product(MatrixMut::new(&mut destination, 2, 2, 3), Write::Add, a, b);
        assert_eq!(destination, [116.0, 128.0, 1.0, 278.0, 308.0, 1.0]);
    }

    #[test]
    #[should_panic(expected = "matrix exceeds its slice")]
    fn a_matrix_outside_its_slice_is_refused() {
        Matrix::new(&[0.0f32; 5], 2, 3, 3);
    }
}
