//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added.
//!
//! The first arc layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. These **endpoint products** of all vertices
//! must be there before a block begins; then one thread takes a partition through all of it. The
//! tests compare the split update with the update on concatenated rows.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Partition, chunks, counted_from};
use crate::graph::share::{Rows, SplitRows};
use crate::kernels::gemm::{Columns, Endpoints, Epilogue, Slot, Term, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::kernels::rows::{
    ColumnBlock, OutgoingArcs, Receivers, gather_receivers, sum_incoming, sum_outgoing,
};
use crate::network::layers::mlp::{Mlp, tile};
use crate::network::layers::scratch::{GroupWork, Scratch};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::saved::Saved;
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
}

/// Activations of one block, kept for the backward pass.
#[derive(Default)]
pub(crate) struct BlockSaved<T> {
    /// Latent nodes before the block and the sums of the messages that arrive, `[vertices, latent]`;
    /// the activations of the node update.
    pub(crate) nodes: Saved<T, 6>,
    /// Latent arcs before the block, `[arcs, latent]`; the activations of the arc update.
    pub(crate) arcs: Saved<T, 5>,
}

/// Latent arcs `[arcs, latent]`, which a block updates, and what is kept of them.
pub(crate) type ArcRows<'a, T> = (Rows<'a, T>, [Rows<'a, T>; 5]);

/// Gradients of vertices, taken from after a block to before it, `[vertices, latent]`; out: sums of
/// the gradients of the first arc layer's sums over the arcs that leave a vertex, then over the arcs
/// that arrive, `[vertices, 2 latent]`.
pub(crate) type NodeGradients<'a, T> = (Rows<'a, T>, Rows<'a, T>);

/// Gradients of arcs, taken from after a block to before it; out: gradients of the first arc layer's
/// sums, `[arcs, latent]` both.
pub(crate) type ArcGradients<'a, T> = (Rows<'a, T>, Rows<'a, T>);

/// A partition before a block, and the endpoint products of all vertices,
/// `[all vertices, 2 latent]`.
pub(crate) type BlockInput<'a, T> = (&'a Connectivity, &'a Partition, &'a [T]);

/// A partition after the forward pass of a block, and what is kept of it.
pub(crate) type BlockKept<'a, T> = (&'a Connectivity, &'a Partition, &'a BlockSaved<T>);

impl<T: Real> BlockSaved<T> {
    /// Makes room for a graph of that many vertices and arcs.
    pub(crate) fn fit(&mut self, block: &Block, vertices: usize, arcs: usize) {
        let latent = block.latent();
        let [a, b, c, d] = block.node.widths();
        self.nodes.fit(vertices, [latent, latent, a, b, c, d]);
        let [a, b, c, d] = block.arc.widths();
        self.arcs.fit(arcs, [latent, a, b, c, d]);
    }
}

impl Block {
    pub(crate) fn new(module: &mut ModuleBuilder, path: &str, spec: &ModelSpec) -> Self {
        let latent = spec.latent;
        let arc = Mlp::normalised(module, &format!("{path}.edge"), 3 * latent, latent);
        let node = Mlp::normalised(module, &format!("{path}.node"), 2 * latent, latent);
        let size = &mut module.size;
        Self {
            arc,
            node,
            endpoints: size.forward(latent, 2 * latent),
            endpoints_backward: size.backward(2 * latent, latent),
            of_arc: Piece::new(size, &arc.first, 2 * latent, latent),
            of_node: Piece::new(size, &node.first, 0, latent),
            of_incoming: Piece::new(size, &node.first, latent, latent),
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

    /// Updates the latent vectors of a partition in place, its nodes with the rows that are kept of
    /// them.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, partition, endpoint_products): BlockInput<'_, T>,
        (nodes, kept): (&mut Rows<'_, T>, [Rows<'_, T>; 6]),
        mut arcs: ArcRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let [before, incoming, activations @ ..] = kept;
        let incoming = match incoming.is_empty() {
            true => &mut scratch.incoming[..nodes.len()],
            false => incoming.values,
        };
        incoming.fill(T::ZERO);
        let range = &partition.arcs;
        for chunk in chunks(range.clone()) {
            let (arcs, kept) = arcs.part(&counted_from(&chunk, range.start));
            let [before, activations @ ..] = kept;
            keep(before, &arcs);
            let mut tile = tile(activations, &mut scratch.tiles, chunk.len());
            let receivers = &graph.receivers[chunk.clone()];
            let epilogue = Epilogue::EndpointsRelu(Endpoints {
                products: endpoint_products,
                senders: &graph.senders[chunk],
                receivers,
            });
            let terms = &[self.of_arc.times(weights, &arcs)];
            self.arc.first_layer(weights, terms, epilogue, &mut tile);
            let messages = Normalised::Messages {
                arcs: arcs.values,
                incoming: &mut *incoming,
                receivers: Receivers {
                    of: receivers,
                    first: partition.vertices.start,
                },
            };
            self.arc.forward(weights, tile, messages);
        }
        keep(before, nodes);
        let count = nodes.len() / self.latent();
        let mut tile = tile(activations, &mut scratch.tiles, count);
        let terms = &[
            self.of_node.times(weights, nodes),
            self.of_incoming.times(weights, incoming),
        ];
        let epilogue = self.node.first_epilogue(weights);
        self.node.first_layer(weights, terms, epilogue, &mut tile);
        self.node.forward(weights, tile, Normalised::Add(nodes));
    }

