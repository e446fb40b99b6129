//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added. With a filter over the whole cloth, v' is of [v, Σ e', filtered v].
//!
//! The first arc layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. These **endpoint products** of all vertices
//! must be there before a block begins; then one thread takes a partition through all of it. The
//! tests compare the split update with the update on concatenated rows.

use std::ops::Range;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Partition, chunks, counted_from, of_rows};
use crate::graph::share::{Rows, SplitRows, split_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Endpoints, Epilogue, Slot, Term, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::kernels::rows::{
    ColumnBlock, OutgoingArcs, Receivers, gather_receivers, sum_incoming, sum_outgoing,
};
use crate::network::layers::filter::{Filter, FilterRoom, ModeSums, OfVertices, Through};
use crate::network::layers::mlp::{Mlp, MlpGradients, MlpRecord, MlpRows};
use crate::network::layers::scratch::{GroupWork, Scratch, pick};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::parameters::ModuleGradient;

/// Places of the weights of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    arc: Mlp,
    node: Mlp,
    /// A and B of the first arc layer side by side.
    endpoints: Slot,
    /// A and B for the backward pass.
    endpoints_backward: Slot,
    /// C of the first arc layer.
    of_arc: Piece,
    /// The first node layer's columns for v.
    of_node: Piece,
    /// The first node layer's columns for Σ e'.
    of_incoming: Piece,
    /// The filter over the whole cloth, if there is one.
    pub(crate) filter: Option<Filter>,
}

/// Activations of one block, kept for the backward pass.
#[derive(Default)]
pub(crate) struct BlockRecord<T> {
    /// Latent nodes before the block, `[vertices, latent]`.
    nodes: Aligned<T>,
    /// Latent arcs before the block, `[arcs, latent]`.
    arcs: Aligned<T>,
    /// Sum of the messages that arrive, `[vertices, latent]`.
    incoming: Aligned<T>,
    arc: MlpRecord<T>,
    node: MlpRecord<T>,
}

split_rows! {
    /// Rows of vertices that a block writes.
    pub(crate) struct NodeRows<'a, T> {
        /// Latent nodes, updated, `[vertices, latent]`.
        pub(crate) nodes: Rows<'a, T>,
        pub(crate) record: NodeRecordRows<'a, T>,
    }
}

split_rows! {
    /// Rows of arcs that a block writes.
    pub(crate) struct ArcRows<'a, T> {
        /// Latent arcs, updated, `[arcs, latent]`.
        pub(crate) arcs: Rows<'a, T>,
        pub(crate) record: ArcRecordRows<'a, T>,
    }
}

split_rows! {
    /// Rows of vertices of a [`BlockRecord`]; empty where nothing is kept.
    pub(crate) struct NodeRecordRows<'a, T> {
        before: Rows<'a, T>,
        incoming: Rows<'a, T>,
        mlp: MlpRows<'a, T>,
    }
}

split_rows! {
    /// Rows of arcs of a [`BlockRecord`]; empty where nothing is kept.
    pub(crate) struct ArcRecordRows<'a, T> {
        before: Rows<'a, T>,
        mlp: MlpRows<'a, T>,
    }
}

split_rows! {
    /// Gradients of a block's vertices, taken from after it to before it.
    pub(crate) struct NodeGradients<'a, T> {
        /// `[vertices, latent]`.
        pub(crate) nodes: Rows<'a, T>,
        /// Out: sums of the pre-activation gradients over the arcs that leave a vertex, then over
        /// the arcs that arrive, `[vertices, 2 latent]`.
        pub(crate) sums: Rows<'a, T>,
    }
}

split_rows! {
    /// Gradients of a block's arcs, taken from after it to before it.
    pub(crate) struct ArcGradients<'a, T> {
        /// `[arcs, latent]`.
        pub(crate) arcs: Rows<'a, T>,
        /// Out: pre-activation gradient of the first arc layer, `[arcs, latent]`.
        pub(crate) pre_activation: Rows<'a, T>,
    }
}

/// A partition before a block.
#[derive(Clone, Copy)]
pub(crate) struct BlockInput<'a, T> {
    pub(crate) graph: &'a Connectivity,
    pub(crate) partition: &'a Partition,
    /// Endpoint products of all vertices, `[all vertices, 2 latent]`.
    pub(crate) endpoint_products: &'a [T],
    /// The filter's matrices, where the block has a filter.
    pub(crate) filter: &'a FilterRoom<T>,
}

