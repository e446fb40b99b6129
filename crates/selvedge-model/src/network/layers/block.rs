//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added.
//!
//! The first arc layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. These **endpoint products** of all vertices
//! must be there before a block begins; then one thread takes a partition through all of it. The
//! tests compare the split update with the update on concatenated rows.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{CHUNK, Partition, chunks};
use crate::kernels::gemm::{Columns, Epilogue, Slot, Term, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::kernels::rows::{Receivers, gather_receivers, sum_incoming, sum_outgoing};
use crate::network::kept::{BlockKept, Group, ModuleGradient, Part, Scratch, fit_chunks};
use crate::network::layers::mlp::Mlp;
use crate::network::packed::{LayerWeights, Packer};
use crate::network::parameters::Layout;

/// Places of the weights of a block.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Its part is e, multiplied by C.
    arc: Mlp,
    /// Its parts are v and Σ e'.
    node: Mlp,
    /// A and B of the first arc layer side by side.
    endpoints: Slot,
    /// A and B for the backward pass.
    endpoints_backward: Slot,
}

impl<T: Real> BlockKept<T> {
    /// Makes room for a partition.
    pub(crate) fn fit(&mut self, block: &Block, rows: &Partition) {
        let (latent, vertices) = (block.latent(), rows.vertices.len());
        self.nodes.resize(vertices * latent);
        self.incoming.resize(vertices * latent);
        block.node.fit(&mut self.node, vertices);
        fit_chunks(&mut self.arcs, &rows.arcs, |(before, activations), arcs| {
            before.resize(arcs * latent);
            block.arc.fit(activations, arcs);
        });
    }
}

impl Block {
    pub(crate) fn new(layout: &mut Layout, path: &str, latent: usize) -> Self {
        let [first, second, third] = [0, 1, 2].map(|k| k * latent..(k + 1) * latent);
        let arc = Mlp::normalised(layout, &format!("{path}.edge"), &[third], latent);
        let node = Mlp::normalised(layout, &format!("{path}.node"), &[first, second], latent);
        let size = &mut layout.size;
        Self {
            endpoints: size.forward(latent, 2 * latent),
            endpoints_backward: size.backward(2 * latent, latent),
            arc,
            node,
        }
    }

    fn latent(&self) -> usize {
        self.node.first.outputs
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for mlp in [&self.arc, &self.node] {
            mlp.pack(packer);
        }
        let (latent, flat) = (self.latent(), packer.flat);
        let weight = &flat[self.arc.first.weight.clone()];
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
        let latent = self.latent();
        let term = Term {
            rows: Columns::all(nodes, latent),
            packed: self.endpoints.of(&weights.module.forward),
        };
        let epilogue = Epilogue::SecondHalfBias(weights.at(&self.arc.first.bias));
        let using = weights.instructions;
        multiply(using, &[term], 2 * latent, epilogue, products);
    }

