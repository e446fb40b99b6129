//! Matrix products out ← rows W on rows of contiguous numbers (gemm), with an [`Epilogue`] that is
//! applied while the sums are still in registers.
//!
//! W is packed once ([`pack`]) into panels of a few vectors of columns, so that a panel stays in
//! the first cache while all rows of a tile pass by. A few rows times a panel are summed at a time,
//! term after term in the order of the inner index. An output number depends on its row, its column
//! and the instruction set, not on the tiling. Single-threaded: callers share tiles among threads.
//!
//! The other product of learning, dW ← dW + dYᵀ X, is in `outer`.

use pulp::{Simd, WithSimd};

use crate::kernels::real::Real;
use crate::kernels::simd::{Instructions, Lanes, MOST_LANES, has_32_registers};

/// Place of a packed matrix `[depth, columns]` in an array of matrices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) offset: usize,
    /// Inner dimension of the product: numbers in a row that goes in.
    pub(crate) depth: usize,
    /// Numbers in a row that comes out.
    pub(crate) columns: usize,
}

impl Slot {
    /// Numbers that the matrix takes, the same for every instruction set.
    pub(crate) fn length(&self) -> usize {
        self.depth * self.columns.next_multiple_of(MOST_LANES)
    }

    /// The numbers of the matrix in an array of matrices.
    pub(crate) fn of<'a, T>(&self, all: &'a [T]) -> &'a [T] {
        &all[self.offset..self.offset + self.length()]
    }

    /// The numbers of the matrix in an array of matrices.
    pub(crate) fn of_mut<'a, T>(&self, all: &'a mut [T]) -> &'a mut [T] {
        &mut all[self.offset..self.offset + self.length()]
    }
}

/// Packs the matrix of `slot` into its place in `all`; the entry at inner index `l` and column `j`
/// is `entry(l, j)`.
pub(crate) fn pack<T: Real>(
    instructions: Instructions,
    slot: Slot,
    entry: impl Fn(usize, usize) -> T,
    all: &mut [T],
) {
    let (depth, columns) = (slot.depth, slot.columns);
    let out = slot.of_mut(all);
    let lanes = T::run(instructions, LaneCount::<T>::default());
    let mut first = 0;
    while first < columns {
        let vectors = T::run(
            instructions,
            PanelVectors((columns - first).div_ceil(lanes)),
        );
        let width = vectors * lanes;
        let panel = &mut out[depth * first..][..depth * width];
        for j in 0..width {
            for l in 0..depth {
                let column = first + j;
                panel[l * width + j] = if column < columns { entry(l, column) } else { T::ZERO };
            }
        }
        first += width;
    }
}

/// Numbers in a vector.
#[derive(Default)]
pub(crate) struct LaneCount<T>(std::marker::PhantomData<T>);

impl<T: Lanes> WithSimd for LaneCount<T> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        T::lanes::<S>()
    }
}

/// Runs [`panel_vectors`].
struct PanelVectors(usize);

impl WithSimd for PanelVectors {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        panel_vectors::<S>(self.0)
    }
}

/// Vectors of the next panel when `left` remain: four on 32 registers, which hold 6 rows × 4
/// vectors of sums, 4 of weights and 1 of the row. Avoids a one-vector panel, whose sums form one
/// dependency chain: 6 vectors are split 3 + 3, 5 are split 3 + 2.
#[inline(always)]
pub(super) fn panel_vectors<S: Simd>(left: usize) -> usize {
    match left {
        3 | 5 | 6 if has_32_registers::<S>() => 3,
        4.. if has_32_registers::<S>() => 4,
        2.. => 2,
        _ => 1,
    }
}

/// Columns `first..first + count` of rows of `stride` numbers.
#[derive(Clone, Copy)]
pub(crate) struct Columns<'a, T> {
    pub(crate) rows: &'a [T],
    pub(crate) stride: usize,
    pub(crate) first: usize,
    pub(crate) count: usize,
}

impl<'a, T> Columns<'a, T> {
    /// All columns of rows of `count` numbers.
    pub(crate) fn all(rows: &'a [T], count: usize) -> Self {
        Self {
            rows,
            stride: count,
            first: 0,
            count,
        }
    }

    /// Columns `first..first + count` of these columns.
    pub(crate) fn part(self, first: usize, count: usize) -> Self {
        assert!(first + count <= self.count, "columns in range");
        Self {
            first: self.first + first,
            count,
            ..self
        }
    }
}

