//! The gates of a recurrent unit: one step forward with its products, and the gradient of a step.
//!
//! For a vector of units there are four sums: of r, the share of the old state that the candidate
//! sees; of z, the share of it that stays; and of both parts of the candidate state
//! n = tanh(new + r ∘ recurrent), new = W_in x + b_in and recurrent = W_hn h + b_hn. The products
//! with the input add to three of them, those with the state to three; the gates follow while the
//! sums are in registers.
//!
//! Orders of the gates in rows of `hidden` columns each:
//! - **weights** and biases, as PyTorch stores them: r, z, n;
//! - **kept** for the backward pass, and the sums: r, z, n or new, recurrent;
//! - **gradients** of the sums: new, r, z, recurrent. The first three are the gradients of the
//!   products with the input, the last three those of the products with the state.

use pulp::{Simd, WithSimd};

use crate::kernels::gemm::{LaneCount, get, put};
use crate::kernels::real::Real;
use crate::kernels::simd::{Instructions, Lanes, has_32_registers};

/// Places of both parts of the candidate among the sums.
const NEW: usize = 2;
const RECURRENT: usize = 3;

/// Most rows that are summed at a time.
const ROWS: usize = 6;

/// One step of a layer of recurrent units, rows of `hidden` values each.
pub(crate) struct GruStep<'a, T> {
    /// In: `[rows, inputs]`.
    pub(crate) input: &'a [T],
    pub(crate) inputs: usize,
    /// In: the state before `[rows, hidden]`; none is zero.
    pub(crate) before: Option<&'a [T]>,
    /// In: weights as [`pack_gates`] leaves them.
    pub(crate) packed: &'a [T],
    /// In: biases as [`pack_biases`] leaves them.
    pub(crate) biases: &'a [T],
    pub(crate) hidden: usize,
    /// Out: the state after `[rows, hidden]`.
    pub(crate) after: &'a mut [T],
    /// Out, unless empty: the gates that are kept, `[rows, 4 hidden]`.
    pub(crate) kept: &'a mut [T],
}

/// Packs the matrices W_ih `[3 hidden, inputs]` and W_hh `[3 hidden, hidden]` of a layer, each with
/// its number of columns: for each vector of units the weights of the input, then those of the
/// state, gates r, z, n. The slot of `out` has depth inputs + hidden and columns 3 hidden.
pub(crate) fn pack_gates<T: Real>(
    instructions: Instructions,
    matrices: [(&[T], usize); 2],
    out: &mut [T],
) {
    let [_, (_, hidden)] = matrices;
    let lanes = T::run(instructions, LaneCount::<T>::default());
    let mut rows = out.chunks_exact_mut(3 * lanes);
    for first in (0..hidden).step_by(lanes) {
        for (weight, count) in matrices {
            for (l, row) in rows.by_ref().take(count).enumerate() {
                for (gate, part) in row.chunks_exact_mut(lanes).enumerate() {
                    for (lane, to) in part.iter_mut().enumerate() {
                        let unit = first + lane;
                        *to = if unit < hidden {
                            weight[(gate * hidden + unit) * count + l]
                        } else {
                            T::ZERO
                        };
                    }
                }
            }
        }
    }
}

/// Packs the biases b_ih and b_hh, `[3 hidden]` each: for each vector of units those of r and z,
/// summed, then both of n.
pub(crate) fn pack_biases<T: Real>(
    instructions: Instructions,
    [input, state]: [&[T]; 2],
    out: &mut [T],
) {
    let hidden = input.len() / 3;
    let lanes = T::run(instructions, LaneCount::<T>::default());
    let vectors = out.chunks_exact_mut(4 * lanes);
    for (number, vector) in vectors.take(hidden.div_ceil(lanes)).enumerate() {
        for lane in 0..lanes {
            let unit = number * lanes + lane;
            let of = |bias: &[T], gate: usize| {
                if unit < hidden { bias[gate * hidden + unit] } else { T::ZERO }
            };
            for gate in 0..2 {
                vector[gate * lanes + lane] = of(input, gate) + of(state, gate);
            }
            vector[NEW * lanes + lane] = of(input, 2);
            vector[RECURRENT * lanes + lane] = of(state, 2);
        }
    }
}

