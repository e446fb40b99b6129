//! The backward pass. Each group of partitions sums the gradients of a module's weights by itself,
//! and these sums are added group after group, so that no number of threads changes any of them.

use rayon::prelude::*;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Partition, counted_from};
use crate::graph::share::{Rows, Share, SplitRows};
use crate::kernels::gemm::{Columns, Epilogue, multiply};
use crate::kernels::real::Real;
use crate::network::arguments::{Gradients, Input};
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER, Network};
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::workspace::{Group, Workspace};
use crate::spec::OUTPUTS;

impl Network {
    pub(super) fn run_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        mut gradients: Gradients<'_, T>,
        w: &mut Workspace<T>,
    ) {
        let kept = std::mem::take(&mut w.kept);
        assert!(kept, "a forward pass to learn from comes first");
        let purpose = weights.purpose;
        assert_eq!(purpose, Purpose::Training, "purpose of the packed weights");
        assert_eq!(gradients.output.len(), graph.vertex_count() * OUTPUTS);
        assert_eq!(gradients.weights.len(), self.parameter_count());
        w.fit_groups(self, graph.partitions.len());
        self.decode_backward(weights, graph, &mut gradients, w);
        w.arcs.fill(T::ZERO);
        for number in (0..self.blocks.len()).rev() {
            if w.stop.is_wanted() {
                return;
            }
            self.block_backward(weights, graph, number, gradients.weights, w);
        }
        self.encode_backward(weights, graph, input, gradients, w);
    }

    /// Leaves the gradient of the latent nodes before the decoder in their place.
    fn decode_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        gradients: &mut Gradients<'_, T>,
        w: &mut Workspace<T>,
    ) {
        let (latent, module) = (self.spec.latent, FIRST_BLOCK + self.blocks.len());
        let (layer, range) = (weights.layer(module), self.weights_of(module, module));
        let share = Share {
            vertices: Rows::new(&mut w.nodes, latent),
            arcs: (),
        };
        let (saved, of_output) = (&w.decoder, gradients.output);
        share.among(
            &graph.partitions,
            &mut w.groups,
            &|partitions, share, group| {
                let first = partitions[0].vertices.start;
                let mut all = share.vertices;
                let group = group.begin(&range);
                let (tiles, mut gradient) = (&mut group.scratch.tiles, group.gradient);
                for Partition { vertices, .. } in partitions {
                    let nodes = all.part(&counted_from(vertices, first)).values;
                    let [output, hidden, by_sums, _] = &mut *tiles;
                    let output = &mut output[..vertices.len() * OUTPUTS];
                    output.copy_from_slice(
                        &of_output[vertices.start * OUTPUTS..vertices.end * OUTPUTS],
                    );
                    let [hidden, by_sums] = [hidden, by_sums].map(|tile| &mut tile[..nodes.len()]);
                    let (kept, through) = (saved.at(vertices), [output, hidden, &mut *by_sums]);
                    self.decoder.backward(layer, kept, through, &mut gradient);
                    let [left, right] = [&*by_sums, &*nodes].map(|rows| Columns::all(rows, latent));
                    self.decoder
                        .first_backward(layer, 0, left, right, &mut gradient);
                    let terms = &[self.decoder_first.back(layer, by_sums)];
                    multiply(layer.instructions, terms, latent, Epilogue::Set, nodes);
                }
            },
        );
        add_groups(&w.groups, &mut gradients.weights[range]);
    }

    /// Takes the gradients of the latent vectors from after a block to before it: through the
    /// updates of arcs and nodes first, then through the endpoint products, which need the arcs of
    /// all partitions.
    fn block_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        gradient: &mut [T],
        w: &mut Workspace<T>,
    ) {
        let (latent, module) = (self.spec.latent, FIRST_BLOCK + number);
        let (layer, range) = (weights.layer(module), self.weights_of(module, module));
        let (block, saved, stop) = (&self.blocks[number], &w.blocks[number], &w.stop);
        w.by_sums.resize(w.arcs.len());
        let [sums, _] = &mut w.endpoint_products;
        let share = Share {
            vertices: (Rows::new(&mut w.nodes, latent), Rows::new(sums, 2 * latent)),
            arcs: (
                Rows::new(&mut w.arcs, latent),
                Rows::new(&mut w.by_sums, latent),
            ),
        };
        share.among(
            &graph.partitions,
            &mut w.groups,
            &|partitions, mut share, group| {
                let start = &partitions[0];
                let mut group = group.begin(&range);
                for partition in partitions {
                    if stop.is_wanted() {
                        return;
                    }
                    let vertices = counted_from(&partition.vertices, start.vertices.start);
                    let arcs = counted_from(&partition.arcs, start.arcs.start);
                    let (nodes, arcs) = (share.vertices.part(&vertices), share.arcs.part(&arcs));
                    let kept = (graph, partition, saved);
                    block.backward(layer, kept, nodes, arcs, &mut group);
                }
            },
        );
        let [sums, _] = &mut w.endpoint_products;
        let share = Share {
            vertices: (Rows::new(&mut w.nodes, latent), Rows::new(sums, 2 * latent)),
            arcs: (),
        };
        let by_sums = &*w.by_sums;
        share.among(
            &graph.partitions,
            &mut w.groups,
            &|partitions, mut share, group| {
                let start = partitions[0].vertices.start;
                let mut group = group.resume(&range);
                for partition in partitions {
                    let nodes = share
                        .vertices
                        .part(&counted_from(&partition.vertices, start));
                    let kept = (graph, partition, saved);
                    block.endpoints_backward(layer, kept, by_sums, nodes, &mut group);
                }
            },
        );
        add_groups(&w.groups, &mut gradient[range]);
    }

    /// The gradients of both encoders' weights, and of the input where wanted.
    fn encode_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        gradients: Gradients<'_, T>,
        w: &mut Workspace<T>,
    ) {
        self.check_input(graph, input);
        let (spec, latent, frames) = (&self.spec, self.spec.latent, self.spec.window());
        let [nodes, arcs] = self.encoder_inputs(input, &w.dropout);
        let [node_width, arc_width] = [spec.node_width(), spec.edge_width()].map(|k| frames * k);
        let (vertices, arc_count) = (graph.vertex_count(), graph.arc_count());
        let wanted = usize::from(gradients.input.is_some());
        let [to_nodes, to_arcs] = &mut w.input_gradient;
        to_nodes.resize(wanted * vertices * node_width);
        to_arcs.resize(wanted * arc_count * arc_width);
        let share = Share {
            vertices: (
                Rows::new(&mut w.nodes, latent),
                Rows::new(to_nodes, node_width),
            ),
            arcs: (
                Rows::new(&mut w.arcs, latent),
                Rows::new(to_arcs, arc_width),
            ),
        };
        let (of_nodes, of_arcs) = ((nodes, &w.node_encoder), (arcs, &w.arc_encoder));
        let range = self.weights_of(NODE_ENCODER, ARC_ENCODER);
        share.among(
            &graph.partitions,
            &mut w.groups,
            &|partitions, mut share, group| {
                let start = &partitions[0];
                let mut group = group.begin(&range);
                for Partition { vertices, arcs } in partitions {
                    let layer = weights.layer(NODE_ENCODER);
                    let rows = share
                        .vertices
                        .part(&counted_from(vertices, start.vertices.start));
                    self.node_encoder
                        .backward(layer, of_nodes, vertices, rows, &mut group);
                    let layer = weights.layer(ARC_ENCODER);
                    let rows = share.arcs.part(&counted_from(arcs, start.arcs.start));
                    self.arc_encoder
                        .backward(layer, of_arcs, arcs, rows, &mut group);
                }
            },
        );
        add_groups(&w.groups, &mut gradients.weights[range]);
        if let Some(to) = gradients.input {
            frame_by_frame(to_nodes, spec.node_width(), frames, to.nodes);
            frame_by_frame(to_arcs, spec.edge_width(), frames, to.arcs);
        }
    }
}

/// `[rows, window, width]` to `[window, rows, width]`.
fn frame_by_frame<T: Copy>(from: &[T], width: usize, window: usize, to: &mut [T]) {
    if from.is_empty() {
        return;
    }
    let rows = from.len() / (width * window);
    for (row, frames) in from.chunks_exact(width * window).enumerate() {
        for (frame, values) in frames.chunks_exact(width).enumerate() {
            to[(frame * rows + row) * width..][..width].copy_from_slice(values);
        }
    }
}

/// Adds the groups' gradients in their order.
fn add_groups<T: Real>(groups: &[Group<T>], gradient: &mut [T]) {
    const PART: usize = 8 * 1024;
    let parts = gradient.par_chunks_mut(PART).enumerate();
    parts.for_each(|(number, sum)| {
        for group in groups {
            let part = &group.gradient[number * PART..][..sum.len()];
            for (x, &y) in sum.iter_mut().zip(part) {
                *x += y;
            }
        }
    });
}
