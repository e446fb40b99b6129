//! Tokens of a block `[eq:tokens]`: a few vectors for each cloth that all its vertices write to and
//! read from.
//!
//! Every vertex has soft weights over the tokens, s = softmax(W v + b). A token is the mean of the
//! latent vertices under these weights and the vertices' shares of area, so that a finer mesh of
//! the same cloth has the same tokens. A perceptron updates each token, and a vertex reads their
//! mixture by the same weights, beside v and Σ e'. The first layer of the node update is split
//! exactly, W (S t) = S (t Wᵀ), so that the wide product is one of a few rows, the tokens.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{counted_from, of_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Epilogue, Term, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::kernels::softmax::{softmax, softmax_backward};
use crate::network::layers::mlp::{Mlp, MlpGradients, MlpRecord};
use crate::network::layers::per_cloth::{ClothMatrices, ClothSums, OfVertices};
use crate::network::layers::scratch::GroupWork;
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::parameters::{Linear, ModuleGradient};

/// Added to the share of a cloth that a token stands for before it is divided by: a token that no
/// vertex writes to is zero.
const LEAST_SIZE: f64 = 1e-6;

/// Places of the weights of a block's tokens.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tokens {
    /// From a latent vertex to its weights over the tokens, before their softmax.
    slice: Linear,
    of_slice: Piece,
    update: Mlp,
    of_update: Piece,
    /// The first node layer's columns for what a vertex reads.
    of_read: Piece,
}

/// Tokens of one block, kept for the backward pass.
#[derive(Default)]
struct TokenRecord<T> {
    /// Means of the latent vertices, `[cloths, tokens, latent]`.
    means: Aligned<T>,
    /// Share of its cloth that each token stands for, `[cloths, tokens]`.
    sizes: Aligned<T>,
    /// Activations of the update.
    update: MlpRecord<T>,
    /// Tokens after the update, `[cloths, tokens, latent]`.
    updated: Aligned<T>,
}

/// Room for the tokens of a pass.
#[derive(Default)]
pub(crate) struct TokenRoom<T> {
    /// Tokens of each cloth.
    count: usize,
    latent: usize,
    /// Shares of area, `[vertices]`.
    shares: Aligned<T>,
    records: Vec<TokenRecord<T>>,
    /// Updated tokens times the first node layer's columns, or a gradient, `[cloths, tokens,
    /// latent]`.
    mixed: Aligned<T>,
    /// Gradients of the sums that the tokens are the means of, `[cloths, tokens, latent]`.
    by_sums: Aligned<T>,
    /// Gradients of the tokens' sizes, `[cloths, tokens]`.
    by_sizes: Aligned<T>,
    /// Gradients of the update's output and of its first two layers, `[cloths, tokens, latent]`.
    by_update: [Aligned<T>; 3],
    /// From tokens to vertices.
    to_vertices: ClothMatrices<T>,
    /// From vertices to tokens, in the backward pass.
    to_tokens: ClothMatrices<T>,
}

/// Sums over a range of vertices for the tokens of their cloths.
#[derive(Default)]
pub(crate) struct TokenSums<T> {
    /// Weights times latent vertices, or times gradients of what they read.
    pub(crate) rows: ClothSums<T>,
    /// Weights times shares of area.
    sizes: ClothSums<T>,
    scratch: TokenScratch<T>,
}

/// Rows of a partition's vertices, `[vertices, tokens]`.
#[derive(Default)]
struct TokenScratch<T> {
    /// Weights over the tokens times the share of area.
    weighted: Aligned<T>,
    /// Gradients of what the weights are summed up to.
    by_sums: Aligned<T>,
}