/// One step of a gated recurrent unit as PyTorch defines it (Cho et al. 2014) `[eq:gru]`:
/// r, z = σ(..), n = tanh(W_in x + b_in + r ∘ (W_hn h + b_hn)), h' = (1 - z) ∘ n + z ∘ h.
pub(crate) fn gru_step<T: Real>(instructions: Instructions, step: GruStep<'_, T>) {
    let rows = step.after.len() / step.hidden;
    assert_eq!(step.input.len(), rows * step.inputs, "rows of an input");
    T::run(instructions, step);
}

impl<T: Real> WithSimd for GruStep<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let rows = self.after.len() / self.hidden;
        for first in (0..self.hidden).step_by(T::lanes::<S>()) {
            let mut row = 0;
            while has_32_registers::<S>() && row + ROWS <= rows {
                self.units::<S, ROWS>(simd, row, first);
                row += ROWS;
            }
            while row + 2 <= rows {
                self.units::<S, 2>(simd, row, first);
                row += 2;
            }
            if row < rows {
                self.units::<S, 1>(simd, row, first);
            }
        }
    }
}

impl<T: Real> GruStep<'_, T> {
    /// `M` rows and the units `first..` of a vector.
    #[inline(always)]
    fn units<S: Simd, const M: usize>(&mut self, simd: S, row: usize, first: usize) {
        let lanes = T::lanes::<S>();
        let (inputs, hidden) = (self.inputs, self.hidden);
        let biases = T::vectors::<S>(&self.biases[4 * first..4 * (first + lanes)]);
        let mut bias = [T::splat(simd, T::ZERO); 4];
        bias.copy_from_slice(biases);
        let mut sums = [bias; M];
        let packed = &self.packed[3 * first * (inputs + hidden)..];
        let (of_input, of_state) = packed.split_at(3 * lanes * inputs);
        let input = rows_from::<T, M>(self.input, inputs, row);
        add_terms::<T, S, M>(simd, &mut sums, input, of_input, NEW);
        if let Some(before) = self.before {
            let of_state = &of_state[..3 * lanes * hidden];
            let before = rows_from::<T, M>(before, hidden, row);
            add_terms::<T, S, M>(simd, &mut sums, before, of_state, RECURRENT);
        }
        for (r, sums) in sums.into_iter().enumerate() {
            self.gates(simd, row + r, first, sums);
        }
    }

    /// The units `first..` of the state after from their sums.
    #[inline(always)]
    fn gates<S: Simd>(&mut self, simd: S, row: usize, first: usize, sums: [T::Vector<S>; 4]) {
        let hidden = self.hidden;
        let count = T::lanes::<S>().min(hidden - first);
        let at = row * hidden + first;
        let [r, z, n, recurrent] = sums;
        let (r, z) = (T::sigmoids(simd, r), T::sigmoids(simd, z));
        let n = T::tanhs(simd, T::mul_add(simd, r, recurrent, n));
        let mut before = T::splat(simd, T::ZERO);
        if let Some(states) = self.before {
            [before] = get::<T, S, 1>(simd, &states[at..at + count]);
        }
        let after = T::mul_add(simd, z, T::minus(simd, before, n), n);
        put::<T, S, 1>(simd, &mut self.after[at..at + count], [after]);
        if !self.kept.is_empty() {
            let kept = &mut self.kept[row * 4 * hidden..][..4 * hidden];
            for (gate, values) in [r, z, n, recurrent].into_iter().enumerate() {
                let to = &mut kept[gate * hidden + first..][..count];
                put::<T, S, 1>(simd, to, [values]);
            }
        }
    }
}

/// `M` rows of `depth` numbers, from number `row` of `values` on.
#[inline(always)]
fn rows_from<T, const M: usize>(values: &[T], depth: usize, row: usize) -> [&[T]; M] {
    std::array::from_fn(|r| &values[(row + r) * depth..][..depth])
}

