//! Products of numbers rounded to bf16, summed in f32, by the instructions AVX512-BF16: two
//! products per lane and instruction, where f32 has one.
//!
//! Weights are rounded once, when they are packed, and rows as they come. A lane of a packed panel
//! holds two numbers of a column, those of an even inner index and of the next, so that a panel
//! takes half of the room of an f32 one. Sums, biases and all that is not a product stay f32.
//!
//! `unsafe`: no library that we use has these instructions. A function that is compiled for them
//! may only be called where the processor has them, which [`HalfProducts::detect`] proves once; and
//! vectors of bits are taken for vectors of bf16, which have the same size and no invalid values.
#![allow(
    unsafe_code,
    reason = "instructions that pulp does not have; see above"
)]

use std::arch::x86_64::{
    __m512, __m512bh, __m512i, _mm512_cvtne2ps_pbh, _mm512_dpbf16_ps, _mm512_set1_epi32,
};
use std::mem::transmute;

use pulp::x86::V4;
use pulp::{Simd, f32x16};

use super::{Product, Slot, panel_vectors};
use crate::kernels::simd::Instructions;

/// Numbers in a vector of f32.
const LANES: usize = 16;
/// Pairs of a row that are rounded at a time.
const PAIRS: usize = 128;
/// Rows that are summed at a time.
const MOST_ROWS: usize = 6;

/// Proof that the processor has the instructions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfProducts(V4);

/// Rows as pairs of bf16, the first of each pair in the lower half.
type Pairs = [[u32; PAIRS]; MOST_ROWS];

impl HalfProducts {
    /// None where the processor does not have them.
    pub(crate) fn detect() -> Option<Self> {
        match Instructions::has_half() {
            true => V4::try_new().map(Self),
            false => None,
        }
    }

    /// Packs the matrix of `slot` into its place in `all`, as bits of f32 lanes.
    pub(crate) fn pack(self, slot: Slot, entry: impl Fn(usize, usize) -> f32, all: &mut [f32]) {
        let (depth, columns) = (slot.depth, slot.columns);
        let out = slot.of_mut(all);
        let bits = |l: usize, column: usize| match l < depth && column < columns {
            true => u32::from(rounded(entry(l, column))),
            false => 0,
        };
        let mut first = 0;
        while first < columns {
            let width = panel_vectors::<V4>((columns - first).div_ceil(LANES)) * LANES;
            let panel = &mut out[depth * first..][..depth * width];
            for (pair, row) in panel
                .chunks_exact_mut(width)
                .take(depth.div_ceil(2))
                .enumerate()
            {
                for (j, lane) in row.iter_mut().enumerate() {
                    let [low, high] = [2 * pair, 2 * pair + 1].map(|l| bits(l, first + j));
                    *lane = f32::from_bits(high << 16 | low);
                }
            }
            first += width;
        }
    }

    /// As [`gemm::multiply`](super::multiply), with matrices of [`Self::pack`].
    pub(crate) fn multiply(self, product: &mut Product<'_, f32>) {
        // SAFETY: `self` is the proof that the processor has the instructions.
        unsafe { panels(self.0, product) }
    }
}

/// The bits of a number rounded to the nearest bf16, ties to even. A number that is not finite
/// stays so.
fn rounded(value: f32) -> u16 {
    let bits = value.to_bits();
    if value.is_nan() {
        return (bits >> 16) as u16 | 0x40;
    }
    let tie = (bits >> 16) & 1;
    (bits.wrapping_add(0x7fff + tie) >> 16) as u16
}