impl<T: Real> TokenRoom<T> {
    /// Makes room for a network of `blocks` blocks with `count` tokens for each cloth.
    pub(crate) fn fit(
        &mut self,
        graph: &Connectivity,
        update: Option<&Tokens>,
        blocks: usize,
        kept: bool,
    ) {
        let Some(tokens) = update else {
            *self = Self::default();
            return;
        };
        (self.count, self.latent) = (tokens.count(), tokens.latent());
        self.shares.resize(graph.vertex_count());
        let shares = self.shares.iter_mut().zip(graph.shares());
        shares.for_each(|(to, &share)| *to = T::from_f64(f64::from(share)));
        let cloths = graph.cloths().len();
        let rows = cloths * self.count;
        let records = if kept { blocks } else { 1 };
        self.records.resize_with(records, TokenRecord::default);
        for record in &mut self.records {
            record.means.resize(rows * self.latent);
            record.sizes.resize(rows);
            record.update.fit(&tokens.update, rows);
            record.updated.resize(rows * self.latent);
        }
        self.mixed.resize(rows * self.latent);
        self.to_vertices.fit(cloths, self.count, self.latent);
        if kept {
            let back = self.by_update.iter_mut().chain([&mut self.by_sums]);
            back.for_each(|numbers| numbers.resize(rows * self.latent));
            self.by_sizes.resize(rows);
            self.to_tokens.fit(cloths, self.latent, self.count);
        }
    }

    /// Number of the record of a block.
    fn record(&self, block: usize) -> usize {
        block % self.records.len().max(1)
    }

    /// The weights of some vertices of a cloth times its packed matrix.
    pub(crate) fn term<'a>(&'a self, cloth: usize, slices: &'a [T]) -> Term<'a, T> {
        Term {
            rows: Columns::all(slices, self.count),
            packed: self.to_vertices.of(cloth),
        }
    }

    /// Sums of a whole partition's weights times rows of its vertices, for [`Self::add_sums`].
    pub(crate) fn add_read(
        &self,
        using: Instructions,
        slices: &[T],
        of: OfVertices<'_, T>,
        by_slices: &mut [T],
        sums: &mut ClothSums<T>,
    ) {
        for (cloth, part) in of.graph.by_cloth(of.vertices.clone()) {
            let local = counted_from(&part, of.vertices.start);
            let rows = Columns::all(&of.rows[of_rows(&local, self.latent)], self.latent);
            let own = Columns::all(&slices[of_rows(&part, self.count)], self.count);
            sums.add(using, cloth, own, rows);
            let term = Term {
                rows,
                packed: self.to_tokens.of(cloth),
            };
            let to = &mut by_slices[of_rows(&local, self.count)];
            multiply(using, &[term], self.count, Epilogue::Set, to);
        }
    }

    /// Zeros for gradients of the tokens times the first node layer's columns.
    pub(crate) fn clear_sums(&mut self) {
        self.mixed.fill(T::ZERO);
    }

    /// Adds sums over some vertices to those of all.
    pub(crate) fn add_sums(&mut self, sums: &ClothSums<T>) {
        sums.add_to(&mut self.mixed, self.count * self.latent);
    }

    /// Numbers held for vertices.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        self.shares.len()
    }
}

/// to ← scale ∘ rows, one number for each row of `width`.
fn scale_rows<T: Real>(to: &mut Aligned<T>, rows: &[T], scales: &[T], width: usize) {
    to.resize(rows.len());
    let pairs = to
        .chunks_exact_mut(width)
        .zip(rows.chunks_exact(width))
        .zip(scales);
    for ((to, row), &scale) in pairs {
        to.iter_mut().zip(row).for_each(|(to, &x)| *to = scale * x);
    }
}

impl Tokens {
    /// `count` tokens for each cloth. What a vertex reads goes to the columns of `first`, a node
    /// update's first layer, from number `column` on.
    pub(crate) fn new(
        module: &mut ModuleBuilder,
        path: &str,
        count: usize,
        first: &Linear,
        column: usize,
    ) -> Self {
        let latent = first.outputs;
        let slice = module
            .layout
            .linear(&format!("{path}.slice"), latent, count);
        let update = Mlp::normalised(module, &format!("{path}.update"), latent, latent);
        let size = &mut module.size;
        Self {
            slice,
            of_slice: Piece::whole(size, &slice),
            update,
            of_update: Piece::whole(size, &update.first),
            of_read: Piece::new(size, first, column, latent),
        }
    }

    /// Tokens of each cloth.
    pub(crate) fn count(&self) -> usize {
        self.slice.outputs
    }

    fn latent(&self) -> usize {
        self.slice.inputs
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        self.update.pack(packer);
        for piece in [&self.of_slice, &self.of_update, &self.of_read] {
            piece.pack(packer);
        }
    }