/// Adds the products of `M` rows to the sums of r, of z and of `third`, one part of n.
#[inline(always)]
fn add_terms<T: Lanes, S: Simd, const M: usize>(
    simd: S,
    sums: &mut [[T::Vector<S>; 4]; M],
    rows: [&[T]; M],
    weights: &[T],
    third: usize,
) {
    let depth = rows[0].len();
    let weights = &T::vectors::<S>(weights).as_chunks::<3>().0[..depth];
    for (l, &[of_r, of_z, of_n]) in weights.iter().enumerate() {
        for (sums, values) in sums.iter_mut().zip(rows) {
            let value = T::splat(simd, values[l]);
            sums[0] = T::mul_add(simd, value, of_r, sums[0]);
            sums[1] = T::mul_add(simd, value, of_z, sums[1]);
            sums[third] = T::mul_add(simd, value, of_n, sums[third]);
        }
    }
}

/// The gradient of the gates of [`gru_step`], to be run.
pub(crate) struct GateGradients<'a, T> {
    pub(crate) hidden: usize,
    /// In: the gates that the forward pass kept, `[rows, 4 hidden]`.
    pub(crate) kept: &'a [T],
    /// In: the state before, `[rows, hidden]`.
    pub(crate) before: &'a [T],
    /// In: gradient of the state after; out: its direct part for the state before.
    pub(crate) state: &'a mut [T],
    /// Out: gradients of the sums, `[rows, 4 hidden]`.
    pub(crate) sums: &'a mut [T],
}

impl<T: Real> WithSimd for GateGradients<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let hidden = self.hidden;
        let rows = self
            .kept
            .chunks_exact(4 * hidden)
            .zip(self.before.chunks_exact(hidden))
            .zip(self.state.chunks_exact_mut(hidden))
            .zip(self.sums.chunks_exact_mut(4 * hidden));
        for (((kept, before), state), sums) in rows {
            let mut row = GateGradients {
                hidden,
                kept,
                before,
                state,
                sums,
            };
            for first in (0..hidden).step_by(T::lanes::<S>()) {
                let units = first..hidden.min(first + T::lanes::<S>());
                units_backward::<T, S>(simd, &mut row, units);
            }
        }
    }
}

/// The units `units` of a row, at most a vector of them.
#[inline(always)]
fn units_backward<T: Real, S: Simd>(
    simd: S,
    row: &mut GateGradients<'_, T>,
    units: std::ops::Range<usize>,
) {
    let (hidden, count) = (row.hidden, units.len());
    let at = |gate: usize| gate * hidden + units.start;
    let [r] = get::<T, S, 1>(simd, &row.kept[at(0)..][..count]);
    let [z] = get::<T, S, 1>(simd, &row.kept[at(1)..][..count]);
    let [n] = get::<T, S, 1>(simd, &row.kept[at(NEW)..][..count]);
    let [recurrent] = get::<T, S, 1>(simd, &row.kept[at(RECURRENT)..][..count]);
    let [before] = get::<T, S, 1>(simd, &row.before[units.clone()]);
    let [after] = get::<T, S, 1>(simd, &row.state[units.clone()]);
    let one = T::splat(simd, T::ONE);
    let slope_n = T::minus(simd, one, T::times(simd, n, n));
    let not_z = T::minus(simd, one, z);
    let slope_r = T::times(simd, r, T::minus(simd, one, r));
    let to_n = T::times(simd, T::times(simd, after, not_z), slope_n);
    let along_z = T::times(simd, after, T::minus(simd, before, n));
    let to_z = T::times(simd, along_z, T::times(simd, z, not_z));
    let to_r = T::times(simd, T::times(simd, to_n, recurrent), slope_r);
    let to_recurrent = T::times(simd, to_n, r);
    for (gate, gradient) in [to_n, to_r, to_z, to_recurrent].into_iter().enumerate() {
        let first = gate * hidden + units.start;
        put::<T, S, 1>(simd, &mut row.sums[first..first + count], [gradient]);
    }
    put::<T, S, 1>(simd, &mut row.state[units], [T::times(simd, after, z)]);
}
