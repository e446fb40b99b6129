//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added.
//!
//! The first edge layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. The tests hold the update as it is written, on
//! concatenated rows, against it.
//!
//! A leaf (some vertices and the arcs into them) is taken through all of it by one thread: only
//! A v_s + B v_r of all vertices must be there before.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Arrays, Leaf, chunks, of_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Ends, Finish, Slot, Term, multiply};
use crate::kernels::real::Real;
use crate::kernels::{Normalised, Receivers, gather_receivers, sum_incoming, sum_outgoing};
use crate::network::layers::mlp::{Mlp, MlpRecord};
use crate::network::layers::{GroupScratch, Scratch, pick};
use crate::network::packed::{LayerWeights, ModuleSize, Packer, Piece};
use crate::network::parameters::{LayoutBuilder, ModuleGradient};

/// Where the weights of a block lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    edge: Mlp,
    node: Mlp,
    /// A and B of the first edge layer side by side, both ways.
    ends: [Slot; 2],
    /// C of the first edge layer.
    edges: Piece,
    /// The first vertex layer's parts for v and for Σ e'.
    nodes: [Piece; 2],
}

/// Activations of one block, kept for the backward pass.
#[derive(Default)]
pub(crate) struct BlockRecord<T> {
    /// Latent vertices before the block, `[vertices, latent]`.
    nodes: Aligned<T>,
    /// Latent arcs before the block, `[arcs, latent]`.
    edges: Aligned<T>,
    /// Sum of the messages that arrive, `[vertices, latent]`.
    incoming: Aligned<T>,
    edge: MlpRecord<T>,
    node: MlpRecord<T>,
}

/// The rows of a leaf that a block writes; those of the record are empty where nothing is kept.
pub(crate) struct BlockRows<'a, T> {
    /// `[vertices, latent]`, updated.
    pub(crate) nodes: &'a mut [T],
    /// `[arcs, latent]`, updated.
    pub(crate) edges: &'a mut [T],
    /// Nodes before, incoming, and the activations of the perceptron.
    pub(crate) node_record: [&'a mut [T]; 6],
    /// Edges before, and the activations of the perceptron.
    pub(crate) edge_record: [&'a mut [T]; 5],
}

/// The rows of a leaf whose gradients a block takes from after it to before it.
pub(crate) struct BlockGradients<'a, T> {
    pub(crate) nodes: &'a mut [T],
    pub(crate) edges: &'a mut [T],
    /// Out: gradient of the first edge layer's sums, `[arcs, latent]`.
    pub(crate) first: &'a mut [T],
    /// Out: the sums of those over the arcs that leave a vertex, and over those that arrive,
    /// `[vertices, 2 latent]`.
    pub(crate) sums: &'a mut [T],
}

impl<T: Real> BlockRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let latents = [&self.nodes, &self.edges, &self.incoming];
        let held: usize = latents.iter().map(|numbers| numbers.len()).sum();
        held + self.edge.number_count() + self.node.number_count()
    }

    pub(crate) fn fit(&mut self, block: &Block, vertices: usize, arcs: usize) {
        let latent = block.latent();
        self.nodes.resize(vertices * latent);
        self.edges.resize(arcs * latent);
        self.incoming.resize(vertices * latent);
        self.edge.fit(&block.edge, arcs);
        self.node.fit(&block.node, vertices);
    }

    /// Everything, with the widths of its rows, as [`BlockRows`] has it.
    pub(crate) fn rows(&mut self, block: &Block) -> (Arrays<'_, T, 6>, Arrays<'_, T, 5>) {
        let latent = block.latent();
        let [n0, n1, n2, n3] = self.node.rows(&block.node);
        let [e0, e1, e2, e3] = self.edge.rows(&block.edge);
        let nodes = [
            (&mut *self.nodes, latent),
            (&mut *self.incoming, latent),
            n0,
            n1,
            n2,
            n3,
        ];
        (nodes, [(&mut *self.edges, latent), e0, e1, e2, e3])
    }
}