/// A partition after the forward pass of a block.
#[derive(Clone, Copy)]
pub(crate) struct BlockKept<'a, T> {
    pub(crate) graph: &'a Connectivity,
    pub(crate) partition: &'a Partition,
    pub(crate) record: &'a BlockRecord<T>,
    /// The filter's matrices, where the block has a filter.
    pub(crate) filter: &'a FilterRoom<T>,
}

impl<T: Real> BlockRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let latents = [&self.nodes, &self.arcs, &self.incoming];
        let held: usize = latents.iter().map(|numbers| numbers.len()).sum();
        held + self.arc.number_count() + self.node.number_count()
    }

    /// Makes room for a graph of that many vertices and arcs.
    pub(crate) fn fit(&mut self, block: &Block, vertices: usize, arcs: usize) {
        let latent = block.latent();
        self.nodes.resize(vertices * latent);
        self.arcs.resize(arcs * latent);
        self.incoming.resize(vertices * latent);
        self.arc.fit(&block.arc, arcs);
        self.node.fit(&block.node, vertices);
    }

    /// All rows, to be written.
    pub(crate) fn rows(&mut self, block: &Block) -> (NodeRecordRows<'_, T>, ArcRecordRows<'_, T>) {
        let latent = block.latent();
        let nodes = NodeRecordRows {
            before: Rows::new(&mut self.nodes, latent),
            incoming: Rows::new(&mut self.incoming, latent),
            mlp: self.node.rows(&block.node),
        };
        let arcs = ArcRecordRows {
            before: Rows::new(&mut self.arcs, latent),
            mlp: self.arc.rows(&block.arc),
        };
        (nodes, arcs)
    }
}

impl Block {
    pub(crate) fn new(
        module: &mut ModuleBuilder,
        path: &str,
        latent: usize,
        is_filtered: bool,
    ) -> Self {
        let arc = Mlp::normalised(module, &format!("{path}.edge"), 3 * latent, latent);
        let of_node = (2 + usize::from(is_filtered)) * latent;
        let node = Mlp::normalised(module, &format!("{path}.node"), of_node, latent);
        let filter = is_filtered
            .then(|| Filter::new(module, &format!("{path}.filter"), latent, &node.first));
        let size = &mut module.size;
        Self {
            arc,
            node,
            endpoints: size.forward(latent, 2 * latent),
            endpoints_backward: size.backward(2 * latent, latent),
            of_arc: Piece::new(size, &arc.first, 2 * latent, latent),
            of_node: Piece::new(size, &node.first, 0, latent),
            of_incoming: Piece::new(size, &node.first, latent, latent),
            filter,
        }
    }

    fn latent(&self) -> usize {
        self.node.first.outputs
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for mlp in [&self.arc, &self.node] {
            mlp.pack(packer);
        }
        for piece in [&self.of_arc, &self.of_node, &self.of_incoming] {
            piece.pack(packer);
        }
        if let Some(filter) = &self.filter {
            filter.of_filtered.pack(packer);
        }
        let (latent, flat) = (self.latent(), packer.flat);
        let weight = &flat[self.arc.first.weight_range()];
        // Row i of A, then row i of B.
        let of_end = |end: usize, column: usize| {
            let (which, row) = (end / latent, end % latent);
            weight[row * 3 * latent + which * latent + column]
        };
        packer.forward(self.endpoints, |l, j| of_end(j, l));
        packer.backward(self.endpoints_backward, of_end);
    }

