//! Sums of rows: of columns, of the messages that arrive at a vertex, and of those that leave it.
//!
//! The loops are plain and the compiler vectorises them, once per instruction set. No fused
//! multiply-add is used, so that the instruction set never changes a bit.

use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;

/// Receivers of the arcs into a contiguous range of vertices.
#[derive(Clone, Copy)]
pub(crate) struct Receivers<'a> {
    /// Receiver of each arc, `[arcs]`.
    pub(crate) of: &'a [u32],
    /// First vertex of the range.
    pub(crate) first: usize,
}

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

/// sums ← sums + Σ rows: the gradient of a bias.
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

/// to\[receiver\] ← to\[receiver\] + row, arc after arc, in the second half of rows of 2 `width`
/// numbers.
pub(crate) fn sum_incoming<T: Real>(
    instructions: Instructions,
    to: &mut [T],
    width: usize,
    rows: &[T],
    receivers: Receivers<'_>,
) {
    instructions.vectorised(
        #[inline(always)]
        || {
            for (row, &r) in rows.chunks_exact(width).zip(receivers.of) {
                let start = (r as usize - receivers.first) * 2 * width + width;
                for (total, &x) in to[start..start + width].iter_mut().zip(row) {
                    *total += x;
                }
            }
        },
    );
}

/// to\[vertex\] ← Σ rows\[a\] over the arcs that leave the vertex, in the first half of rows of
/// 2 `width` numbers. These are the reverse arcs of `first_arc[v]..first_arc[v + 1]`, with a
/// reverse arc for every arc of the graph, and the first arc into each of these vertices and the
/// end of the last one, `[vertices + 1]`.
pub(crate) fn sum_outgoing<T: Real>(
    instructions: Instructions,
    to: &mut [T],
    width: usize,
    rows: &[T],
    first_arc: &[u32],
    reverse_arcs: &[u32],
) {
    instructions.vectorised(
        #[inline(always)]
        || {
            let vertices = to.chunks_exact_mut(2 * width).zip(first_arc.windows(2));
            for (total, ends) in vertices {
                let total = &mut total[..width];
                total.fill(T::ZERO);
                for &reverse in &reverse_arcs[ends[0] as usize..ends[1] as usize] {
                    let row = &rows[reverse as usize * width..][..width];
                    for (total, &x) in total.iter_mut().zip(row) {
                        *total += x;
                    }
                }
            }
        },
    );
}

/// to\[a\] ← rows\[a\] + at_receiver\[receiver\], rows of `width` numbers: the gradient of a
/// message.
pub(crate) fn gather_receivers<T: Real>(
    instructions: Instructions,
    to: &mut [T],
    width: usize,
    rows: &[T],
    at_receiver: &[T],
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
