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
use crate::graph::partition::{counted_from, of_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Epilogue, Term, multiply};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::network::layers::mlp::Mlp;
use crate::network::layers::per_cloth::{ClothMatrices, ClothSums, OfVertices};
use crate::network::packed::{LayerWeights, ModuleBuilder, Piece};
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
    fn forward<T: Real>(&self, flat: &[T], decays: &[f32], c: &[T], h: &mut [T]) {
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
    fn backward<T: Real>(
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

impl Filter {
    /// From the sums over all partitions to the matrices by which vertices see the filtered modes
    /// of block `number`.
    pub(crate) fn room_forward<'a, T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        number: usize,
        sums: impl Iterator<Item = &'a ClothSums<T>>,
        room: &mut FilterRoom<T>,
    ) {
        let coefficients = &mut room.coefficients[number];
        coefficients.fill(T::ZERO);
        for sums in sums {
            sums.add_to(coefficients, room.count * self.latent);
        }
        self.forward(weights.flat, &room.decays, coefficients, &mut room.filtered);
        let term = self.of_filtered.times(weights, &room.filtered);
        let (using, to) = (weights.instructions, &mut room.mixed);
        multiply(using, &[term], self.latent, Epilogue::Set, to);
        room.packed.pack(using, &room.mixed);
    }

    /// From the gradients of what the modes give to the node updates, in `room`, to those of the
    /// modes' coefficients, which it packs. Adds those of the weights; `node` is the node update.
    pub(crate) fn room_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        node: &Mlp,
        number: usize,
        room: &mut FilterRoom<T>,
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (latent, using) = (self.latent, weights.instructions);
        let coefficients = &room.coefficients[number];
        self.forward(weights.flat, &room.decays, coefficients, &mut room.filtered);
        let [left, right] = [&room.mixed, &room.filtered].map(|rows| Columns::all(rows, latent));
        node.first_backward(weights, self.of_filtered.first(), left, right, gradient);
        let term = self.of_filtered.back(weights, &room.mixed);
        multiply(using, &[term], latent, Epilogue::Set, &mut room.filtered);
        let to = &mut room.filtered;
        self.backward(weights.flat, &room.decays, coefficients, to, gradient);
        room.packed.pack(using, &room.filtered);
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
    /// E, `[cloths, count, times]`.
    decays: Vec<f32>,
    /// c of each block, `[cloths, count, latent]`.
    coefficients: Vec<Aligned<T>>,
    /// h, `[cloths, count, latent]`.
    filtered: Aligned<T>,
    /// h Wᵀ, or its gradient, `[cloths, count, latent]`.
    mixed: Aligned<T>,
    /// The matrix of each cloth for [`Self::term`].
    packed: ClothMatrices<T>,
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
        self.decays.clone_from(&table.decays);
        let rows = cloths * table.count;
        let kept = if table.count > 0 { blocks } else { 0 };
        self.coefficients.resize_with(kept, Aligned::default);
        let rooms = self.coefficients.iter_mut();
        for numbers in rooms.chain([&mut self.filtered, &mut self.mixed]) {
            numbers.resize(rows * latent);
        }
        self.packed.fit(cloths, table.count, latent);
    }

    /// Zeros for gradients of what the modes give.
    pub(crate) fn clear_sums(&mut self) {
        self.mixed.fill(T::ZERO);
    }

    /// Adds sums over some vertices to those of all.
    pub(crate) fn add_sums(&mut self, sums: &ClothSums<T>) {
        sums.add_to(&mut self.mixed, self.count * self.latent);
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
            packed: self.packed.of(cloth),
        }
    }

    /// Adds the products of the modes with rows of a partition's vertices to `sums`.
    pub(crate) fn add(
        &self,
        using: Instructions,
        through: Through,
        of: OfVertices<'_, T>,
        sums: &mut ClothSums<T>,
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
