//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added. With a filter over the whole cloth, or with tokens, v' is of [v, Σ e',
//! filtered v, what v reads of the tokens].
//!
//! The first arc layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. These **endpoint products** of all vertices
//! must be there before a block begins; then one thread takes a partition through all of it. The
//! tests compare the split update with the update on concatenated rows.

use std::ops::Range;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Partition, chunks, counted_from, of_rows};
use crate::graph::share::{Rows, SplitRows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Endpoints, Epilogue, Slot, Term, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::kernels::rows::{
    ColumnBlock, OutgoingArcs, Receivers, gather_receivers, sum_incoming, sum_outgoing,
};
use crate::network::layers::block_rows::{
    ArcGradients, ArcRecordRows, ArcRows, BeforeBlock, NodeGradients, NodeRecordRows, NodeRows,
};
use crate::network::layers::filter::{Filter, Through};
use crate::network::layers::mlp::{Mlp, MlpGradients, MlpRecord};
use crate::network::layers::per_cloth::OfVertices;
use crate::network::layers::scratch::{GroupWork, Scratch, pick};
use crate::network::layers::tokens::{Tokens, WriteBack};
use crate::network::layers::whole_cloth::{WholeRoom, WholeSums};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::parameters::ModuleGradient;
use crate::spec::ModelSpec;

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
    /// The tokens, if there are any.
    pub(crate) tokens: Option<Tokens>,
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

/// A partition before a block.
#[derive(Clone, Copy)]
pub(crate) struct BlockInput<'a, T> {
    pub(crate) graph: &'a Connectivity,
    pub(crate) partition: &'a Partition,
    /// Endpoint products of all vertices, `[all vertices, 2 latent]`.
    pub(crate) endpoint_products: &'a [T],
    /// The matrices of filter and tokens, where the block has them.
    pub(crate) whole: &'a WholeRoom<T>,
    /// Weights of all vertices over the tokens, `[all vertices, tokens]`.
    pub(crate) slices: &'a [T],
}

