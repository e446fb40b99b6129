//! Layer normalisation, forward and backward.
//!
//! The forward pass ends in the update that the output is for: it is written, added to the rows
//! that it updates, or added to an arc and to the sum of the arc's receiver.

use pulp::{Simd, WithSimd};

use crate::kernels::gemm::{get, put};
use crate::kernels::real::Real;
use crate::kernels::rows::Receivers;
use crate::kernels::simd::Instructions;

/// Added to a variance before its root, as in PyTorch.
const EPSILON: f64 = 1e-5;

/// Use of the output, `[rows, width]`.
pub(crate) enum Normalised<'a, T> {
    /// out ← output.
    Set(&'a mut [T]),
    /// out ← out + output.
    Add(&'a mut [T]),
    /// Adds the output to the arcs and, arc after arc, to the sums of their receivers.
    Messages {
        arcs: &'a mut [T],
        incoming: &'a mut [T],
        receivers: Receivers<'a>,
    },
}

/// Layer normalisation (Ba et al. 2016) `[eq:layer-norm]`: x̂ = (x - mean) / √(variance + 1e-5);
/// out = x̂ ∘ weight + shift. `rows` are for the backward pass: in the input, out x̂,
/// `[rows, width]`; out 1 / deviation, `[rows]`.
pub(crate) fn layer_norm<T: Real>(
    instructions: Instructions,
    rows: [&mut [T]; 2],
    weight: &[T],
    shift: &[T],
    out: Normalised<'_, T>,
) {
    T::run(
        instructions,
        Norm {
            rows,
            weight,
            shift,
            out,
        },
    );
}

struct Norm<'a, T> {
    rows: [&'a mut [T]; 2],
    weight: &'a [T],
    shift: &'a [T],
    out: Normalised<'a, T>,
}

impl<T: Real> WithSimd for Norm<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.weight.len();
        let mut out = self.out;
        let [normals, inverses] = self.rows;
        let rows = normals.chunks_exact_mut(width).zip(inverses);
        for (row, (x, inverse)) in rows.enumerate() {
            let mean = mean::<T, S>(simd, x);
            let scale = inverse_deviation::<T, S>(simd, x, mean);
            *inverse = scale;
            let affine = Affine {
                mean,
                scale,
                weight: self.weight,
                shift: self.shift,
            };
            let at = row * width..(row + 1) * width;
            match &mut out {
                Normalised::Set(out) => {
                    let out = &mut out[at];
                    // The one number whose sum with any other is the other, bit for bit.
                    out.fill(-T::ZERO);
                    add::<T, S>(simd, x, affine, out, None);
                }
                Normalised::Add(out) => add::<T, S>(simd, x, affine, &mut out[at], None),
                Normalised::Messages {
                    arcs,
                    incoming,
                    receivers,
                } => {
                    let receiver = receivers.of[row] as usize - receivers.first;
                    let total = &mut incoming[receiver * width..(receiver + 1) * width];
                    add::<T, S>(simd, x, affine, &mut arcs[at], Some(total));
                }
            }
        }
    }
}

#[inline(always)]
fn mean<T: Real, S: Simd>(simd: S, row: &[T]) -> T {
    let mut sum = T::splat(simd, T::ZERO);
    for x in row.chunks(T::lanes::<S>()) {
        let [x] = get::<T, S, 1>(simd, x);
        sum = T::plus(simd, sum, x);
    }
    T::total(simd, sum) * T::from_f64(1.0 / row.len() as f64)
}

#[inline(always)]
fn inverse_deviation<T: Real, S: Simd>(simd: S, row: &[T], mean: T) -> T {
    let (lanes, width) = (T::lanes::<S>(), row.len());
    let means = T::splat(simd, mean);
    let mut sum = T::splat(simd, T::ZERO);
    let whole = width - width % lanes;
    for &x in T::vectors::<S>(&row[..whole]) {
        let off = T::minus(simd, x, means);
        sum = T::mul_add(simd, off, off, sum);
    }
    let mut squares = T::total(simd, sum);
    for &x in &row[whole..] {
        squares += (x - mean) * (x - mean);
    }
    let variance = squares * T::from_f64(1.0 / width as f64);
    T::ONE / (variance + T::from_f64(EPSILON)).sqrt()
}

/// Maps a row to its normalised numbers and these to the output.
#[derive(Clone, Copy)]
struct Affine<'a, T> {
    mean: T,
    /// 1 / deviation.
    scale: T,
    weight: &'a [T],
    shift: &'a [T],
}

