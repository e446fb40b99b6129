//! The filter of a block over the whole cloth `[eq:mode-filter]`: each channel of the latent nodes
//! is taken to the modes of its cloth, each mode is damped by a learned function of its eigenvalue,
//! and what comes back joins the input of the node update.
//!
//! With the modes Φ, the shares of area a, and the block's weights w of the channels and times:
//! c = Φᵀ (a ∘ v), h = c ∘ (E wᵀ), and the update sees Φ h beside v and Σ e'. Its first layer is
//! split exactly: W (Φ h) = Φ (h Wᵀ), so that the wide product is one of a few rows, the modes.

use std::ops::Range;

use crate::graph::connectivity::Connectivity;
use crate::graph::mode_table::TIMES;
use crate::graph::partition::{Partition, counted_from, of_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Slot, Term, pack};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::network::packed::{ModuleBuilder, Piece};
use crate::network::parameters::{Linear, ModuleGradient};

/// Places of the weights of a filter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filter {
    /// First of the weights `[latent, times]`.
    weight: usize,
    latent: usize,
    /// The first node layer's columns for Φ h.
    pub(crate) of_filtered: Piece,
}

impl Filter {
    /// A filter whose output goes to the last columns of `first`, a node update's first layer.
    pub(crate) fn new(
        module: &mut ModuleBuilder,
        path: &str,
        latent: usize,
        first: &Linear,
    ) -> Self {
        Self {
            weight: module.layout.filter(path, latent, TIMES.len()),
            latent,
            of_filtered: Piece::new(&mut module.size, first, 2 * latent, latent),
        }
    }

    fn weights(&self) -> Range<usize> {
        self.weight..self.weight + self.latent * TIMES.len()
    }

    /// h ← c ∘ (E wᵀ) for the modes of all cloths, `[rows, latent]`; `decays` is E, `[rows,
    /// times]`.
    pub(crate) fn forward<T: Real>(&self, flat: &[T], decays: &[f32], c: &[T], h: &mut [T]) {
        let weights = flat[self.weights()].chunks_exact(TIMES.len());
        let rows = decays.chunks_exact(TIMES.len());
        let c = c.chunks_exact(self.latent);
        for ((h, c), decays) in h.chunks_exact_mut(self.latent).zip(c).zip(rows) {
            for ((h, &c), weights) in h.iter_mut().zip(c).zip(weights.clone()) {
                *h = c * response(weights, decays);
            }
        }
    }

    /// From the gradient of h, in `gradients`, to that of c, in its place; adds that of the
    /// weights.
    pub(crate) fn backward<T: Real>(
        &self,
        flat: &[T],
        decays: &[f32],
        c: &[T],
        gradients: &mut [T],
        of_weights: &mut ModuleGradient<'_, T>,
    ) {
        let weights = flat[self.weights()].chunks_exact(TIMES.len());
        let sums = of_weights.at(self.weights());
        let rows = decays.chunks_exact(TIMES.len());
        let c = c.chunks_exact(self.latent);
        for ((gradients, c), decays) in gradients.chunks_exact_mut(self.latent).zip(c).zip(rows) {
            let channels = gradients.iter_mut().zip(c).zip(weights.clone());
            for (((g, &c), weights), sums) in channels.zip(sums.chunks_exact_mut(TIMES.len())) {
                for (sum, &decay) in sums.iter_mut().zip(decays) {
                    *sum += *g * c * T::from_f64(f64::from(decay));
                }
                *g *= response(weights, decays);
            }
        }
    }
}

/// Σ over times of a channel's weights and what is left of a mode.
fn response<T: Real>(weights: &[T], decays: &[f32]) -> T {
    let terms = weights.iter().zip(decays);
    terms.map(|(&w, &d)| w * T::from_f64(f64::from(d))).sum()
}

/// Room for the filters of a pass: the modes as its scalar, and rows for the modes of all cloths.
#[derive(Default)]
pub(crate) struct FilterRoom<T> {
    /// Modes of each cloth.
    count: usize,
    latent: usize,
    /// Φ, `[vertices, count]`.
    values: Aligned<T>,
    /// a ∘ Φ, `[vertices, count]`.
    weighted: Aligned<T>,
    /// c of each block, `[cloths, count, latent]`.
    pub(crate) coefficients: Vec<Aligned<T>>,
    /// h, `[cloths, count, latent]`.
    pub(crate) filtered: Aligned<T>,
    /// h Wᵀ, or its gradient, `[cloths, count, latent]`.
    pub(crate) mixed: Aligned<T>,
    /// `mixed`, packed for each cloth.
    packed: Aligned<T>,
}

/// Rows of the vertices of a partition.
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

/// The matrix that takes modes to vertices, or vertices to modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Through {
    /// Φ: the values of the modes.
    Values,
    /// a ∘ Φ: the same times shares of area.
    Weighted,
}

