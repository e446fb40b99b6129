//! Element-wise arithmetic on rows: bias and ReLU, layer normalisation, gates of a recurrent unit,
//! sums of columns and of messages, each forward and backward.
//!
//! Written as plain loops that the compiler vectorises; `pulp` compiles them once per instruction
//! set (baseline, AVX2, AVX-512, NEON) and chooses at run time. Sums run over fixed lanes in a fixed order,
//! so that the choice never changes a bit (no fused multiply-add is used here).

use pulp::{Arch, Simd, WithSimd};

use crate::real::Real;

/// Lanes of a sum over a row.
const LANES: usize = 16;

/// Added to a variance before its root, as in PyTorch.
const LAYER_NORM_EPSILON: f64 = 1e-5;

struct Loop<F>(F);

impl<F: FnMut()> WithSimd for Loop<F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        (self.0)();
    }
}

/// Runs a loop compiled for the widest vectors of this machine.
///
/// The loop is an `FnMut`, not an `FnOnce`: the body of an inlined closure is inlined where its
/// own kind is called, but not through the shim that makes an `FnOnce` of it, and would then be
/// compiled for the baseline.
#[inline(always)]
fn vectorised(body: impl FnMut()) {
    Arch::new().dispatch(Loop(body));
}

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

/// rows ← max(rows + bias, 0).
pub(crate) fn bias_relu<T: Real>(rows: &mut [T], bias: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for row in rows.chunks_exact_mut(bias.len()) {
                for (x, &b) in row.iter_mut().zip(bias) {
                    *x = T::ZERO.larger(*x + b);
                }
            }
        },
    );
}

/// rows ← rows + bias.
pub(crate) fn add_bias<T: Real>(rows: &mut [T], bias: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for row in rows.chunks_exact_mut(bias.len()) {
                for (x, &b) in row.iter_mut().zip(bias) {
                    *x += b;
                }
            }
        },
    );
}

/// to ← to + from.
pub(crate) fn add<T: Real>(to: &mut [T], from: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for (x, &y) in to.iter_mut().zip(from) {
                *x += y;
            }
        },
    );
}

/// gradient ← 0 where the activation of a ReLU is 0.
pub(crate) fn relu_backward<T: Real>(gradient: &mut [T], activation: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for (g, &a) in gradient.iter_mut().zip(activation) {
                *g = if a > T::ZERO { *g } else { T::ZERO };
            }
        },
    );
}

/// sums ← sums + the sum of all rows: the gradient of a bias.
pub(crate) fn add_column_sums<T: Real>(sums: &mut [T], rows: &[T]) {
    vectorised(
        #[inline(always)]
        || {
            for row in rows.chunks_exact(sums.len()) {
                for (total, &x) in sums.iter_mut().zip(row) {
                    *total += x;
                }
            }
        },
    );
}

/// What a layer normalisation keeps of a tile of rows for its backward pass.
pub(crate) struct NormRows<'a, T> {
    /// In: the layer's input; out: (input - mean) / deviation, `[rows, width]`.
    pub(crate) normal: &'a mut [T],
    /// Out: 1 / deviation, `[rows]`.
    pub(crate) inverse_deviation: &'a mut [T],
}

/// Layer normalisation (Ba et al. 2016) with the bias of the linear layer before it
/// `[eq:layer-norm]`: x ← x + bias; x̂ = (x - mean) / √(variance + 1e-5); out = x̂ ∘ weight + shift.
pub(crate) fn layer_norm<T: Real>(
    rows: NormRows<'_, T>,
    linear_bias: &[T],
    weight: &[T],
    shift: &[T],
    out: &mut [T],
) {
    let width = weight.len();
    let inverse_width = T::from_f64(1.0 / width as f64);
    let epsilon = T::from_f64(LAYER_NORM_EPSILON);
    vectorised(
        #[inline(always)]
        || {
            let normals = rows.normal.chunks_exact_mut(width);
            let outs = out.chunks_exact_mut(width);
            for ((x, out), inverse) in normals.zip(outs).zip(rows.inverse_deviation.iter_mut()) {
                for (x, &b) in x.iter_mut().zip(linear_bias) {
                    *x += b;
                }
                let mean = sum(x) * inverse_width;
                for x in x.iter_mut() {
                    *x -= mean;
                }
                let variance = dot(x, x) * inverse_width;
                *inverse = T::ONE / (variance + epsilon).sqrt();
                for (((x, out), &w), &s) in x.iter_mut().zip(out).zip(weight).zip(shift) {
                    *x *= *inverse;
                    *out = *x * w + s;
                }
            }
        },
    );
}

