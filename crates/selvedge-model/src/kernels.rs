//! Element-wise arithmetic on rows: bias and ReLU, layer normalisation, sums of columns
//! and of messages, each forward and backward; the gates of a recurrent unit are in `gates`.
//!
//! Written as plain loops that the compiler vectorises; `pulp` compiles them once per instruction
//! set (baseline, AVX2, AVX-512, NEON) and chooses at run time. Sums run over fixed lanes in a fixed order,
//! so that the choice never changes a bit (no fused multiply-add is used here).

mod gates;

use pulp::{Arch, Simd, WithSimd};

use crate::real::Real;
pub(crate) use gates::{GateGradients, Gates, gru_gates, gru_gates_backward};

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
