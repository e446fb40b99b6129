//! The product of a weight gradient, dW ← dW + dYᵀ X, for matching rows of dY and X.
//!
//! Nothing is packed: both are read row by row. A few rows of dW times a few vectors of its columns
//! are summed in registers over all rows of a tile, in their order.

use pulp::{Simd, WithSimd};

use crate::kernels::gemm::{Columns, get, panel_vectors, put};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;

/// Columns `first..` of a matrix with rows of `stride` numbers, added to.
pub(crate) struct Sums<'a, T> {
    pub(crate) rows: &'a mut [T],
    pub(crate) stride: usize,
    pub(crate) first: usize,
}

/// to\[i\]\[j\] ← to\[i\]\[j\] + Σ left\[row\]\[i\] right\[row\]\[j\] over the rows.
///
/// # Panics
/// When the numbers of rows differ.
pub(crate) fn add_outer<T: Real>(
    instructions: Instructions,
    to: Sums<'_, T>,
    left: Columns<'_, T>,
    right: Columns<'_, T>,
) {
    assert_eq!(
        left.rows.len() * right.stride,
        right.rows.len() * left.stride,
        "rows that belong together"
    );
    T::run(instructions, Outer { to, left, right });
}

struct Outer<'a, T> {
    to: Sums<'a, T>,
    left: Columns<'a, T>,
    right: Columns<'a, T>,
}

impl<T: Real> WithSimd for Outer<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let lanes = T::lanes::<S>();
        let mut first = 0;
        while first < self.right.count {
            let left = self.right.count - first;
            // Only whole vectors in wide panels, so that these need no masks.
            let vectors = panel_vectors::<S>(left / lanes);
            match vectors {
                4 => self.panel::<S, 4>(simd, first),
                3 => self.panel::<S, 3>(simd, first),
                2 => self.panel::<S, 2>(simd, first),
                _ => self.panel::<S, 1>(simd, first),
            }
            first += vectors * lanes;
        }
    }
}

impl<T: Real> Outer<'_, T> {
    #[inline(always)]
    fn panel<S: Simd, const V: usize>(&mut self, simd: S, first: usize) {
        let count = self.left.count;
        let mut i = 0;
        while i + 6 <= count {
            self.sums::<S, 6, V>(simd, i, first);
            i += 6;
        }
        while i + 2 <= count {
            self.sums::<S, 2, V>(simd, i, first);
            i += 2;
        }
        if i < count {
            self.sums::<S, 1, V>(simd, i, first);
        }
    }

    #[inline(always)]
    fn sums<S: Simd, const M: usize, const V: usize>(&mut self, simd: S, i: usize, first: usize) {
        let (left, right) = (self.left, self.right);
        let width = (right.count - first).min(V * T::lanes::<S>());
        let mut sums = [[T::splat(simd, T::ZERO); V]; M];
        let lefts = left.rows.chunks_exact(left.stride);
        let rights = right.rows.chunks_exact(right.stride);
        for (l, r) in lefts.zip(rights) {
            let l = &l[left.first + i..][..M];
            let r = get::<T, S, V>(simd, &r[right.first + first..][..width]);
            for (sums, &value) in sums.iter_mut().zip(l) {
                let value = T::splat(simd, value);
                for (sum, r) in sums.iter_mut().zip(r) {
                    *sum = T::mul_add(simd, value, r, *sum);
                }
            }
        }
        for (m, sums) in sums.into_iter().enumerate() {
            let start = (i + m) * self.to.stride + self.to.first + first;
            let out = &mut self.to.rows[start..start + width];
            let mut values = get::<T, S, V>(simd, out);
            for (x, y) in values.iter_mut().zip(sums) {
                *x = T::plus(simd, *x, y);
            }
            put::<T, S, V>(simd, out, values);
        }
    }
}
