//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added.
//!
//! The first arc layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. These **endpoint products** of all vertices
//! must be there before a block begins; then one thread takes a partition through all of it. The
//! tests compare the split update with the update on concatenated rows.

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
    ArcGradients, ArcRecordRows, ArcRows, NodeGradients, NodeRecordRows, NodeRows,
};
use crate::network::layers::mlp::{Mlp, MlpGradients, MlpRecord};
use crate::network::layers::scratch::{GroupWork, Scratch, pick};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
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
}

/// A partition after the forward pass of a block.
#[derive(Clone, Copy)]
pub(crate) struct BlockKept<'a, T> {
    pub(crate) graph: &'a Connectivity,
    pub(crate) partition: &'a Partition,
    pub(crate) record: &'a BlockRecord<T>,
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
        let count = nodes.len() / self.latent();
        let kept = record.mlp.part(&(0..count));
        let mut tile = scratch.tiles.tile(kept, count, self.latent());
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
        let nodes = &mut gradients.nodes;
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
        let term = self.of_node.back(weights, pre_activation);
        multiply(using, &[term], latent, Epilogue::Add, nodes);
        let term = self.of_incoming.back(weights, pre_activation);
        let incoming = &mut scratch.incoming[..range.len()];
        multiply(using, &[term], latent, Epilogue::Set, incoming);
    }

    /// The gradient of the nodes through A and B, after [`Self::backward`] of all partitions left
    /// the pre-activation gradients `[all arcs, latent]`.
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
    }
}