impl Block {
    pub(crate) fn new(
        (layout, size): (&mut LayoutBuilder, &mut ModuleSize),
        path: &str,
        latent: usize,
    ) -> Self {
        let mut mlp = |what: &str, inputs| {
            let path = format!("{path}.{what}");
            Mlp::normalised((&mut *layout, &mut *size), &path, inputs, latent)
        };
        let (edge, node) = (mlp("edge", 3 * latent), mlp("node", 2 * latent));
        Self {
            edge,
            node,
            ends: [
                size.forward(latent, 2 * latent),
                size.backward(2 * latent, latent),
            ],
            edges: Piece::new(size, &edge.first, (2 * latent, latent)),
            nodes: [0, latent].map(|first| Piece::new(size, &node.first, (first, latent))),
        }
    }

    fn latent(&self) -> usize {
        self.node.first.outputs
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for mlp in [&self.edge, &self.node] {
            mlp.pack(packer);
        }
        for piece in [&self.edges, &self.nodes[0], &self.nodes[1]] {
            piece.pack(packer);
        }
        let (latent, flat) = (self.latent(), packer.flat);
        let weight = &flat[self.edge.first.weight_range()];
        // Row i of A, then row i of B.
        let of_end = |end: usize, column: usize| {
            let (which, row) = (end / latent, end % latent);
            weight[row * 3 * latent + which * latent + column]
        };
        packer.forward(self.ends[0], |l, j| of_end(j, l));
        packer.backward(self.ends[1], of_end);
    }

