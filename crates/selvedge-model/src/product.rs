//! Matrix products on views of plain slices: C ← A B or C ← C + A B.
//!
//! The one place that calls the GEMM crate, whose entry point is `unsafe` because it takes raw
//! pointers; the views check on construction that every element they can reach lies in their
//! slice, which is what makes the call sound. Single-threaded: callers parallelise over tiles,
//! so that results do not depend on the number of threads.
#![allow(unsafe_code, reason = "the GEMM crate takes raw pointers")]

use crate::real::Real;

/// A read-only matrix in a slice.
#[derive(Clone, Copy)]
pub(crate) struct Matrix<'a, T> {
    data: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, T> Matrix<'a, T> {
    /// `data` as rows of `columns` values.
    pub(crate) fn new(data: &'a [T], columns: usize) -> Self {
        assert_eq!(data.len() % columns, 0, "whole rows");
        Self {
            data,
            rows: data.len() / columns,
            columns,
            row_stride: columns,
            column_stride: 1,
        }
    }

    /// Columns `first..first + count`.
    pub(crate) fn columns(self, first: usize, count: usize) -> Self {
        assert!(
            first + count <= self.columns && self.rows > 0,
            "columns in range"
        );
        Self {
            data: &self.data[first * self.column_stride..],
            columns: count,
            ..self
        }
    }

    /// The transpose.
    pub(crate) fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

/// A matrix in a slice that a product is written to; its rows are contiguous.
pub(crate) struct MatrixMut<'a, T> {
    data: &'a mut [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
}

impl<'a, T> MatrixMut<'a, T> {
    /// `data` as rows of `columns` values.
    pub(crate) fn new(data: &'a mut [T], columns: usize) -> Self {
        assert_eq!(data.len() % columns, 0, "whole rows");
        Self {
            rows: data.len() / columns,
            data,
            columns,
            row_stride: columns,
        }
    }

    /// Columns `first..first + count`.
    pub(crate) fn columns(self, first: usize, count: usize) -> Self {
        assert!(
            first + count <= self.columns && self.rows > 0,
            "columns in range"
        );
        Self {
            data: &mut self.data[first..],
            columns: count,
            ..self
        }
    }
}

/// Whether a product replaces what it is written to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Store {
    /// C ← A B.
    Replace,
    /// C ← C + A B.
    Add,
}

/// The product of `left` `[m, k]` and `right` `[k, n]` into `out` `[m, n]`.
pub(crate) fn multiply<T: Real>(
    out: MatrixMut<'_, T>,
    store: Store,
    left: Matrix<'_, T>,
    right: Matrix<'_, T>,
) {
    let (m, n, k) = (left.rows, right.columns, left.columns);
    assert_eq!((out.rows, out.columns, right.rows), (m, n, k), "shapes");
    if m == 0 || n == 0 || k == 0 {
        assert!(k > 0 || store == Store::Add, "an empty sum");
        return;
    }
    let last = |rows: usize, columns: usize, row_stride: usize, column_stride: usize| {
        (rows - 1) * row_stride + (columns - 1) * column_stride
    };
    assert!(last(m, k, left.row_stride, left.column_stride) < left.data.len());
    assert!(last(k, n, right.row_stride, right.column_stride) < right.data.len());
    assert!(last(m, n, out.row_stride, 1) < out.data.len());
    // SAFETY: the three assertions above show that every element that the strides reach lies
    // inside its slice; `out` is borrowed mutably, so it overlaps neither operand; strides are
    // far below isize::MAX because the slices are.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.data.as_mut_ptr(),
            1,
            out.row_stride as isize,
            store == Store::Add,
            left.data.as_ptr(),
            left.column_stride as isize,
            left.row_stride as isize,
            right.data.as_ptr(),
            right.column_stride as isize,
            right.row_stride as isize,
            if store == Store::Add { T::ONE } else { T::ZERO },
            T::ONE,
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

    fn numbers(count: usize, seed: u64) -> Vec<f64> {
        (0..count as u64)
            .map(|k| ((k * 7919 + seed * 104_729) % 1009) as f64 / 1009.0 - 0.5)
            .collect()
    }

    #[test]
    fn products_of_views_match_the_sums_they_stand_for() {
        for (m, n, k) in [(1, 1, 1), (5, 3, 4), (17, 33, 9), (130, 64, 65)] {
            let (a, b) = (numbers(m * (k + 2), 1), numbers(n * k, 2));
            let start = numbers(m * (n + 3), 3);
            let mut c = start.clone();
            let left = Matrix::new(&a, k + 2).columns(1, k);
            let right = Matrix::new(&b, k).transposed();
            multiply(
                MatrixMut::new(&mut c, n + 3).columns(2, n),
                Store::Add,
                left,
                right,
            );
            for i in 0..m {
                for j in 0..n + 3 {
                    let mut expected = start[i * (n + 3) + j];
                    if (2..n + 2).contains(&j) {
                        expected += (0..k)
                            .map(|l| a[i * (k + 2) + 1 + l] * b[(j - 2) * k + l])
                            .sum::<f64>();
                    }
                    let found = c[i * (n + 3) + j];
                    // k products below 1/4, each rounded: far below 1e-12.
                    assert!((found - expected).abs() < 1e-12, "{m}x{n}x{k} at {i},{j}");
                }
            }
        }
    }
}
