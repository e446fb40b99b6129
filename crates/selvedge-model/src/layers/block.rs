//! One message-passing block (Pfaff et al. 2021) `[eq:graph-block]`: e' = MLP([v_s, v_r, e]),
//! v' = MLP([v, Σ_{arcs into v} e']), then e ← e + e', v ← v + v'. The sum is of e' before the
//! residual is added.
//!
//! The first edge layer is split exactly: W [v_s, v_r, e] = A v_s + B v_r + C e, with A and B
//! applied once per vertex instead of once per arc. The tests hold the
//! update as it is written, on concatenated rows, against it.

use rayon::prelude::*;

use crate::connectivity::Connectivity;
use crate::kernels::{add, gather_add, scatter_add, sum_incoming, sum_outgoing};
use crate::layers::encoder::mlp_tiles;
use crate::layers::mlp::{Mlp, MlpRecord, MlpScratch};
use crate::layers::{TILE, resize, tiles};
use crate::parameters::LayoutBuilder;
use crate::product::Store;
use crate::real::Real;

/// Where the weights of a block lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    edge: Mlp,
    node: Mlp,
}

/// Activations of one block, kept for the backward pass.
#[derive(Default)]
pub(crate) struct BlockRecord<T> {
    /// Latent vertices before the block, `[vertices, latent]`.
    nodes: Vec<T>,
    /// Latent arcs before the block, `[arcs, latent]`.
    edges: Vec<T>,
    /// Sum of the messages that arrive, `[vertices, latent]`.
    incoming: Vec<T>,
    edge: MlpRecord<T>,
    node: MlpRecord<T>,
}

/// Buffers that all blocks share.
#[derive(Default)]
pub(crate) struct BlockScratch<T> {
    /// Products of the split first layer, then their gradients, `[vertices, latent]` each.
    at_sender: Vec<T>,
    at_receiver: Vec<T>,
    /// e' of all arcs, then the gradient of the edge layer's product, `[arcs, latent]`.
    messages: Vec<T>,
    /// Gradient of the sums of messages, `[vertices, latent]`.
    incoming: Vec<T>,
}

/// The latent vectors that a block updates, or their gradients.
pub(crate) struct Latents<'a, T> {
    /// `[vertices, latent]`.
    pub(crate) nodes: &'a mut [T],
    /// `[arcs, latent]`.
    pub(crate) edges: &'a mut [T],
}

impl<T: Real> BlockScratch<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let vertices = [&self.at_sender, &self.at_receiver, &self.incoming];
        let held: usize = vertices.iter().map(|numbers| numbers.len()).sum();
        held + self.messages.len()
    }

    fn fit(&mut self, vertices: usize, arcs: usize, latent: usize) {
        resize(&mut self.at_sender, vertices * latent);
        resize(&mut self.at_receiver, vertices * latent);
        resize(&mut self.incoming, vertices * latent);
        resize(&mut self.messages, arcs * latent);
    }
}

impl<T: Real> BlockRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let latents = [&self.nodes, &self.edges, &self.incoming];
        let held: usize = latents.iter().map(|numbers| numbers.len()).sum();
        held + self.edge.number_count() + self.node.number_count()
    }

    fn fit(&mut self, block: &Block, vertices: usize, arcs: usize) {
        let latent = block.node.first.outputs;
        resize(&mut self.nodes, vertices * latent);
        resize(&mut self.edges, arcs * latent);
        resize(&mut self.incoming, vertices * latent);
        self.edge.fit(&block.edge, arcs);
        self.node.fit(&block.node, vertices);
    }
}

impl Block {
    pub(crate) fn new(layout: &mut LayoutBuilder, path: &str, latent: usize) -> Self {
        Self {
            edge: Mlp::normalised(layout, &format!("{path}.edge"), 3 * latent, latent),
            node: Mlp::normalised(layout, &format!("{path}.node"), 2 * latent, latent),
        }
    }