/// The gradient of [`layer_norm`]: `gradient` holds that of the output and receives that of the
/// input; those of weight and shift are added to; `normal` and `inverse_deviation` are the forward pass's.
pub(crate) fn layer_norm_backward<T: Real>(
    gradient: &mut [T],
    (normal, inverse_deviation): (&[T], &[T]),
    weight: &[T],
    weight_gradient: &mut [T],
    shift_gradient: &mut [T],
) {
    let width = weight.len();
    let inverse_width = T::from_f64(1.0 / width as f64);
    vectorised(
        #[inline(always)]
        || {
            let gradients = gradient.chunks_exact_mut(width);
            let normals = normal.chunks_exact(width);
            for ((g, x), &inverse) in gradients.zip(normals).zip(inverse_deviation) {
                let dw = &mut weight_gradient[..width];
                let ds = &mut shift_gradient[..width];
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

/// rows\[a\] ← rows\[a\] + at_sender\[senders\[a\]\] + at_receiver\[receivers\[a\]\]: the split
/// first layer of an edge update.
pub(crate) fn gather_add<T: Real>(
    rows: &mut [T],
    width: usize,
    ends: (&[u32], &[u32]),
    at_sender: &[T],
    at_receiver: &[T],
) {
    vectorised(
        #[inline(always)]
        || {
            let (senders, receivers) = ends;
            for ((row, &s), &r) in rows.chunks_exact_mut(width).zip(senders).zip(receivers) {
                let s = &at_sender[s as usize * width..][..width];
                let r = &at_receiver[r as usize * width..][..width];
                for ((x, &s), &r) in row.iter_mut().zip(s).zip(r) {
                    *x += s + r;
                }
            }
        },
    );
}

/// sums\[v\] = Σ messages\[a\] over the arcs into v, which lie side by side.
pub(crate) fn sum_incoming<T: Real>(
    sums: &mut [T],
    width: usize,
    messages: &[T],
    first_arc: &[u32],
) {
    vectorised(
        #[inline(always)]
        || {
            for (row, ends) in sums.chunks_exact_mut(width).zip(first_arc.windows(2)) {
                row.fill(T::ZERO);
                let arcs = &messages[ends[0] as usize * width..ends[1] as usize * width];
                for message in arcs.chunks_exact(width) {
                    for (total, &x) in row.iter_mut().zip(message) {
                        *total += x;
                    }
                }
            }
        },
    );
}

/// sums\[v\] = Σ rows\[a\] over the arcs that leave v: the twins of those that arrive.
pub(crate) fn sum_outgoing<T: Real>(
    sums: &mut [T],
    width: usize,
    rows: &[T],
    (first_arc, twins): (&[u32], &[u32]),
) {
    vectorised(
        #[inline(always)]
        || {
            for (total, ends) in sums.chunks_exact_mut(width).zip(first_arc.windows(2)) {
                total.fill(T::ZERO);
                for &twin in &twins[ends[0] as usize..ends[1] as usize] {
                    let row = &rows[twin as usize * width..][..width];
                    for (total, &x) in total.iter_mut().zip(row) {
                        *total += x;
                    }
                }
            }
        },
    );
}

/// rows\[a\] ← rows\[a\] + at_receiver\[receivers\[a\]\]: the gradient of a sum of messages.
pub(crate) fn scatter_add<T: Real>(
    rows: &mut [T],
    width: usize,
    receivers: &[u32],
    at_receiver: &[T],
) {
    vectorised(
        #[inline(always)]
        || {
            for (row, &r) in rows.chunks_exact_mut(width).zip(receivers) {
                let r = &at_receiver[r as usize * width..][..width];
                for (x, &y) in row.iter_mut().zip(r) {
                    *x += y;
                }
            }
        },
    );
}