    /// A v and B v + b of the split edge layer, `[vertices, 2 latent]`.
    pub(crate) fn products_per_vertex<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        nodes: &[T],
        at: &mut [T],
    ) {
        let (latent, bias) = (self.latent(), self.edge.first.bias_range());
        let term = Term {
            rows: Columns::all(nodes, latent),
            packed: self.ends[0].of(&weights.module.forward),
        };
        let finish = Finish::SecondHalfBias(&weights.flat[bias]);
        multiply(weights.instructions, &[term], 2 * latent, finish, at);
    }

    /// Updates the latent vectors of a leaf in place; `at` are the [`Self::products_per_vertex`] of all
    /// vertices.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, leaf): (&Connectivity, &Leaf),
        at: &[T],
        rows: BlockRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let latent = self.latent();
        let [nodes_before, incoming, node_record @ ..] = rows.node_record;
        let incoming = pick(incoming, &mut scratch.incoming, rows.nodes.len());
        incoming.fill(T::ZERO);
        let [edges_before, mut edge_record @ ..] = rows.edge_record;
        for chunk in chunks(leaf.arcs.clone()) {
            let local = chunk.start - leaf.arcs.start..chunk.end - leaf.arcs.start;
            let edges = &mut rows.edges[of_rows(&local, latent)];
            if let Some(before) = edges_before.get_mut(of_rows(&local, latent)) {
                before.copy_from_slice(edges);
            }
            let record = edge_record.each_mut().map(|record| &mut **record);
            let mut tile = scratch.tiles.tile(record, &local, latent);
            let finish = Finish::EndsRelu(Ends {
                at,
                senders: &graph.senders[chunk.clone()],
                receivers: &graph.receivers[chunk.clone()],
            });
            let terms = &[self.edges.times(weights, edges)];
            self.edge.first_layer(weights, terms, finish, &mut tile);
            let messages = Normalised::Messages {
                edges,
                incoming: &mut *incoming,
                receivers: Receivers {
                    of: &graph.receivers[chunk],
                    first: leaf.vertices.start,
                },
            };
            self.edge.forward(weights, tile, messages);
        }
        if !nodes_before.is_empty() {
            nodes_before.copy_from_slice(rows.nodes);
        }
        let count = 0..leaf.vertices.len();
        let mut tile = scratch.tiles.tile(node_record, &count, latent);
        let [of_node, of_incoming] = &self.nodes;
        let terms = &[
            of_node.times(weights, rows.nodes),
            of_incoming.times(weights, incoming),
        ];
        let finish = self.node.first_finish(weights);
        self.node.first_layer(weights, terms, finish, &mut tile);
        self.node
            .forward(weights, tile, Normalised::Add(rows.nodes));
    }

    /// Takes the gradients of a leaf's latent vectors after the block to those before it, but for what
    /// comes through A and B, and adds those of the weights.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, leaf): (&Connectivity, &Leaf),
        record: &BlockRecord<T>,
        rows: BlockGradients<'_, T>,
        group: (&mut GroupScratch<T>, &mut ModuleGradient<'_, T>),
    ) {
        let (scratch, gradient) = group;
        let latent = self.latent();
        self.nodes_backward(weights, leaf, record, rows.nodes, (scratch, gradient));
        rows.sums.fill(T::ZERO);
        for chunk in chunks(leaf.arcs.clone()) {
            let local = chunk.start - leaf.arcs.start..chunk.end - leaf.arcs.start;
            let (range, local) = (of_rows(&chunk, latent), of_rows(&local, latent));
            let edges = &mut rows.edges[local.clone()];
            let first = &mut rows.first[local];
            let receivers = Receivers {
                of: &graph.receivers[chunk.clone()],
                first: leaf.vertices.start,
            };
            let using = weights.instructions;
            let output = &mut scratch.output[..edges.len()];
            let gradients = (&*edges, &*scratch.incoming);
            gather_receivers(using, output, latent, gradients, receivers);
            let kept = record.edge.tile(&self.edge, &chunk);
            let buffers = (&mut scratch.hidden[..first.len()], &mut *first);
            self.edge.backward(weights, kept, output, buffers, gradient);
            let pair = (
                Columns::all(first, latent),
                Columns::all(&record.edges[range], latent),
            );
            self.edge
                .first_backward(weights, 2 * latent, pair, gradient);
            let term = self.edges.back(weights, first);
            multiply(using, &[term], latent, Finish::Add, edges);
            let place = (latent, 2 * latent, latent);
            sum_incoming(using, rows.sums, place, first, receivers);
        }
    }

    fn nodes_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        leaf: &Leaf,
        record: &BlockRecord<T>,
        nodes: &mut [T],
        (scratch, gradient): (&mut GroupScratch<T>, &mut ModuleGradient<'_, T>),
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let range = of_rows(&leaf.vertices, latent);
        let output = &mut scratch.output[..range.len()];
        output.copy_from_slice(nodes);
        let kept = record.node.tile(&self.node, &leaf.vertices);
        let first = &mut scratch.first[..range.len()];
        let buffers = (&mut scratch.hidden[..range.len()], &mut *first);
        self.node.backward(weights, kept, output, buffers, gradient);
        let inputs = [
            &record.nodes[range.clone()],
            &record.incoming[range.clone()],
        ];
        for (number, input) in inputs.into_iter().enumerate() {
            let pair = (Columns::all(first, latent), Columns::all(input, latent));
            self.node
                .first_backward(weights, number * latent, pair, gradient);
        }
        let [of_node, of_incoming] = self.nodes.each_ref().map(|p| p.back(weights, first));
        multiply(using, &[of_node], latent, Finish::Add, nodes);
        let incoming = &mut scratch.incoming[..range.len()];
        multiply(using, &[of_incoming], latent, Finish::Set, incoming);
    }

    /// What comes through A and B: after [`Self::backward`] of all leaves, of which `first` is.
    pub(crate) fn ends_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, leaf): (&Connectivity, &Leaf),
        (record, first): (&BlockRecord<T>, &[T]),
        [nodes, sums]: [&mut [T]; 2],
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let first_arc = &graph.first_arc[leaf.vertices.start..=leaf.vertices.end];
        let arcs = (first_arc, &*graph.twins);
        sum_outgoing(using, sums, (latent, 2 * latent), first, arcs);
        let all = Columns::all(&*sums, 2 * latent);
        let before = &record.nodes[of_rows(&leaf.vertices, latent)];
        for column in [0, latent] {
            let pair = (all.part(column, latent), Columns::all(before, latent));
            self.edge.first_backward(weights, column, pair, gradient);
        }
        let term = Term {
            rows: all,
            packed: self.ends[1].of(&weights.module.backward),
        };
        multiply(using, &[term], latent, Finish::Add, nodes);
    }
}