    /// Sets the weights of a partition's vertices over the tokens, `[vertices, tokens]`, and the
    /// partition's sums.
    pub(crate) fn write<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        room: &TokenRoom<T>,
        of: OfVertices<'_, T>,
        slices: &mut [T],
        sums: &mut TokenSums<T>,
    ) {
        let (count, latent, using) = (self.count(), self.latent(), weights.instructions);
        let bias = Epilogue::Bias(&weights.flat[self.slice.bias_range()]);
        let term = self.of_slice.times(weights, of.rows);
        multiply(using, &[term], count, bias, slices);
        softmax(using, slices, count);
        let shares = &room.shares[of.vertices.clone()];
        let weighted = &mut sums.scratch.weighted;
        scale_rows(weighted, slices, shares, count);
        sums.rows.begin(of.graph, of.vertices, count, latent);
        sums.sizes.begin(of.graph, of.vertices, count, 1);
        for (cloth, part) in of.graph.by_cloth(of.vertices.clone()) {
            let local = counted_from(&part, of.vertices.start);
            let own = of_rows(&local, count);
            let rows = Columns::all(&of.rows[of_rows(&local, latent)], latent);
            let weighted = Columns::all(&weighted[own.clone()], count);
            sums.rows.add(using, cloth, weighted, rows);
            let shares = Columns::all(&room.shares[part], 1);
            let slices = Columns::all(&slices[own], count);
            sums.sizes.add(using, cloth, slices, shares);
        }
    }

    /// From the sums over all partitions to the tokens of block `number`, their update, and the
    /// matrices by which vertices read them.
    pub(crate) fn update<'a, T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        number: usize,
        sums: impl Iterator<Item = &'a TokenSums<T>>,
        room: &mut TokenRoom<T>,
    ) {
        let (count, latent) = (self.count(), self.latent());
        let number = room.record(number);
        let record = &mut room.records[number];
        record.means.fill(T::ZERO);
        record.sizes.fill(T::ZERO);
        for sums in sums {
            sums.rows.add_to(&mut record.means, count * latent);
            sums.sizes.add_to(&mut record.sizes, count);
        }
        let means = record.means.chunks_exact_mut(latent);
        for (mean, &size) in means.zip(&*record.sizes) {
            let scale = T::ONE / (size + T::from_f64(LEAST_SIZE));
            mean.iter_mut().for_each(|x| *x *= scale);
        }
        record.updated.copy_from_slice(&record.means);
        let terms = &[self.of_update.times(weights, &record.means)];
        let epilogue = self.update.first_epilogue(weights);
        let mut tile = record.update.rows(&self.update).into_tile();
        self.update.first_layer(weights, terms, epilogue, &mut tile);
        let to = Normalised::Add(&mut record.updated);
        self.update.forward(weights, tile, to);
        self.mix(weights, number, room);
        room.to_vertices.pack(weights.instructions, &room.mixed);
    }

    /// The updated tokens times the first node layer's columns.
    fn mix<T: Real>(&self, weights: LayerWeights<'_, T>, record: usize, room: &mut TokenRoom<T>) {
        let term = self.of_read.times(weights, &room.records[record].updated);
        let (using, to) = (weights.instructions, &mut room.mixed);
        multiply(using, &[term], self.latent(), Epilogue::Set, to);
    }

    /// Makes the matrices by which [`TokenRoom::add_read`] goes back through what the vertices
    /// read.
    pub(crate) fn prepare_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        number: usize,
        room: &mut TokenRoom<T>,
    ) {
        let number = room.record(number);
        self.mix(weights, number, room);
        room.to_tokens
            .pack_transposed(weights.instructions, &room.mixed);
    }

    /// From the gradients of what the tokens give to the node updates, summed over all vertices, to
    /// those of the sums that the tokens are made of. Adds those of the weights; `node` is the node
    /// update.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        node: &Mlp,
        number: usize,
        room: &mut TokenRoom<T>,
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let record = &room.records[room.record(number)];
        let [left, right] = [&room.mixed, &record.updated].map(|rows| Columns::all(rows, latent));
        node.first_backward(weights, self.of_read.first(), left, right, gradient);
        let by_tokens = &mut room.by_sums;
        let term = self.of_read.back(weights, &room.mixed);
        multiply(using, &[term], latent, Epilogue::Set, by_tokens);
        let [output, hidden, pre_activation] = &mut room.by_update;
        output.copy_from_slice(by_tokens);
        let rows = 0..record.sizes.len();
        let kept = record.update.tile(&self.update, &rows);
        let gradients = MlpGradients {
            output,
            hidden,
            pre_activation: &mut *pre_activation,
        };
        self.update.backward(weights, kept, gradients, gradient);
        let [left, right] = [&*pre_activation, &record.means].map(|r| Columns::all(r, latent));
        self.update
            .first_backward(weights, 0, left, right, gradient);
        let term = self.of_update.back(weights, pre_activation);
        multiply(using, &[term], latent, Epilogue::Add, by_tokens);
        // A token is a sum divided by its size.
        let rows = by_tokens.chunks_exact_mut(latent);
        let rows = rows.zip(record.means.chunks_exact(latent));
        let sizes = record.sizes.iter().zip(&mut *room.by_sizes);
        for ((by_sum, mean), (&size, by_size)) in rows.zip(sizes) {
            let scale = T::ONE / (size + T::from_f64(LEAST_SIZE));
            by_sum.iter_mut().for_each(|x| *x *= scale);
            let pairs = by_sum.iter().zip(mean);
            *by_size = -pairs.map(|(&g, &t)| g * t).sum::<T>();
        }
        room.to_vertices.pack(using, &room.by_sums);
        room.to_tokens.pack_transposed(using, &room.by_sums);
    }

    /// Takes the gradients of a partition's weights over the tokens, which [`TokenRoom::add_read`]
    /// left in `back`, and those of the tokens' sums to the latent vertices. Adds those of the
    /// weights.
    pub(crate) fn write_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        room: &TokenRoom<T>,
        of: OfVertices<'_, T>,
        back: WriteBack<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (count, latent, using) = (self.count(), self.latent(), weights.instructions);
        let (sums, gradient) = (&mut group.scratch.whole_sums.tokens, &mut group.gradient);
        let WriteBack {
            slices,
            by_slices,
            nodes,
        } = back;
        let shares = &room.shares[of.vertices.clone()];
        let TokenScratch { weighted, by_sums } = &mut sums.scratch;
        scale_rows(weighted, slices, shares, count);
        by_sums.resize(slices.len());
        for (cloth, part) in of.graph.by_cloth(of.vertices.clone()) {
            let local = counted_from(&part, of.vertices.start);
            let (own, wide) = (of_rows(&local, count), of_rows(&local, latent));
            let term = room.term(cloth, &weighted[own.clone()]);
            multiply(
                using,
                &[term],
                latent,
                Epilogue::Add,
                &mut nodes[wide.clone()],
            );
            let term = Term {
                rows: Columns::all(&of.rows[wide], latent),
                packed: room.to_tokens.of(cloth),
            };
            let by_sizes = &room.by_sizes[cloth * count..][..count];
            let to = &mut by_sums[own];
            multiply(using, &[term], count, Epilogue::Bias(by_sizes), to);
        }
        let rows = by_slices.chunks_exact_mut(count);
        for ((to, from), &share) in rows.zip(by_sums.chunks_exact(count)).zip(shares) {
            to.iter_mut()
                .zip(from)
                .for_each(|(to, &x)| *to += share * x);
        }
        softmax_backward(slices, by_slices, count);
        gradient.add_linear(using, &self.slice, by_slices, of.rows);
        let term = self.of_slice.back(weights, by_slices);
        multiply(using, &[term], latent, Epilogue::Add, nodes);
    }
}

/// Rows of a partition on the way back through what its vertices wrote.
pub(crate) struct WriteBack<'a, T> {
    /// Weights over the tokens, `[vertices, tokens]`.
    pub(crate) slices: &'a [T],
    /// In: gradients of the weights from what vertices read; overwritten, `[vertices, tokens]`.
    pub(crate) by_slices: &'a mut [T],
    /// Gradients of the latent vertices, added to, `[vertices, latent]`.
    pub(crate) nodes: &'a mut [T],
}