#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512bf16,fma,avx2")]
fn panels(simd: V4, product: &mut Product<'_, f32>) {
    let mut first = 0;
    while first < product.columns {
        let vectors = panel_vectors::<V4>((product.columns - first).div_ceil(LANES));
        match vectors {
            4 => panel::<4>(simd, product, first),
            3 => panel::<3>(simd, product, first),
            2 => panel::<2>(simd, product, first),
            _ => panel::<1>(simd, product, first),
        }
        first += vectors * LANES;
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512bf16,fma,avx2")]
fn panel<const V: usize>(simd: V4, product: &mut Product<'_, f32>, first: usize) {
    let rows = product.out.len() / product.columns;
    let mut pairs = [[0; PAIRS]; MOST_ROWS];
    let mut row = 0;
    while row + MOST_ROWS <= rows {
        sums::<MOST_ROWS, V>(simd, product, row, first, &mut pairs);
        row += MOST_ROWS;
    }
    while row + 2 <= rows {
        sums::<2, V>(simd, product, row, first, &mut pairs);
        row += 2;
    }
    if row < rows {
        sums::<1, V>(simd, product, row, first, &mut pairs);
    }
}

/// `M` rows times a panel, summed in registers and finished.
#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512bf16,fma,avx2")]
fn sums<const M: usize, const V: usize>(
    simd: V4,
    product: &mut Product<'_, f32>,
    row: usize,
    first: usize,
    pairs: &mut Pairs,
) {
    let width = V * LANES;
    let mut sums = [[simd.splat_f32s(0.0); V]; M];
    for term in product.terms {
        let (depth, before) = (term.rows.count, term.rows.first);
        let panel = &term.packed[depth * first..][..depth.div_ceil(2) * width];
        let panel = V4::as_simd_f32s(panel).0.as_chunks::<V>().0;
        let mut done = 0;
        for weights in panel.chunks(PAIRS) {
            for (r, pairs) in pairs.iter_mut().enumerate().take(M) {
                let start = (row + r) * term.rows.stride + before;
                let values = &term.rows.rows[start..start + depth];
                let end = depth.min(done + 2 * PAIRS);
                round_row(simd, &values[done..end], pairs);
            }
            done += 2 * PAIRS;
            for (pair, weights) in weights.iter().enumerate() {
                for (sums, pairs) in sums.iter_mut().zip(pairs.iter()) {
                    let both = halves(_mm512_set1_epi32(pairs[pair].cast_signed()));
                    for (sum, weight) in sums.iter_mut().zip(weights) {
                        // SAFETY: both are 512 bits, and all bits are valid in each.
                        *sum = unsafe {
                            let weight = transmute::<f32x16, __m512bh>(*weight);
                            let before = transmute::<f32x16, __m512>(*sum);
                            transmute::<__m512, f32x16>(_mm512_dpbf16_ps(before, both, weight))
                        };
                    }
                }
            }
        }
    }
    for (r, sums) in sums.into_iter().enumerate() {
        product.finish_row::<V4, V>(simd, row + r, first, sums);
    }
}

/// Rounds up to twice [`PAIRS`] numbers; zeros after their end up to a whole vector.
#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512bf16,fma,avx2")]
fn round_row(simd: V4, values: &[f32], pairs: &mut [u32; PAIRS]) {
    let vectors = values.chunks(2 * LANES).zip(pairs.chunks_exact_mut(LANES));
    for (values, pairs) in vectors {
        let (low, high) = values.split_at(values.len().min(LANES));
        let low = simd.partial_load_f32s(low);
        let high = simd.partial_load_f32s(high);
        // SAFETY: all are 512 bits, and all bits are valid in each.
        let bits = unsafe {
            let [low, high] = [low, high].map(|half| transmute::<f32x16, __m512>(half));
            transmute::<__m512bh, [u32; LANES]>(_mm512_cvtne2ps_pbh(high, low))
        };
        pairs.copy_from_slice(&bits);
    }
}

/// Takes bits for pairs of bf16.
#[target_feature(enable = "avx512f,avx512bf16")]
fn halves(bits: __m512i) -> __m512bh {
    // SAFETY: both are 512 bits, and all bits are valid in each.
    unsafe { transmute(bits) }
}
