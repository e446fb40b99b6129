//! Layer normalisation forward, with what happens to its output: it is set, added to what it updates, or is
//! a message that is added to its arc and to the sum of its receiver.

use pulp::{Simd, WithSimd};

use crate::kernels::gemm::{get, put};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;

/// Added to a variance before its root, as in PyTorch.
const EPSILON: f64 = 1e-5;

/// What a layer normalisation keeps of a tile of rows for its backward pass.
pub(crate) struct NormRows<'a, T> {
    /// In: the layer's input; out: (input - mean) / deviation, `[rows, width]`.
    pub(crate) normal: &'a mut [T],
    /// Out: 1 / deviation, `[rows]`.
    pub(crate) inverse_deviation: &'a mut [T],
}

/// The arcs into some vertices that lie side by side.
#[derive(Clone, Copy)]
pub(crate) struct Receivers<'a> {
    /// Of each arc.
    pub(crate) of: &'a [u32],
    /// The first of the vertices.
    pub(crate) first: usize,
}

/// What happens to the output, `[rows, width]`.
pub(crate) enum Normalised<'a, T> {
    /// It is set.
    Set(&'a mut [T]),
    /// It is added.
    Add(&'a mut [T]),
    /// It is added to the arcs and, arc after arc, to the sums of their receivers.
    Messages {
        edges: &'a mut [T],
        incoming: &'a mut [T],
        receivers: Receivers<'a>,
    },
}

/// Layer normalisation (Ba et al. 2016) `[eq:layer-norm]`: x̂ = (x - mean) / √(variance + 1e-5);
/// out = x̂ ∘ weight + shift.
pub(crate) fn layer_norm<T: Real>(
    instructions: Instructions,
    rows: NormRows<'_, T>,
    weight: &[T],
    shift: &[T],
    out: Normalised<'_, T>,
) {
    instructions.run(Norm {
        rows,
        weight,
        shift,
        out,
    });
}

struct Norm<'a, T> {
    rows: NormRows<'a, T>,
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
        let normals = self.rows.normal.chunks_exact_mut(width);
        let inverses = self.rows.inverse_deviation.iter_mut();
        for (row, (x, inverse)) in normals.zip(inverses).enumerate() {
            let mean = mean::<T, S>(simd, x);
            let scale = inverse_deviation::<T, S>(simd, x, mean);
            *inverse = scale;
            let affine = (mean, scale, self.weight, self.shift);
            let at = row * width..(row + 1) * width;
            match &mut out {
                Normalised::Set(out) => write::<T, S>(simd, x, affine, &mut out[at]),
                Normalised::Add(out) => add::<T, S>(simd, x, affine, (&mut out[at], None)),
                Normalised::Messages {
                    edges,
                    incoming,
                    receivers,
                } => {
                    let receiver = receivers.of[row] as usize - receivers.first;
                    let total = &mut incoming[receiver * width..(receiver + 1) * width];
                    add::<T, S>(simd, x, affine, (&mut edges[at], Some(total)));
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

/// Mean and inverse deviation of a row, weight and shift.
type Affine<'a, T> = (T, T, &'a [T], &'a [T]);

/// One vector of a row: its normalised numbers stay in it; gives the output.
#[inline(always)]
fn vector<T: Real, S: Simd>(
    simd: S,
    x: &mut [T],
    (mean, scale, weight, shift): Affine<'_, T>,
) -> T::Vector<S> {
    let [value] = get::<T, S, 1>(simd, x);
    let [w] = get::<T, S, 1>(simd, weight);
    let [s] = get::<T, S, 1>(simd, shift);
    let off = T::minus(simd, value, T::splat(simd, mean));
    let normal = T::times(simd, off, T::splat(simd, scale));
    put::<T, S, 1>(simd, x, [normal]);
    T::mul_add(simd, normal, w, s)
}

#[inline(always)]
fn write<T: Real, S: Simd>(simd: S, x: &mut [T], affine: Affine<'_, T>, out: &mut [T]) {
    let (lanes, (mean, scale, weight, shift)) = (T::lanes::<S>(), affine);
    let parts = x.chunks_mut(lanes).zip(out.chunks_mut(lanes));
    let parts = parts.zip(weight.chunks(lanes).zip(shift.chunks(lanes)));
    for ((x, out), (weight, shift)) in parts {
        let value = vector::<T, S>(simd, x, (mean, scale, weight, shift));
        put::<T, S, 1>(simd, out, [value]);
    }
}

#[inline(always)]
fn add<T: Real, S: Simd>(
    simd: S,
    x: &mut [T],
    affine: Affine<'_, T>,
    (out, mut total): (&mut [T], Option<&mut [T]>),
) {
    let (lanes, (mean, scale, weight, shift)) = (T::lanes::<S>(), affine);
    let parts = x.chunks_mut(lanes).zip(out.chunks_mut(lanes));
    let parts = parts.zip(weight.chunks(lanes).zip(shift.chunks(lanes)));
    for (number, ((x, out), (weight, shift))) in parts.enumerate() {
        let value = vector::<T, S>(simd, x, (mean, scale, weight, shift));
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