/// A partition after the forward pass of a block.
#[derive(Clone, Copy)]
pub(crate) struct BlockKept<'a, T> {
    pub(crate) graph: &'a Connectivity,
    pub(crate) partition: &'a Partition,
    pub(crate) record: &'a BlockRecord<T>,
    /// The matrices of filter and tokens, where the block has them.
    pub(crate) whole: &'a WholeRoom<T>,
    /// Weights of all vertices over the tokens, `[all vertices, tokens]`.
    pub(crate) slices: &'a [T],
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
    pub(crate) fn new(module: &mut ModuleBuilder, path: &str, spec: &ModelSpec) -> Self {
        let (latent, is_filtered) = (spec.latent, spec.filter_modes > 0);
        let arc = Mlp::normalised(module, &format!("{path}.edge"), 3 * latent, latent);
        let of_tokens = (2 + usize::from(is_filtered)) * latent;
        let has_tokens = spec.tokens > 0;
        let of_node = of_tokens + usize::from(has_tokens) * latent;
        let node = Mlp::normalised(module, &format!("{path}.node"), of_node, latent);
        let filter = is_filtered
            .then(|| Filter::new(module, &format!("{path}.filter"), latent, &node.first));
        let tokens = has_tokens.then(|| {
            let path = format!("{path}.tokens");
            Tokens::new(module, &path, spec.tokens, &node.first, of_tokens)
        });
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
            tokens,
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
        if let Some(tokens) = &self.tokens {
            tokens.pack(packer);
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

    /// Sets what must be there of a partition before the block begins: from its latent vertices
    /// their endpoint products, their weights over the tokens, and sums for filter and tokens.
    pub(crate) fn begin<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        whole: &WholeRoom<T>,
        of: OfVertices<'_, T>,
        rows: &mut BeforeBlock<'_, T>,
        sums: &mut WholeSums<T>,
    ) {
        self.endpoint_products(weights, of.rows, &mut rows.products);
        if self.filter.is_some() {
            let (modes, count) = (&mut sums.modes, of.graph.mode_count());
            modes.begin(of.graph, of.vertices, count, self.latent());
            let filter = &whole.filter;
            filter.add(weights.instructions, Through::Weighted, of, modes);
        }
        if let Some(tokens) = &self.tokens {
            let (slices, sums) = (&mut rows.slices, &mut sums.tokens);
            tokens.write(weights, &whole.tokens, of, slices, sums);
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
            let mut terms = [of_node, of_incoming, of_node, of_node];
            let count = 2 + self.of_cloth(input, cloth, &part, &mut terms[2..]);
            let terms = &terms[..count];
            self.node.first_layer(weights, terms, epilogue, &mut tile);
            self.node
                .forward(weights, tile, Normalised::Add(&mut nodes[rows]));
        }
    }

    /// Sets what part of a partition sees of its cloth in the first node layer: as many terms as
    /// this returns.
    fn of_cloth<'a, T: Real>(
        &self,
        input: BlockInput<'a, T>,
        cloth: usize,
        part: &Range<usize>,
        terms: &mut [Term<'a, T>],
    ) -> usize {
        let filtered = self
            .filter
            .map(|_| input.whole.filter.term(cloth, part, Through::Values));
        let read = self.tokens.map(|tokens| {
            let slices = &input.slices[of_rows(part, tokens.count())];
            input.whole.tokens.term(cloth, slices)
        });
        let seen = filtered.into_iter().chain(read);
        let places = terms.iter_mut().zip(seen);
        places.map(|(to, term)| *to = term).count()
    }

    /// The parts of a partition that have one matrix each, and the number of the matrix: all of it
    /// without a filter and tokens, else those that belong to one cloth.
    fn parts(
        &self,
        graph: &Connectivity,
        vertices: &Range<usize>,
    ) -> impl Iterator<Item = (usize, Range<usize>)> {
        let divides = self.filter.is_some() || self.tokens.is_some();
        let whole = (!divides).then(|| (0, vertices.clone()));
        let by_cloth = divides.then(|| graph.by_cloth(vertices.clone()));
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
        self.nodes_backward(weights, kept, &mut nodes, group);
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
        gradients: &mut NodeGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let NodeGradients { nodes, slices, .. } = gradients;
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
        let (of, whole) = (
            OfVertices::new(kept.graph, kept.partition, pre_activation),
            kept.whole,
        );
        let WholeSums { modes, tokens } = &mut scratch.whole_sums;
        if self.filter.is_some() {
            whole.filter.add(using, Through::Values, of, modes);
        }
        if self.tokens.is_some() {
            let sums = &mut tokens.rows;
            whole.tokens.add_read(using, kept.slices, of, slices, sums);
        }
        let term = self.of_node.back(weights, pre_activation);
        multiply(using, &[term], latent, Epilogue::Add, nodes);
        let term = self.of_incoming.back(weights, pre_activation);
        let incoming = &mut scratch.incoming[..range.len()];
        multiply(using, &[term], latent, Epilogue::Set, incoming);
    }

    /// Begins the sums that [`Self::backward`] adds to, for a range of vertices.
    pub(crate) fn begin_sums<T: Real>(
        &self,
        graph: &Connectivity,
        vertices: &Range<usize>,
        sums: &mut WholeSums<T>,
    ) {
        let latent = self.latent();
        if self.filter.is_some() {
            let modes = graph.mode_count();
            sums.modes.begin(graph, vertices, modes, latent);
        }
        if let Some(tokens) = &self.tokens {
            let rows = &mut sums.tokens.rows;
            rows.begin(graph, vertices, tokens.count(), latent);
        }
    }

    /// From the gradients of what filter and tokens give to the node updates of block `number`,
    /// summed over all vertices, to those of the sums that they are made of, whose matrices are
    /// packed. Adds those of the weights.
    pub(crate) fn cloths_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        number: usize,
        whole: &mut WholeRoom<T>,
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        if let Some(filter) = &self.filter {
            let room = &mut whole.filter;
            filter.room_backward(weights, &self.node, number, room, gradient);
        }
        if let Some(tokens) = &self.tokens {
            let room = &mut whole.tokens;
            tokens.backward(weights, &self.node, number, room, gradient);
        }
    }

    /// The gradient of the nodes through A and B, after [`Self::backward`] of all partitions left
    /// the pre-activation gradients `[all arcs, latent]`, and through filter and tokens, whose
    /// matrices are those of the way back by then.
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
            mut slices,
        } = rows;
        let arcs = OutgoingArcs {
            first_arc: &graph.first_arc[vertices.start..=vertices.end],
            reverse_arcs: &graph.reverse_arcs,
        };
        sum_outgoing(using, &mut sums, self.leaving(), pre_activation, arcs);
        let all = Columns::all(&sums, 2 * latent);
        let before = &kept.record.nodes[of_rows(vertices, latent)];
        for column in [0, latent] {
            let (part, before) = (all.part(column, latent), Columns::all(before, latent));
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
                let term = kept.whole.filter.term(cloth, &part, Through::Weighted);
                multiply(using, &[term], latent, Epilogue::Add, &mut nodes[rows]);
            }
        }
        if let Some(tokens) = &self.tokens {
            let back = WriteBack {
                slices: &kept.slices[of_rows(vertices, tokens.count())],
                by_slices: &mut slices,
                nodes: &mut nodes,
            };
            let (of, room) = (
                OfVertices::new(graph, kept.partition, before),
                &kept.whole.tokens,
            );
            tokens.write_backward(weights, room, of, back, group);
        }
    }
}