/// Rows and the packed matrix `[columns of rows, columns]` that they are multiplied with.
#[derive(Clone, Copy)]
pub(crate) struct Term<'a, T> {
    pub(crate) rows: Columns<'a, T>,
    pub(crate) packed: &'a [T],
}

/// Last step of a product, from its sums to `out`.
#[derive(Clone, Copy)]
pub(crate) enum Epilogue<'a, T> {
    /// out ← sums.
    Set,
    /// out ← out + sums.
    Add,
    /// out ← sums + bias.
    Bias(&'a [T]),
    /// out ← sums, with the bias added to the second half of the columns.
    SecondHalfBias(&'a [T]),
    /// out ← max(sums + bias, 0).
    BiasRelu(&'a [T]),
    /// out ← max(sums + A v of the sender + B v of the receiver, 0): the split first arc layer.
    EndpointsRelu {
        /// A v and B v + bias of every vertex side by side, `[vertices, 2 columns]`.
        products: &'a [T],
        /// Sender of each row.
        senders: &'a [u32],
        /// Receiver of each row.
        receivers: &'a [u32],
    },
    /// out ← sums where the activation of a ReLU is positive, else 0; laid out like out.
    Mask(&'a [T]),
}

/// out `[rows, columns]` ← epilogue(Σ over terms of rows times matrix).
///
/// # Panics
/// When a slice does not have the size that the others imply.
pub(crate) fn multiply<T: Real>(
    instructions: Instructions,
    terms: &[Term<'_, T>],
    columns: usize,
    epilogue: Epilogue<'_, T>,
    out: &mut [T],
) {
    let rows = out.len() / columns;
    for term in terms {
        let found = term.rows.rows.len();
        assert_eq!(found, rows * term.rows.stride, "rows of a product");
    }
    T::run(
        instructions,
        Product {
            terms,
            columns,
            epilogue,
            out,
        },
    );
}

struct Product<'a, T> {
    terms: &'a [Term<'a, T>],
    columns: usize,
    epilogue: Epilogue<'a, T>,
    out: &'a mut [T],
}

impl<T: Real> WithSimd for Product<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let lanes = T::lanes::<S>();
        let mut first = 0;
        while first < self.columns {
            let vectors = panel_vectors::<S>((self.columns - first).div_ceil(lanes));
            match vectors {
                4 => self.panel::<S, 4>(simd, first),
                3 => self.panel::<S, 3>(simd, first),
                2 => self.panel::<S, 2>(simd, first),
                _ => self.panel::<S, 1>(simd, first),
            }
            first += vectors * lanes;
        }
    }
}