    /// Updates the latent vectors of a partition in place, in block `number`. There are endpoint
    /// products of all vertices, `[all vertices, 2 latent]`.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, endpoint_products): (&Connectivity, &[T]),
        number: usize,
        part: &mut Part<T>,
        scratch: &mut Scratch<T>,
    ) {
        let latent = self.latent();
        let (rows, nodes) = (&part.rows, &mut part.nodes);
        let (mut incoming, mut kept_node) = (&mut scratch.incoming[..nodes.len()], None);
        let mut kept_arcs = [].iter_mut();
        if let Some(kept) = part.blocks.get_mut(number) {
            kept.nodes.copy_from_slice(nodes);
            (incoming, kept_node) = (&mut kept.incoming, Some(&mut kept.node));
            kept_arcs = kept.arcs.iter_mut();
        }
        incoming.fill(T::ZERO);
        let arcs = part.arcs.chunks_mut(CHUNK * latent);
        for (chunk, arcs) in chunks(rows.arcs.clone()).zip(arcs) {
            let kept = kept_arcs.next().map(|(before, activations)| {
                before.copy_from_slice(arcs);
                activations
            });
            let tile = self.arc.tile(kept, &mut scratch.tiles, chunk.len());
            let receivers = &graph.receivers[chunk.clone()];
            let epilogue = Epilogue::EndpointsRelu {
                products: endpoint_products,
                senders: &graph.senders[chunk],
                receivers,
            };
            self.arc.first_layer(weights, [&*arcs], epilogue, tile[0]);
            let messages = Normalised::Messages {
                arcs,
                incoming: &mut *incoming,
                receivers: Receivers {
                    of: receivers,
                    first: rows.vertices.start,
                },
            };
            self.arc.forward(weights, tile, messages);
        }
        let count = rows.vertices.len();
        let tile = self.node.tile(kept_node, &mut scratch.tiles, count);
        let (parts, relu) = ([&**nodes, &*incoming], self.node.first_relu(weights));
        self.node.first_layer(weights, parts, relu, tile[0]);
        self.node.forward(weights, tile, Normalised::Add(nodes));
    }

    /// Takes the gradients of a partition's latent vectors from after block `number` to before it,
    /// except for the way through A and B ([`Self::endpoints_backward`]). Adds the gradients of the
    /// weights.
    ///
    /// Sets the gradients `by_sums` of the first arc layer's sums, `[arcs, latent]`, and in `sums`
    /// their sums over the arcs that arrive at a vertex, behind room for those over the arcs that
    /// leave it, `[vertices, 2 latent]`.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, number): (&Connectivity, usize),
        part: &mut Part<T>,
        (sums, by_sums): (&mut [T], &mut [T]),
        group: &mut Group<T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let (rows, kept) = (&part.rows, &part.blocks[number]);
        self.nodes_backward(weights, kept, &mut part.nodes, group);
        sums.fill(T::ZERO);
        let Group { scratch, gradient } = group;
        let arcs = part.arcs.chunks_mut(CHUNK * latent);
        let each = chunks(rows.arcs.clone()).zip(&kept.arcs);
        let each = each.zip(arcs.zip(by_sums.chunks_mut(CHUNK * latent)));
        for ((chunk, (before, activations)), (arcs, by_sums)) in each {
            let receivers = Receivers {
                of: &graph.receivers[chunk],
                first: rows.vertices.start,
            };
            let [output, hidden, ..] = &mut scratch.tiles;
            let (output, hidden) = (&mut output[..arcs.len()], &mut hidden[..arcs.len()]);
            gather_receivers(using, output, latent, arcs, &scratch.incoming, receivers);
            let (kept, through) = (([&**before], activations), [output, hidden, &mut *by_sums]);
            self.arc.backward(weights, kept, through, gradient);
            self.arc
                .input_backward(weights, 0, by_sums, Epilogue::Add, arcs);
            sum_incoming(using, sums, latent, by_sums, receivers);
        }
    }

    /// The gradient of the nodes through their own update; leaves that of the sums of messages in
    /// the scratch.
    fn nodes_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: &BlockKept<T>,
        nodes: &mut [T],
        Group { scratch, gradient }: &mut Group<T>,
    ) {
        let size = nodes.len();
        let [output, hidden, by_sums, _] = &mut scratch.tiles;
        let [output, hidden, by_sums] = [output, hidden, by_sums].map(|tile| &mut tile[..size]);
        output.copy_from_slice(nodes);
        let (parts, through) = (
            [&*kept.nodes, &kept.incoming],
            [output, hidden, &mut *by_sums],
        );
        self.node
            .backward(weights, (parts, &kept.node), through, gradient);
        self.node
            .input_backward(weights, 0, by_sums, Epilogue::Add, nodes);
        let by_incoming = &mut scratch.incoming[..size];
        self.node
            .input_backward(weights, 1, by_sums, Epilogue::Set, by_incoming);
    }

    /// The gradient of the nodes through A and B, after [`Self::backward`] of all partitions left
    /// the gradients `by_sums` of the first arc layer's sums, `[all arcs, latent]`.
    pub(crate) fn endpoints_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (graph, number, by_sums): (&Connectivity, usize, &[T]),
        part: &mut Part<T>,
        sums: &mut [T],
        gradient: &mut ModuleGradient<T>,
    ) {
        let (latent, using) = (self.latent(), weights.instructions);
        let vertices = &part.rows.vertices;
        let first_arc = &graph.first_arc[vertices.start..=vertices.end];
        sum_outgoing(using, sums, latent, by_sums, first_arc, &graph.reverse_arcs);
        let all = Columns::all(&*sums, 2 * latent);
        let before = Columns::all(&part.blocks[number].nodes, latent);
        for column in [0, latent] {
            let by_end = all.part(column, latent);
            gradient.add_matrix(using, &self.arc.first, column, by_end, before);
        }
        let term = Term {
            rows: all,
            packed: self.endpoints_backward.of(&weights.module.backward),
        };
        multiply(using, &[term], latent, Epilogue::Add, &mut part.nodes);
    }
}
