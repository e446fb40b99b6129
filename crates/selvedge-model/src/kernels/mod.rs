//! Element-wise arithmetic on rows: layer normalisation, sums of columns and of messages, each
//! forward and backward; the gates of a recurrent unit are in `gates`. Bias and ReLU are done where
//! their product is ([`crate::kernels::gemm`]).
//!
//! Written as plain loops that the compiler vectorises, compiled once per instruction set. Sums run
//! over fixed lanes in a fixed order, so that the choice never changes a bit (no fused multiply-add
//! is used here).

pub(crate) mod aligned;
mod dropout;
mod gates;
pub(crate) mod gemm;
mod norm;
pub(crate) mod outer;
pub(crate) mod real;
pub(crate) mod simd;

use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
pub use dropout::Dropout;
pub(crate) use dropout::{ClothRows, RowMasks};
pub(crate) use gates::{
    GateGradients, GruStep, gate_slots, gru_gates_backward, gru_step, pack_biases, pack_gates,
};
pub(crate) use norm::{NormRows, Normalised, Receivers, layer_norm};

/// Lanes of a sum over a row.
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

/// to ← to + from.
pub(crate) fn add<T: Real>(instructions: Instructions, to: &mut [T], from: &[T]) {
    instructions.vectorised(
        #[inline(always)]
        || {
            for (x, &y) in to.iter_mut().zip(from) {
                *x += y;
            }
        },
    );
}

/// sums ← sums + the sum of all rows: the gradient of a bias.
pub(crate) fn add_column_sums<T: Real>(instructions: Instructions, sums: &mut [T], rows: &[T]) {
    instructions.vectorised(
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

/// The gradient of [`layer_norm`]: `gradient` holds that of the output and receives that of the
/// input; those of weight and shift are added to; `normal` and `inverse_deviation` are the forward pass's.
pub(crate) fn layer_norm_backward<T: Real>(
    instructions: Instructions,
    gradient: &mut [T],
    (normal, inverse_deviation): (&[T], &[T]),
    weight: &[T],
    (weight_gradient, shift_gradient): (&mut [T], &mut [T]),
) {
    let width = weight.len();
    let inverse_width = T::from_f64(1.0 / width as f64);
    instructions.vectorised(
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

/// to\[receiver\] ← to\[receiver\] + row, arc after arc; rows of `to` are `stride` apart and begin with
/// column `column`.
pub(crate) fn sum_incoming<T: Real>(
    instructions: Instructions,
    to: &mut [T],
    (width, stride, column): (usize, usize, usize),
    rows: &[T],
    receivers: Receivers<'_>,
) {
    instructions.vectorised(
        #[inline(always)]
        || {
            for (row, &r) in rows.chunks_exact(width).zip(receivers.of) {
                let start = (r as usize - receivers.first) * stride + column;
                for (total, &x) in to[start..start + width].iter_mut().zip(row) {
                    *total += x;
                }
            }
        },
    );
}

/// The first `width` columns of rows of `stride` ← Σ rows\[a\] over the arcs that leave a vertex: the
/// twins of those that arrive, which are `first_arc[v]..first_arc[v + 1]`.
pub(crate) fn sum_outgoing<T: Real>(
    instructions: Instructions,
    to: &mut [T],
    (width, stride): (usize, usize),
    rows: &[T],
    (first_arc, twins): (&[u32], &[u32]),
) {
    instructions.vectorised(
        #[inline(always)]
        || {
            for (total, ends) in to.chunks_exact_mut(stride).zip(first_arc.windows(2)) {
                let total = &mut total[..width];
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

/// to\[a\] ← rows\[a\] + at_receiver\[receiver\]: the gradient of a message.
pub(crate) fn gather_receivers<T: Real>(
    instructions: Instructions,
    to: &mut [T],
    width: usize,
    (rows, at_receiver): (&[T], &[T]),
    receivers: Receivers<'_>,
) {
    instructions.vectorised(
        #[inline(always)]
        || {
            let both = to.chunks_exact_mut(width).zip(rows.chunks_exact(width));
            for ((to, row), &r) in both.zip(receivers.of) {
                let at = &at_receiver[(r as usize - receivers.first) * width..][..width];
                for ((to, &x), &y) in to.iter_mut().zip(row).zip(at) {
                    *to = x + y;
                }
            }
        },
    );
}