    /// Updates the latent vectors in place.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: &[T],
        graph: &Connectivity,
        latents: &mut Latents<'_, T>,
        record: &mut BlockRecord<T>,
        scratch: &mut BlockScratch<T>,
    ) {
        let latent = self.node.first.outputs;
        let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
        record.fit(self, vertices, arcs);
        scratch.fit(vertices, arcs, latent);
        self.products_per_vertex(weights, latents.nodes, scratch);
        self.update_edges(weights, graph, latents.edges, record, scratch);
        sum_incoming(
            &mut record.incoming,
            latent,
            &scratch.messages,
            &graph.first_arc,
        );
        self.update_nodes(weights, latents.nodes, record, scratch);
    }

    /// A v and B v of the split edge layer.
    fn products_per_vertex<T: Real>(
        &self,
        weights: &[T],
        nodes: &[T],
        scratch: &mut BlockScratch<T>,
    ) {
        let latent = self.node.first.outputs;
        (
            nodes.par_chunks(TILE * latent),
            scratch.at_sender.par_chunks_mut(TILE * latent),
            scratch.at_receiver.par_chunks_mut(TILE * latent),
        )
            .into_par_iter()
            .for_each(|(nodes, at_sender, at_receiver)| {
                let edge = &self.edge;
                let nodes = (nodes, Store::Replace);
                edge.first_product(weights, (0, latent), nodes, at_sender);
                edge.first_product(weights, (latent, latent), nodes, at_receiver);
            });
    }

    fn update_edges<T: Real>(
        &self,
        weights: &[T],
        graph: &Connectivity,
        edges: &mut [T],
        record: &mut BlockRecord<T>,
        scratch: &mut BlockScratch<T>,
    ) {
        let latent = self.node.first.outputs;
        let (at_sender, at_receiver) = (&*scratch.at_sender, &*scratch.at_receiver);
        (
            mlp_tiles(&mut record.edge, latent),
            edges.par_chunks_mut(TILE * latent),
            record.edges.par_chunks_mut(TILE * latent),
            scratch.messages.par_chunks_mut(TILE * latent),
            graph.senders.par_chunks(TILE),
            graph.receivers.par_chunks(TILE),
        )
            .into_par_iter()
            .for_each(|(tile, edges, before, messages, senders, receivers)| {
                before.copy_from_slice(edges);
                let columns = (2 * latent, latent);
                self.edge
                    .first_product(weights, columns, (edges, Store::Replace), tile.hidden1);
                gather_add(
                    tile.hidden1,
                    latent,
                    (senders, receivers),
                    at_sender,
                    at_receiver,
                );
                self.edge.finish(weights, tile, messages);
                add(edges, messages);
            });
    }

    fn update_nodes<T: Real>(
        &self,
        weights: &[T],
        nodes: &mut [T],
        record: &mut BlockRecord<T>,
        scratch: &mut BlockScratch<T>,
    ) {
        let latent = self.node.first.outputs;
        (
            mlp_tiles(&mut record.node, latent),
            nodes.par_chunks_mut(TILE * latent),
            record.nodes.par_chunks_mut(TILE * latent),
            record.incoming.par_chunks(TILE * latent),
            scratch.incoming.par_chunks_mut(TILE * latent),
        )
            .into_par_iter()
            .for_each(|(tile, nodes, before, incoming, update)| {
                before.copy_from_slice(nodes);
                let node = &self.node;
                node.first_product(weights, (0, latent), (nodes, Store::Replace), tile.hidden1);
                let incoming = (incoming, Store::Add);
                node.first_product(weights, (latent, latent), incoming, tile.hidden1);
                node.finish(weights, tile, update);
                add(nodes, update);
            });
    }

    /// Takes the gradients of the latent vectors after the block to those before it, and adds
    /// those of the weights.
    pub(crate) fn backward<T: Real>(
        &self,
        (weights, gradient): (&[T], &mut [T]),
        graph: &Connectivity,
        gradients: &mut Latents<'_, T>,
        record: &mut BlockRecord<T>,
        scratch: &mut BlockScratch<T>,
    ) {
        let latent = self.node.first.outputs;
        scratch.fit(graph.vertex_count(), graph.arc_count(), latent);
        let mut mlp_scratch = MlpScratch::new(latent);
        let mut output = vec![T::ZERO; TILE * latent];
        for rows in tiles(graph.vertex_count()) {
            let range = rows.start * latent..rows.end * latent;
            let output = &mut output[..range.len()];
            output.copy_from_slice(&gradients.nodes[range.clone()]);
            let tile = record.node.tile(&self.node, &rows);
            self.node
                .finish_backward(weights, &tile, output, &mut mlp_scratch, gradient);
            let first = &mlp_scratch.first[..range.len()];
            let to_nodes = Some((&mut gradients.nodes[range.clone()], Store::Add));
            let pair = (first, &record.nodes[range.clone()]);
            self.node
                .first_backward(weights, (0, latent), pair, gradient, to_nodes);
            let to_incoming = Some((&mut scratch.incoming[range.clone()], Store::Replace));
            let pair = (first, &record.incoming[range]);
            self.node
                .first_backward(weights, (latent, latent), pair, gradient, to_incoming);
        }
        for rows in tiles(graph.arc_count()) {
            let range = rows.start * latent..rows.end * latent;
            let output = &mut output[..range.len()];
            output.copy_from_slice(&gradients.edges[range.clone()]);
            scatter_add(
                output,
                latent,
                &graph.receivers[rows.clone()],
                &scratch.incoming,
            );
            let tile = record.edge.tile(&self.edge, &rows);
            self.edge
                .finish_backward(weights, &tile, output, &mut mlp_scratch, gradient);
            let first = &mlp_scratch.first[..range.len()];
            scratch.messages[range.clone()].copy_from_slice(first);
            let to_edges = Some((&mut gradients.edges[range.clone()], Store::Add));
            let pair = (first, &record.edges[range]);
            self.edge
                .first_backward(weights, (2 * latent, latent), pair, gradient, to_edges);
        }
        self.split_backward((weights, gradient), graph, gradients.nodes, record, scratch);
    }

    /// The gradients of A and B, and through them those of the vertices.
    fn split_backward<T: Real>(
        &self,
        (weights, gradient): (&[T], &mut [T]),
        graph: &Connectivity,
        nodes: &mut [T],
        record: &BlockRecord<T>,
        scratch: &mut BlockScratch<T>,
    ) {
        let latent = self.node.first.outputs;
        let rows = &scratch.messages;
        sum_incoming(&mut scratch.at_receiver, latent, rows, &graph.first_arc);
        let (first_arc, twins) = (&graph.first_arc, &graph.twins);
        sum_outgoing(&mut scratch.at_sender, latent, rows, (first_arc, twins));
        for (column, sums) in [(0, &scratch.at_sender), (latent, &scratch.at_receiver)] {
            let to_nodes = Some((&mut *nodes, Store::Add));
            let pair = (&**sums, &*record.nodes);
            self.edge
                .first_backward(weights, (column, latent), pair, gradient, to_nodes);
        }
    }
}