    /// Takes the gradients of a partition's latent vectors from after the block to before it,
    /// except for the way through A and B ([`Self::endpoints_backward`]). Adds the gradients of the
    /// weights.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: BlockKept<'_, T>,
        (mut nodes, mut sums): NodeGradients<'_, T>,
        mut arcs: ArcGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        self.nodes_backward(weights, kept, &mut nodes, group);
        let (graph, partition, saved) = kept;
        sums.fill(T::ZERO);
        let range = &partition.arcs;
        for chunk in chunks(range.clone()) {
            let (mut arcs, mut by_sums) = arcs.part(&counted_from(&chunk, range.start));
            let receivers = Receivers {
                of: &graph.receivers[chunk.clone()],
                first: partition.vertices.start,
            };
            let [before, activations @ ..] = saved.arcs.at(&chunk);
            let [output, hidden, ..] = &mut group.scratch.tiles;
            let (output, hidden) = (&mut output[..arcs.len()], &mut hidden[..arcs.len()]);
            let incoming = &group.scratch.incoming;
            gather_receivers(using, output, latent, &arcs, incoming, receivers);
            let (through, gradient) = ([output, hidden, &mut *by_sums], &mut group.gradient);
            self.arc.backward(weights, activations, through, gradient);
            let [left, right] = [&*by_sums, before].map(|rows| Columns::all(rows, latent));
            self.arc
                .first_backward(weights, 2 * latent, left, right, gradient);
            let term = self.of_arc.back(weights, &by_sums);
            multiply(using, &[term], latent, Epilogue::Add, &mut arcs);
            sum_incoming(using, &mut sums, self.arriving(), &by_sums, receivers);
        }
    }

    /// The columns of the sums of [`NodeGradients`] over the arcs that leave a vertex.
    fn leaving(&self) -> ColumnBlock {
        ColumnBlock {
            first: 0,
            width: self.latent(),
            stride: 2 * self.latent(),
        }
    }

    /// The columns of the sums of [`NodeGradients`] over the arcs that arrive at a vertex.
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
        (_, partition, saved): BlockKept<'_, T>,
        nodes: &mut [T],
        group: &mut GroupWork<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let (scratch, gradient) = (&mut *group.scratch, &mut group.gradient);
        let [before, incoming, activations @ ..] = saved.nodes.at(&partition.vertices);
        let size = nodes.len();
        let [output, hidden, by_sums, _] = &mut scratch.tiles;
        let [output, hidden, by_sums] = [output, hidden, by_sums].map(|tile| &mut tile[..size]);
        output.copy_from_slice(nodes);
        let through = [output, hidden, &mut *by_sums];
        self.node.backward(weights, activations, through, gradient);
        for (number, input) in [before, incoming].into_iter().enumerate() {
            let [left, right] = [&*by_sums, input].map(|rows| Columns::all(rows, latent));
            self.node
                .first_backward(weights, number * latent, left, right, gradient);
        }
        let term = self.of_node.back(weights, by_sums);
        multiply(using, &[term], latent, Epilogue::Add, nodes);
        let term = self.of_incoming.back(weights, by_sums);
        let by_incoming = &mut scratch.incoming[..size];
        multiply(using, &[term], latent, Epilogue::Set, by_incoming);
    }

    /// The gradient of the nodes through A and B, after [`Self::backward`] of all partitions left
    /// the gradients `by_sums` of the first arc layer's sums, `[all arcs, latent]`.
    pub(crate) fn endpoints_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, Partition { vertices, .. }, saved): BlockKept<'_, T>,
        by_sums: &[T],
        (mut nodes, mut sums): NodeGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let arcs = OutgoingArcs {
            first_arc: &graph.first_arc[vertices.start..=vertices.end],
            reverse_arcs: &graph.reverse_arcs,
        };
        sum_outgoing(using, &mut sums, self.leaving(), by_sums, arcs);
        let all = Columns::all(&sums, 2 * latent);
        let [before, ..] = saved.nodes.at(vertices);
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
    }
}

/// Writes `now` to the rows that are kept, unless there are none.
fn keep<T: Copy>(kept: Rows<'_, T>, now: &[T]) {
    if !kept.is_empty() {
        kept.values.copy_from_slice(now);
    }
}