/// Normalises one vector of a row in place. Returns the output.
#[inline(always)]
fn vector<T: Real, S: Simd>(simd: S, x: &mut [T], affine: Affine<'_, T>) -> T::Vector<S> {
    let [value] = get::<T, S, 1>(simd, x);
    let [w] = get::<T, S, 1>(simd, affine.weight);
    let [s] = get::<T, S, 1>(simd, affine.shift);
    let off = T::minus(simd, value, T::splat(simd, affine.mean));
    let normal = T::times(simd, off, T::splat(simd, affine.scale));
    put::<T, S, 1>(simd, x, [normal]);
    T::mul_add(simd, normal, w, s)
}

#[inline(always)]
fn add<T: Real, S: Simd>(
    simd: S,
    x: &mut [T],
    affine: Affine<'_, T>,
    out: &mut [T],
    mut total: Option<&mut [T]>,
) {
    let lanes = T::lanes::<S>();
    let parts = x.chunks_mut(lanes).zip(out.chunks_mut(lanes));
    let columns = affine.weight.chunks(lanes).zip(affine.shift.chunks(lanes));
    for (number, ((x, out), (weight, shift))) in parts.zip(columns).enumerate() {
        let affine = Affine {
            weight,
            shift,
            ..affine
        };
        let value = vector::<T, S>(simd, x, affine);
        let [before] = get::<T, S, 1>(simd, out);
        put::<T, S, 1>(simd, out, [T::plus(simd, before, value)]);
        if let Some(total) = total.as_deref_mut() {
            let first = number * lanes;
            let last = total.len().min(first + lanes);
            let total = &mut total[first..last];
            let [before] = get::<T, S, 1>(simd, total);
            put::<T, S, 1>(simd, total, [T::plus(simd, before, value)]);
        }
    }
}

/// The gradient of [`layer_norm`] from the rows that it kept: `gradient` holds that of the output
/// and receives that of the input. The gradients of weight and shift, `[width]` each, are added to.
pub(crate) fn layer_norm_backward<T: Real>(
    instructions: Instructions,
    gradient: &mut [T],
    [normals, inverses]: [&[T]; 2],
    weight: &[T],
    [by_weight, by_shift]: [&mut [T]; 2],
) {
    let width = weight.len();
    let inverse_width = T::from_f64(1.0 / width as f64);
    instructions.vectorised(
        #[inline(always)]
        || {
            let gradients = gradient.chunks_exact_mut(width);
            let normals = normals.chunks_exact(width);
            for ((g, x), &inverse) in gradients.zip(normals).zip(inverses) {
                let (dw, ds) = (&mut by_weight[..width], &mut by_shift[..width]);
                for k in 0..width {
                    dw[k] += g[k] * x[k];
                    ds[k] += g[k];
                    g[k] *= weight[k];
                }
                let mean = sum(g) * inverse_width;
                let along = dot(g, x) * inverse_width;
                for (g, &x) in g.iter_mut().zip(x) {
                    *g = (*g - mean - x * along) * inverse;
                }
            }
        },
    );
}

/// Partial sums of a sum over a row, in a fixed order on every instruction set.
const LANES: usize = 16;

#[inline(always)]
fn sum<T: Real>(row: &[T]) -> T {
    let mut lanes = [T::ZERO; LANES];
    let chunks = row.chunks_exact(LANES);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (lane, &x) in lanes.iter_mut().zip(chunk) {
            *lane += x;
        }
    }
    for (lane, &x) in lanes.iter_mut().zip(rest) {
        *lane += x;
    }
    fold(lanes)
}

#[inline(always)]
fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let mut lanes = [T::ZERO; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let (a_rest, b_rest) = (a_chunks.remainder(), b_chunks.remainder());
    for (x, y) in a_chunks.zip(b_chunks) {
        for ((lane, &x), &y) in lanes.iter_mut().zip(x).zip(y) {
            *lane += x * y;
        }
    }
    for ((lane, &x), &y) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
        *lane += x * y;
    }
    fold(lanes)
}

#[inline(always)]
fn fold<T: Real>(mut lanes: [T; LANES]) -> T {
    let mut half = LANES / 2;
    while half > 0 {
        for k in 0..half {
            lanes[k] += lanes[k + half];
        }
        half /= 2;
    }
    lanes[0]
}
