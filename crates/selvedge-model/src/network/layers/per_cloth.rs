//! What a block has of each cloth as a whole: sums over its vertices, and a matrix of its own.

use std::ops::Range;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::Partition;
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Slot, pack};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;

/// Rows of the vertices of a partition.
#[derive(Clone, Copy)]
pub(crate) struct OfVertices<'a, T> {
    pub(crate) graph: &'a Connectivity,
    pub(crate) vertices: &'a Range<usize>,
    /// `[vertices, latent]`.
    pub(crate) rows: &'a [T],
}

impl<'a, T> OfVertices<'a, T> {
    /// `rows` of a partition of `graph`.
    pub(crate) fn new(graph: &'a Connectivity, partition: &'a Partition, rows: &'a [T]) -> Self {
        Self {
            graph,
            vertices: &partition.vertices,
            rows,
        }
    }
}

/// Sums over a range of vertices of their weights times rows of theirs, for each cloth that has
/// vertices in the range.
#[derive(Default)]
pub(crate) struct ClothSums<T> {
    /// The first of these cloths.
    first: usize,
    /// `[cloths, weights of a vertex, width]`.
    values: Aligned<T>,
}

impl<T: Real> ClothSums<T> {
    /// Zeros, for vertices with `weights` weights and rows of `width` numbers.
    pub(crate) fn begin(
        &mut self,
        graph: &Connectivity,
        vertices: &Range<usize>,
        weights: usize,
        width: usize,
    ) {
        let mut cloths = graph.by_cloth(vertices.clone()).map(|(cloth, _)| cloth);
        self.first = cloths.next().unwrap_or(0);
        let count = cloths.last().unwrap_or(self.first) + 1 - self.first;
        self.values.resize(count * weights * width);
        self.values.fill(T::ZERO);
    }

    /// Adds vertices of a cloth: their weights and their rows.
    pub(crate) fn add(
        &mut self,
        using: Instructions,
        cloth: usize,
        weights: Columns<'_, T>,
        rows: Columns<'_, T>,
    ) {
        let size = weights.count * rows.count;
        let sums = Sums {
            rows: &mut self.values[(cloth - self.first) * size..][..size],
            stride: rows.count,
            first: 0,
        };
        add_outer(using, sums, weights, rows);
    }

    /// Adds the sums to those of all cloths, `[cloths, weights, width]`; `size` is that of a cloth.
    pub(crate) fn add_to(&self, all: &mut [T], size: usize) {
        let all = &mut all[self.first * size..][..self.values.len()];
        all.iter_mut()
            .zip(&*self.values)
            .for_each(|(sum, &part)| *sum += part);
    }
}

/// A packed matrix for each cloth, of one size.
#[derive(Default)]
pub(crate) struct ClothMatrices<T> {
    cloths: usize,
    depth: usize,
    columns: usize,
    packed: Aligned<T>,
}

impl<T: Real> ClothMatrices<T> {
    /// Makes room for matrices `[depth, columns]`.
    pub(crate) fn fit(&mut self, cloths: usize, depth: usize, columns: usize) {
        (self.cloths, self.depth, self.columns) = (cloths, depth, columns);
        self.packed.resize(cloths * self.slot(0).length());
    }

    fn slot(&self, cloth: usize) -> Slot {
        let slot = Slot {
            offset: 0,
            depth: self.depth,
            columns: self.columns,
        };
        Slot {
            offset: cloth * slot.length(),
            ..slot
        }
    }

    /// Packs `rows`, `[cloths, depth, columns]`.
    pub(crate) fn pack(&mut self, using: Instructions, rows: &[T]) {
        let columns = self.columns;
        self.pack_entries(using, rows, |own, l, j| own[l * columns + j]);
    }

    /// Packs the transposes of `rows`, `[cloths, columns, depth]`.
    pub(crate) fn pack_transposed(&mut self, using: Instructions, rows: &[T]) {
        let depth = self.depth;
        self.pack_entries(using, rows, |own, l, j| own[j * depth + l]);
    }

    fn pack_entries(
        &mut self,
        using: Instructions,
        rows: &[T],
        entry: impl Fn(&[T], usize, usize) -> T,
    ) {
        let size = self.depth * self.columns;
        for cloth in 0..self.cloths {
            let own = &rows[cloth * size..][..size];
            let slot = self.slot(cloth);
            pack(using, slot, |l, j| entry(own, l, j), &mut self.packed);
        }
    }

    /// The matrix of a cloth.
    pub(crate) fn of(&self, cloth: usize) -> &[T] {
        self.slot(cloth).of(&self.packed)
    }
}