impl<T: Real> FilterRoom<T> {
    /// Makes room for a network of `blocks` blocks; nothing where the graph has no modes.
    pub(crate) fn fit(&mut self, graph: &Connectivity, latent: usize, blocks: usize) {
        let (table, cloths) = (&graph.modes, graph.cloths().len());
        (self.count, self.latent) = (table.count, latent);
        let arrays = [
            (&mut self.values, &table.values),
            (&mut self.weighted, &table.weighted),
        ];
        for (to, from) in arrays {
            to.resize(from.len());
            let values = to.iter_mut().zip(from);
            values.for_each(|(to, &from)| *to = T::from_f64(f64::from(from)));
        }
        let rows = cloths * table.count;
        let kept = if table.count > 0 { blocks } else { 0 };
        self.coefficients.resize_with(kept, Aligned::default);
        let rooms = self.coefficients.iter_mut();
        for numbers in rooms.chain([&mut self.filtered, &mut self.mixed]) {
            numbers.resize(rows * latent);
        }
        self.packed.resize(cloths * self.slot(0).length());
    }

    /// Place of a cloth's matrix in `packed`.
    fn slot(&self, cloth: usize) -> Slot {
        let slot = Slot {
            offset: 0,
            depth: self.count,
            columns: self.latent,
        };
        Slot {
            offset: cloth * slot.length(),
            ..slot
        }
    }

    /// Packs `mixed` for [`Self::term`].
    pub(crate) fn pack(&mut self, using: Instructions) {
        let (latent, size) = (self.latent, self.count * self.latent);
        for cloth in 0..self.mixed.len().checked_div(size).unwrap_or(0) {
            let slot = self.slot(cloth);
            let own = &self.mixed[cloth * size..][..size];
            pack(using, slot, |k, j| own[k * latent + j], &mut self.packed);
        }
    }

    /// The modes at some vertices of a cloth.
    fn modes(&self, vertices: &Range<usize>, through: Through) -> Columns<'_, T> {
        let modes = match through {
            Through::Values => &self.values,
            Through::Weighted => &self.weighted,
        };
        Columns::all(&modes[of_rows(vertices, self.count)], self.count)
    }

    /// The modes at some vertices of a cloth times its packed matrix.
    pub(crate) fn term(
        &self,
        cloth: usize,
        vertices: &Range<usize>,
        through: Through,
    ) -> Term<'_, T> {
        Term {
            rows: self.modes(vertices, through),
            packed: self.slot(cloth).of(&self.packed),
        }
    }

    /// Adds the products of the modes with rows of a partition's vertices to `sums`.
    pub(crate) fn add(
        &self,
        using: Instructions,
        through: Through,
        of: OfVertices<'_, T>,
        sums: &mut ModeSums<T>,
    ) {
        for (cloth, part) in of.graph.by_cloth(of.vertices.clone()) {
            let rows = of_rows(&counted_from(&part, of.vertices.start), self.latent);
            let rows = Columns::all(&of.rows[rows], self.latent);
            sums.add(using, cloth, self.modes(&part, through), rows);
        }
    }

    /// Numbers held for vertices.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        self.values.len() + self.weighted.len()
    }
}

/// Sums over a range of vertices of their modes times rows of theirs, for each cloth that has
/// vertices in the range.
#[derive(Default)]
pub(crate) struct ModeSums<T> {
    /// The first of these cloths.
    first: usize,
    /// `[cloths, modes, width]`.
    values: Aligned<T>,
}

impl<T: Real> ModeSums<T> {
    /// Zeros, for rows of that width.
    pub(crate) fn begin(&mut self, graph: &Connectivity, vertices: &Range<usize>, width: usize) {
        let mut cloths = graph.by_cloth(vertices.clone()).map(|(cloth, _)| cloth);
        self.first = cloths.next().unwrap_or(0);
        let count = cloths.last().unwrap_or(self.first) + 1 - self.first;
        self.values.resize(count * graph.mode_count() * width);
        self.values.fill(T::ZERO);
    }

    /// Adds vertices of a cloth: their modes and their rows.
    fn add(
        &mut self,
        using: Instructions,
        cloth: usize,
        modes: Columns<'_, T>,
        rows: Columns<'_, T>,
    ) {
        let size = modes.count * rows.count;
        let sums = Sums {
            rows: &mut self.values[(cloth - self.first) * size..][..size],
            stride: rows.count,
            first: 0,
        };
        add_outer(using, sums, modes, rows);
    }

    /// Adds the sums to those of all cloths, `[cloths, modes, width]`; `size` is that of a cloth.
    pub(crate) fn add_to(&self, all: &mut [T], size: usize) {
        let all = &mut all[self.first * size..][..self.values.len()];
        all.iter_mut()
            .zip(&*self.values)
            .for_each(|(sum, &part)| *sum += part);
    }
}
