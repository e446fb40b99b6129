//! The gates of a recurrent unit: a step forward with its products, all gates in one pass, and the
//! gradient of the gates.
//!
//! For a vector of units there are four sums: r, z, and the input's and the state's part of n. The
//! products with the input add to three of them, those with the state to three; the gates
//! follow while the sums are at hand.

use pulp::{Simd, WithSimd};

use crate::kernels::gemm::{LaneCount, Slot, get, put};
use crate::kernels::real::Real;
use crate::kernels::simd::{Instructions, Lanes, MOST_LANES};

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
    /// Out, unless empty: r, z, n and W_hn h + b_hn for the backward pass, `[rows, 4 hidden]`.
    pub(crate) kept: &'a mut [T],
}

/// Packs the weights of a layer, gates r, z, n: for each vector of units the weights of the input,
/// then those of the state. `slot` has depth inputs + hidden and columns 3 hidden.
pub(crate) fn pack_gates<T: Real>(
    instructions: Instructions,
    (inputs, hidden): (usize, usize),
    [weight_ih, weight_hh]: [&[T]; 2],
    out: &mut [T],
) {
    let lanes = instructions.run(LaneCount::<T>::default());
    let mut rows = out.chunks_exact_mut(3 * lanes);
    for first in (0..hidden).step_by(lanes) {
        for (weight, count) in [(weight_ih, inputs), (weight_hh, hidden)] {
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

/// Room for the packed weights and biases of a layer.
pub(crate) fn gate_slots(
    size: &mut crate::network::packed::ModuleSize,
    inputs: usize,
    hidden: usize,
) -> [Slot; 2] {
    let padded = hidden.next_multiple_of(MOST_LANES);
    [
        size.forward(inputs + hidden, 3 * padded),
        size.forward(1, 4 * padded),
    ]
}

/// Packs the biases: for each vector of units those of r and z, summed, then both of n.
pub(crate) fn pack_biases<T: Real>(
    instructions: Instructions,
    hidden: usize,
    [bias_ih, bias_hh]: [&[T]; 2],
    out: &mut [T],
) {
    let lanes = instructions.run(LaneCount::<T>::default());
    let vectors = out.chunks_exact_mut(4 * lanes);
    for (number, vector) in vectors.take(hidden.div_ceil(lanes)).enumerate() {
        for lane in 0..lanes {
            let unit = number * lanes + lane;
            let at = |bias: &[T], gate: usize| {
                if unit < hidden {
                    bias[gate * hidden + unit]
                } else {
                    T::ZERO
                }
            };
            vector[lane] = at(bias_ih, 0) + at(bias_hh, 0);
            vector[lanes + lane] = at(bias_ih, 1) + at(bias_hh, 1);
            vector[2 * lanes + lane] = at(bias_ih, 2);
            vector[3 * lanes + lane] = at(bias_hh, 2);
        }
    }
}

/// One step of a gated recurrent unit as PyTorch defines it (Cho et al. 2014) `[eq:gru]`:
/// r, z = σ(..), n = tanh(W_in x + b_in + r ∘ (W_hn h + b_hn)), h' = (1 - z) ∘ n + z ∘ h.
pub(crate) fn gru_step<T: Real>(instructions: Instructions, step: GruStep<'_, T>) {
    let rows = step.after.len() / step.hidden;
    assert_eq!(step.input.len(), rows * step.inputs, "rows of an input");
    instructions.run(step);
}

impl<T: Real> WithSimd for GruStep<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let rows = self.after.len() / self.hidden;
        for first in (0..self.hidden).step_by(T::lanes::<S>()) {
            let mut row = 0;
            while S::REGISTER_COUNT >= 32 && row + ROWS <= rows {
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
        add_terms::<T, S, M>(simd, &mut sums, (self.input, inputs, row), of_input, 2);
        if let Some(before) = self.before {
            let of_state = &of_state[..3 * lanes * hidden];
            add_terms::<T, S, M>(simd, &mut sums, (before, hidden, row), of_state, 3);
        }
        for (r, sums) in sums.into_iter().enumerate() {
            self.gates(simd, (row + r, first), sums);
        }
    }

    /// From the sums of a row to the units of its state after.
    #[inline(always)]
    fn gates<S: Simd>(&mut self, simd: S, (row, first): (usize, usize), sums: [T::Vector<S>; 4]) {
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

/// Adds the products of `M` rows to the sums of r, z and, in place `third`, one part of n.
#[inline(always)]
fn add_terms<T: Lanes, S: Simd, const M: usize>(
    simd: S,
    sums: &mut [[T::Vector<S>; 4]; M],
    (rows, depth, row): (&[T], usize, usize),
    weights: &[T],
    third: usize,
) {
    let rows: [&[T]; M] = std::array::from_fn(|r| &rows[(row + r) * depth..][..depth]);
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

/// Buffers of the gradient of the gates of [`gru_step`].
pub(crate) struct GateGradients<'a, T> {
    /// In: r, z, n, W_hn h + b_hn of the forward pass, `[rows, 4 hidden]`.
    pub(crate) kept: &'a [T],
    /// In: the state before, `[rows, hidden]`.
    pub(crate) before: &'a [T],
    /// In: gradient of the state after; out: its direct part for the state before.
    pub(crate) state: &'a mut [T],
    /// Out: gradients of the sums: n's input part, r, z, n's state part, `[rows, 4 hidden]`. The first
    /// three are the input's, the last three the state's.
    pub(crate) sums: &'a mut [T],
}

/// The gradient of the gates of [`gru_step`].
pub(crate) fn gru_gates_backward<T: Real>(
    instructions: Instructions,
    gates: GateGradients<'_, T>,
    hidden: usize,
) {
    instructions.run(Backward { gates, hidden });
}

struct Backward<'a, T> {
    gates: GateGradients<'a, T>,
    hidden: usize,
}

impl<T: Real> WithSimd for Backward<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (gates, hidden) = (self.gates, self.hidden);
        let rows = gates
            .kept
            .chunks_exact(4 * hidden)
            .zip(gates.before.chunks_exact(hidden))
            .zip(gates.state.chunks_exact_mut(hidden))
            .zip(gates.sums.chunks_exact_mut(4 * hidden));
        for (((kept, before), state), sums) in rows {
            for first in (0..hidden).step_by(T::lanes::<S>()) {
                let units = first..hidden.min(first + T::lanes::<S>());
                units_backward::<T, S>(simd, (kept, before), (state, sums), units);
            }
        }
    }
}

/// The units `units` of a row, at most a vector of them.
#[inline(always)]
fn units_backward<T: Real, S: Simd>(
    simd: S,
    (kept, before): (&[T], &[T]),
    (state, sums): (&mut [T], &mut [T]),
    units: std::ops::Range<usize>,
) {
    let (hidden, count) = (before.len(), units.len());
    let [r] = get::<T, S, 1>(simd, &kept[units.start..][..count]);
    let [z] = get::<T, S, 1>(simd, &kept[hidden + units.start..][..count]);
    let [n] = get::<T, S, 1>(simd, &kept[2 * hidden + units.start..][..count]);
    let [recurrent] = get::<T, S, 1>(simd, &kept[3 * hidden + units.start..][..count]);
    let [before] = get::<T, S, 1>(simd, &before[units.clone()]);
    let [after] = get::<T, S, 1>(simd, &state[units.clone()]);
    let one = T::splat(simd, T::ONE);
    let slope_n = T::minus(simd, one, T::times(simd, n, n));
    let not_z = T::minus(simd, one, z);
    let slope_r = T::times(simd, r, T::minus(simd, one, r));
    let to_n = T::times(simd, T::times(simd, after, not_z), slope_n);
    let along_z = T::times(simd, after, T::minus(simd, before, n));
    let to_z = T::times(simd, along_z, T::times(simd, z, not_z));
    let to_r = T::times(simd, T::times(simd, to_n, recurrent), slope_r);
    let to_recurrent = T::times(simd, to_n, r);
    let mut first = units.start;
    for gradient in [to_n, to_r, to_z, to_recurrent] {
        put::<T, S, 1>(simd, &mut sums[first..first + count], [gradient]);
        first += hidden;
    }
    put::<T, S, 1>(simd, &mut state[units], [T::times(simd, after, z)]);
}