impl<T: Real> Product<'_, T> {
    /// All rows of a panel of `V` vectors of columns.
    #[inline(always)]
    fn panel<S: Simd, const V: usize>(&mut self, simd: S, first: usize) {
        let rows = self.out.len() / self.columns;
        let mut row = 0;
        while row + 6 <= rows {
            self.sums::<S, 6, V>(simd, row, first);
            row += 6;
        }
        while row + 2 <= rows {
            self.sums::<S, 2, V>(simd, row, first);
            row += 2;
        }
        if row < rows {
            self.sums::<S, 1, V>(simd, row, first);
        }
    }

    /// `M` rows times a panel, summed in registers and finished.
    #[inline(always)]
    fn sums<S: Simd, const M: usize, const V: usize>(&mut self, simd: S, row: usize, first: usize) {
        let width = V * T::lanes::<S>();
        let mut sums = [[T::splat(simd, T::ZERO); V]; M];
        for term in self.terms {
            let Columns {
                rows,
                stride,
                first: before,
                count: depth,
            } = term.rows;
            let panel = &term.packed[depth * first..][..depth * width];
            let panel = &T::vectors::<S>(panel).as_chunks::<V>().0[..depth];
            let rows: [&[T]; M] =
                std::array::from_fn(|r| &rows[(row + r) * stride + before..][..depth]);
            for (l, weights) in panel.iter().enumerate() {
                for (sums, values) in sums.iter_mut().zip(rows) {
                    let value = T::splat(simd, values[l]);
                    for (sum, &weight) in sums.iter_mut().zip(weights) {
                        *sum = T::mul_add(simd, value, weight, *sum);
                    }
                }
            }
        }
        for (r, sums) in sums.into_iter().enumerate() {
            self.finish_row::<S, V>(simd, row + r, first, sums);
        }
    }

    #[inline(always)]
    fn finish_row<S: Simd, const V: usize>(
        &mut self,
        simd: S,
        row: usize,
        first: usize,
        sums: [T::Vector<S>; V],
    ) {
        let (lanes, columns) = (T::lanes::<S>(), self.columns);
        let start = row * columns + first;
        let count = (columns - first).min(V * lanes);
        let out = &mut self.out[start..start + count];
        // Loops over arrays, no closures: a closure that is not inlined is compiled without wide
        // vectors.
        let mut values = sums;
        match self.epilogue {
            Epilogue::Set | Epilogue::SecondHalfBias(_) => {}
            Epilogue::Add => {
                let before = get::<T, S, V>(simd, out);
                values = sum::<T, S, V>(simd, values, before);
            }
            Epilogue::Bias(bias) => {
                let bias = get::<T, S, V>(simd, &bias[first..first + count]);
                values = sum::<T, S, V>(simd, values, bias);
            }
            Epilogue::BiasRelu(bias) => {
                let bias = get::<T, S, V>(simd, &bias[first..first + count]);
                values = sum::<T, S, V>(simd, values, bias);
                for x in &mut values {
                    *x = T::relu(simd, *x);
                }
            }
            Epilogue::EndpointsRelu {
                products,
                senders,
                receivers,
            } => {
                let sender = senders[row] as usize * 2 * columns + first;
                let receiver = receivers[row] as usize * 2 * columns + columns + first;
                let sender = get::<T, S, V>(simd, &products[sender..sender + count]);
                let receiver = get::<T, S, V>(simd, &products[receiver..receiver + count]);
                let both = sum::<T, S, V>(simd, sender, receiver);
                values = sum::<T, S, V>(simd, values, both);
                for x in &mut values {
                    *x = T::relu(simd, *x);
                }
            }
            Epilogue::Mask(activation) => {
                let activation = get::<T, S, V>(simd, &activation[start..start + count]);
                for (x, a) in values.iter_mut().zip(activation) {
                    *x = T::where_positive(simd, a, *x);
                }
            }
        }
        put::<T, S, V>(simd, out, values);
        if let Epilogue::SecondHalfBias(bias) = self.epilogue {
            // Columns of a panel may lie on both sides.
            let skipped = (columns / 2).saturating_sub(first).min(count);
            let from = (first + skipped).saturating_sub(columns / 2);
            for (x, &b) in out[skipped..].iter_mut().zip(&bias[from..]) {
                *x += b;
            }
        }
    }
}

#[inline(always)]
fn sum<T: Lanes, S: Simd, const V: usize>(
    simd: S,
    a: [T::Vector<S>; V],
    b: [T::Vector<S>; V],
) -> [T::Vector<S>; V] {
    let mut sums = a;
    for (x, y) in sums.iter_mut().zip(b) {
        *x = T::plus(simd, *x, y);
    }
    sums
}

/// Up to `V` vectors of a slice, zeros after its end.
#[inline(always)]
pub(crate) fn get<T: Real, S: Simd, const V: usize>(simd: S, slice: &[T]) -> [T::Vector<S>; V] {
    let lanes = T::lanes::<S>();
    let mut values = [T::splat(simd, T::ZERO); V];
    if slice.len() == V * lanes {
        for (x, &y) in values.iter_mut().zip(T::vectors::<S>(slice)) {
            *x = y;
        }
    } else {
        for (v, x) in values.iter_mut().enumerate() {
            let from = (v * lanes).min(slice.len());
            let to = ((v + 1) * lanes).min(slice.len());
            *x = T::load(simd, &slice[from..to]);
        }
    }
    values
}

/// Sets up to `V` vectors of a slice.
#[inline(always)]
pub(crate) fn put<T: Lanes, S: Simd, const V: usize>(
    simd: S,
    slice: &mut [T],
    values: [T::Vector<S>; V],
) {
    let lanes = T::lanes::<S>();
    if slice.len() == V * lanes {
        for (out, x) in T::vectors_mut::<S>(slice).iter_mut().zip(values) {
            *out = x;
        }
    } else {
        for (v, x) in values.into_iter().enumerate() {
            let from = (v * lanes).min(slice.len());
            let to = ((v + 1) * lanes).min(slice.len());
            T::store(simd, &mut slice[from..to], x);
        }
    }
}

#[cfg(test)]
mod tests;
