//! The softmax of rows of a few numbers, forward and backward.
//!
//! All that is not exponentials is plain loops: rows are shorter than a vector.

use pulp::{Simd, WithSimd};

use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;

/// rows\[i\] ← exp(rows\[i\]) / Σ exp(rows\[i\]) for rows of `width` numbers.
pub(crate) fn softmax<T: Real>(instructions: Instructions, rows: &mut [T], width: usize) {
    for row in rows.chunks_exact_mut(width) {
        let largest = row[1..].iter().fold(row[0], |most, &x| most.larger(x));
        row.iter_mut().for_each(|x| *x -= largest);
    }
    instructions.run(Exponentials(rows));
    for row in rows.chunks_exact_mut(width) {
        let sum: T = row.iter().copied().sum();
        let scale = T::ONE / sum;
        row.iter_mut().for_each(|x| *x *= scale);
    }
}

/// Takes gradients of a softmax to those of what went in, in place: g ← s ∘ (g - Σ s ∘ g).
pub(crate) fn softmax_backward<T: Real>(softmax: &[T], gradients: &mut [T], width: usize) {
    let rows = gradients.chunks_exact_mut(width);
    for (gradients, softmax) in rows.zip(softmax.chunks_exact(width)) {
        let pairs = gradients.iter().zip(softmax);
        let mean: T = pairs.map(|(&g, &s)| g * s).sum();
        let pairs = gradients.iter_mut().zip(softmax);
        pairs.for_each(|(g, &s)| *g = s * (*g - mean));
    }
}

struct Exponentials<'a, T>(&'a mut [T]);

impl<T: Real> WithSimd for Exponentials<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = T::lanes::<S>();
        let middle = self.0.len() / lanes * lanes;
        let (whole, rest) = self.0.split_at_mut(middle);
        for x in T::vectors_mut::<S>(whole) {
            *x = T::exps(simd, *x);
        }
        let last = T::exps(simd, T::load(simd, rest));
        T::store(simd, rest, last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_sum_to_one_however_large_their_numbers() {
        for using in [Instructions::Detected, Instructions::Plain] {
            let mut rows = [0.0_f32, 1.0, 2.0, 3e4, 1.0, -3e4, -500.0, -500.0, -500.0];
            softmax(using, &mut rows, 3);
            let e = std::f64::consts::E;
            let first = 1.0 / (1.0 + e + e * e);
            assert!((f64::from(rows[0]) - first).abs() < 1e-7, "{rows:?}");
            assert!((rows[3] - 1.0).abs() < 1e-7 && rows[5] < 1e-30, "{rows:?}");
            for row in rows.chunks_exact(3) {
                assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{row:?}");
            }
            let mut lost = [f32::NAN, 0.0, 1.0];
            softmax(using, &mut lost, 3);
            assert!(lost.iter().all(|x| x.is_nan()), "{lost:?}");
        }
    }

    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let (start, by) = ([0.3_f64, -1.2, 0.7, 0.1], [1.0, -2.0, 0.5, 0.3]);
        let value = |x: [f64; 4]| -> f64 {
            let mut s = x;
            softmax(Instructions::Detected, &mut s, 4);
            s.iter().zip(by).map(|(s, by)| s * by).sum()
        };
        let mut weights = start;
        softmax(Instructions::Detected, &mut weights, 4);
        let mut gradient = by;
        softmax_backward(&weights, &mut gradient, 4);
        for k in 0..4 {
            let moved = |by: f64| {
                let mut x = start;
                x[k] += by;
                value(x)
            };
            let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((slope - gradient[k]).abs() < 1e-9, "{slope} {gradient:?}");
        }
    }
}
