//! The gates of a recurrent unit, forward and backward, on rows of one step.

use super::vectorised;
use crate::real::Real;

// Slices of one known length, so that the loops over them need no bounds checks and vectorise.

#[inline(always)]
fn thirds<T>(row: &[T], width: usize) -> [&[T]; 3] {
    [0, 1, 2].map(|k| &row[k * width..][..width])
}

#[inline(always)]
fn halves_mut<T>(row: &mut [T], width: usize) -> [&mut [T]; 2] {
    let (first, second) = row.split_at_mut(width);
    [&mut first[..width], &mut second[..width]]
}

/// The gates of one step of a recurrent unit, rows of `hidden` values each.
pub(crate) struct Gates<'a, T> {
    /// In: input part with its bias, `[rows, 3 hidden]`, gates r, z, n.
    pub(crate) from_input: &'a [T],
    /// In: hidden part without its bias, `[rows, 3 hidden]`.
    pub(crate) from_hidden: &'a [T],
    /// In: bias of the hidden part, `[3 hidden]`.
    pub(crate) bias_hidden: &'a [T],
    /// In: the state before, `[rows, hidden]`.
    pub(crate) before: &'a [T],
    /// Out: r, z, n and W_hn h + b_hn, kept for the backward pass, `[rows, 4 hidden]`.
    pub(crate) kept: &'a mut [T],
    /// Out: the state after, `[rows, hidden]`.
    pub(crate) after: &'a mut [T],
}

/// One step of a gated recurrent unit as PyTorch defines it (Cho et al. 2014) `[eq:gru]`:
/// r, z = σ(..), n = tanh(W_in x + b_in + r ∘ (W_hn h + b_hn)), h' = (1 - z) ∘ n + z ∘ h.
pub(crate) fn gru_gates<T: Real>(gates: Gates<'_, T>, hidden: usize) {
    vectorised(
        #[inline(always)]
        || {
            let rows = gates
                .from_input
                .chunks_exact(3 * hidden)
                .zip(gates.from_hidden.chunks_exact(3 * hidden))
                .zip(gates.before.chunks_exact(hidden))
                .zip(gates.kept.chunks_exact_mut(4 * hidden))
                .zip(gates.after.chunks_exact_mut(hidden));
            let [bias_r, bias_z, bias_n] = thirds(gates.bias_hidden, hidden);
            for ((((input, state), before), kept), after) in rows {
                let [input_r, input_z, input_n] = thirds(input, hidden);
                let [state_r, state_z, state_n] = thirds(state, hidden);
                let (gates_rz, rest) = kept.split_at_mut(2 * hidden);
                let [r, z] = halves_mut(gates_rz, hidden);
                let [n, recurrent] = halves_mut(rest, hidden);
                let (before, after) = (&before[..hidden], &mut after[..hidden]);
                // Short loops over few slices: one over all of them does not vectorise.
                for (((r, &i), &s), &b) in r.iter_mut().zip(input_r).zip(state_r).zip(bias_r) {
                    *r = (i + s + b).sigmoid();
                }
                for (((z, &i), &s), &b) in z.iter_mut().zip(input_z).zip(state_z).zip(bias_z) {
                    *z = (i + s + b).sigmoid();
                }
                for ((x, &s), &b) in recurrent.iter_mut().zip(state_n).zip(bias_n) {
                    *x = s + b;
                }
                for (((n, &i), &r), &x) in n.iter_mut().zip(input_n).zip(&*r).zip(&*recurrent) {
                    *n = (i + r * x).tanh();
                }
                for (((a, &n), &z), &b) in after.iter_mut().zip(&*n).zip(&*z).zip(before) {
                    *a = n + z * (b - n);
                }
            }
        },
    );
}

/// Buffers of the gradient of [`gru_gates`].
pub(crate) struct GateGradients<'a, T> {
    /// In: r, z, n, W_hn h + b_hn of the forward pass, `[rows, 4 hidden]`.
    pub(crate) kept: &'a [T],
    /// In: the state before, `[rows, hidden]`.
    pub(crate) before: &'a [T],
    /// In: gradient of the state after; out: its direct part for the state before.
    pub(crate) state: &'a mut [T],
    /// Out: gradient of the input part, `[rows, 3 hidden]`.
    pub(crate) input: &'a mut [T],
    /// Out: gradient of the hidden part, `[rows, 3 hidden]`.
    pub(crate) hidden: &'a mut [T],
}

/// The gradient of [`gru_gates`].
pub(crate) fn gru_gates_backward<T: Real>(gates: GateGradients<'_, T>, hidden: usize) {
    vectorised(
        #[inline(always)]
        || {
            let rows = gates
                .kept
                .chunks_exact(4 * hidden)
                .zip(gates.before.chunks_exact(hidden))
                .zip(gates.state.chunks_exact_mut(hidden))
                .zip(gates.input.chunks_exact_mut(3 * hidden))
                .zip(gates.hidden.chunks_exact_mut(3 * hidden));
            for ((((kept, before), state), to_input), to_hidden) in rows {
                let [r, z, n] = thirds(kept, hidden);
                let recurrent = &kept[3 * hidden..][..hidden];
                let (input_rz, input_n) = to_input.split_at_mut(2 * hidden);
                let [input_r, input_z] = halves_mut(input_rz, hidden);
                let (hidden_rz, hidden_n) = to_hidden.split_at_mut(2 * hidden);
                let [hidden_r, hidden_z] = halves_mut(hidden_rz, hidden);
                let (input_n, hidden_n) = (&mut input_n[..hidden], &mut hidden_n[..hidden]);
                let (before, state) = (&before[..hidden], &mut state[..hidden]);
                for k in 0..hidden {
                    input_n[k] = state[k] * (T::ONE - z[k]) * (T::ONE - n[k] * n[k]);
                }
                for k in 0..hidden {
                    input_z[k] = state[k] * (before[k] - n[k]) * z[k] * (T::ONE - z[k]);
                }
                for k in 0..hidden {
                    input_r[k] = input_n[k] * recurrent[k] * r[k] * (T::ONE - r[k]);
                }
                for k in 0..hidden {
                    hidden_n[k] = input_n[k] * r[k];
                }
                for k in 0..hidden {
                    state[k] *= z[k];
                }
                hidden_r.copy_from_slice(input_r);
                hidden_z.copy_from_slice(input_z);
            }
        },
    );
}