    /// Endpoint products A v and B v + b of the split arc layer, `[vertices, 2 latent]`.
    pub(crate) fn endpoint_products<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        nodes: &[T],
        products: &mut [T],
    ) {
        let (latent, bias) = (self.latent(), self.arc.first.bias_range());
        let term = Term {
            rows: Columns::all(nodes, latent),
            packed: self.endpoints.of(&weights.module.forward),
        };
        let epilogue = Epilogue::SecondHalfBias(&weights.flat[bias]);
        multiply(
            weights.instructions,
            &[term],
            2 * latent,
            epilogue,
            products,
        );
    }

    /// Sets the sums of a partition that the block's filter needs; nothing without a filter.
    pub(crate) fn add_modes<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        filter: &FilterRoom<T>,
        of: OfVertices<'_, T>,
        sums: &mut ModeSums<T>,
    ) {
        if self.filter.is_some() {
            sums.begin(of.graph, of.vertices, self.latent());
            filter.add(weights.instructions, Through::Weighted, of, sums);
        }
    }

    /// Updates the latent vectors of a partition in place.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: BlockInput<'_, T>,
        rows: &mut NodeRows<'_, T>,
        mut arcs: ArcRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let NodeRows { nodes, record } = rows;
        let incoming = pick(&mut record.incoming, &mut scratch.incoming, nodes.len());
        incoming.fill(T::ZERO);
        let range = &input.partition.arcs;
        for chunk in chunks(range.clone()) {
            let ArcRows { arcs, mut record } = arcs.part(&counted_from(&chunk, range.start));
            if !record.before.is_empty() {
                record.before.copy_from_slice(&arcs);
            }
            let mut tile = scratch.tiles.tile(record.mlp, chunk.len(), self.latent());
            let receivers = &input.graph.receivers[chunk.clone()];
            let epilogue = Epilogue::EndpointsRelu(Endpoints {
                products: input.endpoint_products,
                senders: &input.graph.senders[chunk],
                receivers,
            });
            let terms = &[self.of_arc.times(weights, &arcs)];
            self.arc.first_layer(weights, terms, epilogue, &mut tile);
            let messages = Normalised::Messages {
                arcs: arcs.values,
                incoming: &mut *incoming,
                receivers: Receivers {
                    of: receivers,
                    first: input.partition.vertices.start,
                },
            };
            self.arc.forward(weights, tile, messages);
        }
        if !record.before.is_empty() {
            record.before.copy_from_slice(nodes);
        }
        let vertices = &input.partition.vertices;
        for (cloth, part) in self.parts(input.graph, vertices) {
            let local = counted_from(&part, vertices.start);
            let rows = of_rows(&local, self.latent());
            let kept = record.mlp.part(&local);
            let mut tile = scratch.tiles.tile(kept, local.len(), self.latent());
            let of_node = self.of_node.times(weights, &nodes[rows.clone()]);
            let of_incoming = self.of_incoming.times(weights, &incoming[rows.clone()]);
            let epilogue = self.node.first_epilogue(weights);
            let terms: &[Term<'_, T>] = match self.filter {
                None => &[of_node, of_incoming],
                Some(_) => {
                    let filtered = input.filter.term(cloth, &part, Through::Values);
                    &[of_node, of_incoming, filtered]
                }
            };
            self.node.first_layer(weights, terms, epilogue, &mut tile);
            self.node
                .forward(weights, tile, Normalised::Add(&mut nodes[rows]));
        }
    }

    /// The parts of a partition that have one matrix each, and the number of the matrix: all of it
    /// without a filter, else those that belong to one cloth.
    fn parts(
        &self,
        graph: &Connectivity,
        vertices: &Range<usize>,
    ) -> impl Iterator<Item = (usize, Range<usize>)> {
        let whole = self.filter.is_none().then(|| (0, vertices.clone()));
        let by_cloth = self.filter.map(|_| graph.by_cloth(vertices.clone()));
        whole.into_iter().chain(by_cloth.into_iter().flatten())
    }

    /// Takes the gradients of a partition's latent vectors from after the block to before it,
    /// except for the way through A and B ([`Self::endpoints_backward`]). Adds the gradients of the
    /// weights.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: BlockKept<'_, T>,
        mut nodes: NodeGradients<'_, T>,
        mut arcs: ArcGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        self.nodes_backward(weights, kept, &mut nodes.nodes, group);
        nodes.sums.fill(T::ZERO);
        let range = &kept.partition.arcs;
        for chunk in chunks(range.clone()) {
            let ArcGradients {
                mut arcs,
                mut pre_activation,
            } = arcs.part(&counted_from(&chunk, range.start));
            let receivers = Receivers {
                of: &kept.graph.receivers[chunk.clone()],
                first: kept.partition.vertices.start,
            };
            let scratch = &mut *group.scratch;
            let output = &mut scratch.output[..arcs.len()];
            gather_receivers(using, output, latent, &arcs, &scratch.incoming, receivers);
            let activations = kept.record.arc.tile(&self.arc, &chunk);
            let gradients = MlpGradients {
                output,
                hidden: &mut scratch.hidden[..arcs.len()],
                pre_activation: &mut pre_activation,
            };
            let gradient = &mut group.gradient;
            self.arc.backward(weights, activations, gradients, gradient);
            let before = &kept.record.arcs[of_rows(&chunk, latent)];
            let [left, right] = [&*pre_activation, before].map(|rows| Columns::all(rows, latent));
            self.arc
                .first_backward(weights, 2 * latent, left, right, gradient);
            let term = self.of_arc.back(weights, &pre_activation);
            multiply(using, &[term], latent, Epilogue::Add, &mut arcs);
            let arriving = self.arriving();
            sum_incoming(using, &mut nodes.sums, arriving, &pre_activation, receivers);
        }
    }

    /// The columns of [`NodeGradients::sums`] over the arcs that leave a vertex.
    fn leaving(&self) -> ColumnBlock {
        ColumnBlock {
            first: 0,
            width: self.latent(),
            stride: 2 * self.latent(),
        }
    }

    /// The columns of [`NodeGradients::sums`] over the arcs that arrive at a vertex.
    fn arriving(&self) -> ColumnBlock {
        ColumnBlock {
            first: self.latent(),
            ..self.leaving()
        }
    }

    /// The gradient of the nodes through their own update; leaves that of the sums of messages in
    /// the scratch.
    fn nodes_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: BlockKept<'_, T>,
        nodes: &mut [T],
        group: &mut GroupWork<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let (scratch, gradient) = (&mut *group.scratch, &mut group.gradient);
        let (record, vertices) = (kept.record, &kept.partition.vertices);
        let range = of_rows(vertices, latent);
        let output = &mut scratch.output[..range.len()];
        output.copy_from_slice(nodes);
        let pre_activation = &mut scratch.pre_activation[..range.len()];
        let gradients = MlpGradients {
            output,
            hidden: &mut scratch.hidden[..range.len()],
            pre_activation: &mut *pre_activation,
        };
        let activations = record.node.tile(&self.node, vertices);
        self.node
            .backward(weights, activations, gradients, gradient);
        let inputs = [&record.nodes, &record.incoming];
        for (number, input) in inputs.into_iter().enumerate() {
            let left = Columns::all(pre_activation, latent);
            let right = Columns::all(&input[range.clone()], latent);
            self.node
                .first_backward(weights, number * latent, left, right, gradient);
        }
        if self.filter.is_some() {
            let of = OfVertices::new(kept.graph, kept.partition, pre_activation);
            let sums = &mut scratch.mode_sums;
            kept.filter.add(using, Through::Values, of, sums);
        }
        let term = self.of_node.back(weights, pre_activation);
        multiply(using, &[term], latent, Epilogue::Add, nodes);
        let term = self.of_incoming.back(weights, pre_activation);
        let incoming = &mut scratch.incoming[..range.len()];
        multiply(using, &[term], latent, Epilogue::Set, incoming);
    }

    /// Adds the gradient of the first node layer's columns for the filter: `mixed` is the gradient
    /// of the filtered modes' products with them, both `[all modes, latent]`.
    pub(crate) fn filtered_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        mixed: &[T],
        filtered: &[T],
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let latent = self.latent();
        let [left, right] = [mixed, filtered].map(|rows| Columns::all(rows, latent));
        self.node
            .first_backward(weights, 2 * latent, left, right, gradient);
    }

    /// The gradient of the nodes through A and B, after [`Self::backward`] of all partitions left
    /// the pre-activation gradients `[all arcs, latent]`, and through the filter, whose matrices
    /// are those of the way back by then.
    pub(crate) fn endpoints_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: BlockKept<'_, T>,
        pre_activation: &[T],
        rows: NodeGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let (graph, vertices) = (kept.graph, &kept.partition.vertices);
        let NodeGradients {
            mut nodes,
            mut sums,
        } = rows;
        let arcs = OutgoingArcs {
            first_arc: &graph.first_arc[vertices.start..=vertices.end],
            reverse_arcs: &graph.reverse_arcs,
        };
        sum_outgoing(using, &mut sums, self.leaving(), pre_activation, arcs);
        let all = Columns::all(&sums, 2 * latent);
        let before = Columns::all(&kept.record.nodes[of_rows(vertices, latent)], latent);
        for column in [0, latent] {
            let part = all.part(column, latent);
            let gradient = &mut group.gradient;
            self.arc
                .first_backward(weights, column, part, before, gradient);
        }
        let term = Term {
            rows: all,
            packed: self.endpoints_backward.of(&weights.module.backward),
        };
        multiply(using, &[term], latent, Epilogue::Add, &mut nodes);
        if self.filter.is_some() {
            for (cloth, part) in graph.by_cloth(vertices.clone()) {
                let rows = of_rows(&counted_from(&part, vertices.start), latent);
                let term = kept.filter.term(cloth, &part, Through::Weighted);
                multiply(using, &[term], latent, Epilogue::Add, &mut nodes[rows]);
            }
        }
    }
}
