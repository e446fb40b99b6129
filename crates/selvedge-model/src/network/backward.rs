//! The backward pass. Each group of partitions sums the gradients of a module's weights by itself,
//! and these sums are added group after group, so that no number of threads changes any of them.

use std::ops::Range;

use rayon::prelude::*;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Partition, counted_from};
use crate::graph::share::{Rows, Share, SplitRows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Epilogue, multiply};
use crate::kernels::real::Real;
use crate::network::arguments::{Carried, Gradients};
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER, Network};
use crate::network::encoder_state::EncoderState;
use crate::network::layers::block::BlockKept;
use crate::network::layers::block_rows::{ArcGradients, NodeGradients};
use crate::network::layers::encoder::{
    EncoderGradients, EncoderInput, EncoderKept, EncoderLayers, EncoderRecord,
};
use crate::network::layers::gru::States;
use crate::network::layers::mlp::MlpGradients;
use crate::network::layers::scratch::GroupWork;
use crate::network::packed::{LayerWeights, PackedWeights, Purpose};
use crate::network::workspace::{Group, Workspace};

impl Network {
    pub(super) fn run_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        carried: Carried<'_, T>,
        mut gradients: Gradients<'_, T>,
        w: &mut Workspace<T>,
    ) {
        let kept = std::mem::take(&mut w.kept);
        assert!(kept, "a forward pass to learn from comes first");
        let purpose = weights.purpose;
        assert_eq!(purpose, Purpose::Training, "purpose of the packed weights");
        assert_eq!(
            gradients.output.len(),
            graph.vertex_count() * self.spec.outputs()
        );
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
        self.encode_backward(weights, graph, carried, gradients, w);
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
        let (record, of_output) = (&w.decoder, gradients.output);
        let outputs = self.spec.outputs();
        let work = |partitions: &[Partition],
                    share: Share<Rows<'_, T>, ()>,
                    group: &mut Group<T>| {
            let first = partitions[0].vertices.start;
            let mut all = share.vertices;
            let mut group = group.begin(&range);
            let (scratch, gradient) = (&mut *group.scratch, &mut group.gradient);
            for Partition { vertices, .. } in partitions {
                let nodes = all.part(&counted_from(vertices, first)).values;
                let output = &mut scratch.output[..vertices.len() * outputs];
                output
                    .copy_from_slice(&of_output[vertices.start * outputs..vertices.end * outputs]);
                let pre_activation = &mut scratch.pre_activation[..nodes.len()];
                let through = MlpGradients {
                    output,
                    hidden: &mut scratch.hidden[..nodes.len()],
                    pre_activation: &mut *pre_activation,
                };
                let kept = record.tile(&self.decoder, vertices);
                self.decoder.backward(layer, kept, through, gradient);
                let [left, right] =
                    [&*pre_activation, &*nodes].map(|rows| Columns::all(rows, latent));
                self.decoder.first_backward(layer, 0, left, right, gradient);
                let terms = &[self.decoder_first.back(layer, pre_activation)];
                multiply(layer.instructions, terms, latent, Epilogue::Set, nodes);
            }
        };
        share.among(&graph.partitions, &mut w.groups, &work);
        add_groups(&w.groups, &mut gradients.weights[range]);
    }

    /// Takes the gradients of the latent vectors from after a block to before it.
    fn block_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        gradient: &mut [T],
        w: &mut Workspace<T>,
    ) {
        let module = FIRST_BLOCK + number;
        self.updates_backward(weights, graph, number, w);
        self.endpoints_backward(weights, graph, number, w);
        add_groups(&w.groups, &mut gradient[self.weights_of(module, module)]);
    }

    /// Through the updates of arcs and nodes.
    fn updates_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        w: &mut Workspace<T>,
    ) {
        let (latent, module) = (self.spec.latent, FIRST_BLOCK + number);
        let (layer, range) = (weights.layer(module), self.weights_of(module, module));
        let (block, record, stop) = (&self.blocks[number], &w.blocks[number], &w.stop);
        w.pre_activation.resize(w.arcs.len());
        let share = Share {
            vertices: NodeGradients {
                nodes: Rows::new(&mut w.nodes, latent),
                sums: Rows::new(&mut w.endpoint_products[0], 2 * latent),
            },
            arcs: ArcGradients {
                arcs: Rows::new(&mut w.arcs, latent),
                pre_activation: Rows::new(&mut w.pre_activation, latent),
            },
        };
        let work = |partitions: &[Partition],
                    mut share: Share<NodeGradients<'_, T>, ArcGradients<'_, T>>,
                    group: &mut Group<T>| {
            let start = &partitions[0];
            let mut group = group.begin(&range);
            for partition in partitions {
                if stop.is_wanted() {
                    return;
                }
                let vertices = counted_from(&partition.vertices, start.vertices.start);
                let nodes = share.vertices.part(&vertices);
                let arcs = counted_from(&partition.arcs, start.arcs.start);
                let arcs = share.arcs.part(&arcs);
                let kept = BlockKept {
                    graph,
                    partition,
                    record,
                };
                block.backward(layer, kept, nodes, arcs, &mut group);
            }
        };
        share.among(&graph.partitions, &mut w.groups, &work);
    }

    /// Through the endpoint products, which need the arcs of all partitions.
    fn endpoints_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        w: &mut Workspace<T>,
    ) {
        let (latent, module) = (self.spec.latent, FIRST_BLOCK + number);
        let (layer, range) = (weights.layer(module), self.weights_of(module, module));
        let (block, record) = (&self.blocks[number], &w.blocks[number]);
        let share = Share {
            vertices: NodeGradients {
                nodes: Rows::new(&mut w.nodes, latent),
                sums: Rows::new(&mut w.endpoint_products[0], 2 * latent),
            },
            arcs: (),
        };
        let of_arcs = &*w.pre_activation;
        let work = |partitions: &[Partition],
                    mut share: Share<NodeGradients<'_, T>, ()>,
                    group: &mut Group<T>| {
            let start = partitions[0].vertices.start;
            let mut group = group.resume(&range);
            for partition in partitions {
                let vertices = counted_from(&partition.vertices, start);
                let nodes = share.vertices.part(&vertices);
                let kept = BlockKept {
                    graph,
                    partition,
                    record,
                };
                block.endpoints_backward(layer, kept, of_arcs, nodes, &mut group);
            }
        };
        share.among(&graph.partitions, &mut w.groups, &work);
    }

    /// The gradients of both encoders' weights, and of input and states where wanted.
    fn encode_backward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        carried: Carried<'_, T>,
        gradients: Gradients<'_, T>,
        w: &mut Workspace<T>,
    ) {
        let (spec, latent, frames) = (&self.spec, self.spec.latent, self.frames(graph, carried));
        let inputs = self.encoder_inputs(carried, frames, &w.dropout);
        let node_width = frames * spec.node_width();
        let arc_width = frames * spec.edge_width();
        let (vertices, arc_count) = (graph.vertex_count(), graph.arc_count());
        let wanted = usize::from(gradients.input.is_some());
        let [to_nodes, to_arcs] = &mut w.input_gradient;
        to_nodes.resize(wanted * vertices * node_width);
        to_arcs.resize(wanted * arc_count * arc_width);
        let mut nowhere = EncoderState::new();
        let start = match gradients.states.start {
            Some(start) => {
                start.fit(vertices, arc_count, latent);
                start
            }
            None => &mut nowhere,
        };
        let share = Share {
            vertices: both_ends(
                Rows::new(&mut w.nodes, latent),
                Rows::new(to_nodes, node_width),
                &mut start.nodes,
            ),
            arcs: both_ends(
                Rows::new(&mut w.arcs, latent),
                Rows::new(to_arcs, arc_width),
                &mut start.arcs,
            ),
        };
        let zero = EncoderState::new();
        let end = gradients.states.end.unwrap_or(&zero);
        let records = [&w.node_encoder, &w.arc_encoder];
        let (of_nodes, of_arcs) = self.encoders_backward(weights, inputs, records, end);
        let range = self.weights_of(NODE_ENCODER, ARC_ENCODER);
        let work = |partitions: &[Partition],
                    share: Share<EncoderGradients<'_, T>, EncoderGradients<'_, T>>,
                    group: &mut Group<T>| {
            let mut group = group.begin(&range);
            let ranges = partitions.iter().map(|partition| &partition.vertices);
            of_nodes.run(ranges, share.vertices, &mut group);
            if let Some(of_arcs) = &of_arcs {
                let ranges = partitions.iter().map(|partition| &partition.arcs);
                of_arcs.run(ranges, share.arcs, &mut group);
            }
        };
        share.among(&graph.partitions, &mut w.groups, &work);
        add_groups(&w.groups, &mut gradients.weights[range]);
        if let Some(to) = gradients.input {
            frame_by_frame(to_nodes, spec.node_width(), frames, to.nodes);
            frame_by_frame(to_arcs, spec.edge_width(), frames, to.arcs);
        }
    }

    /// The backward passes of the encoders of nodes and of arcs.
    fn encoders_backward<'a, T: Real>(
        &'a self,
        weights: &'a PackedWeights<T>,
        inputs: [EncoderInput<'a, T>; 2],
        records: [&'a EncoderRecord<T>; 2],
        end: &'a EncoderState<T>,
    ) -> (EncoderBackward<'a, T>, Option<EncoderBackward<'a, T>>) {
        let ([nodes, arcs], [node_record, arc_record]) = (inputs, records);
        let of_nodes = EncoderBackward {
            layers: &self.node_encoder,
            layer: weights.layer(NODE_ENCODER),
            input: nodes,
            record: node_record,
            end_gradient: &end.nodes,
        };
        let of_arcs = self.arc_encoder.as_ref().map(|layers| EncoderBackward {
            layers,
            layer: weights.layer(ARC_ENCODER),
            input: arcs,
            record: arc_record,
            end_gradient: &end.arcs,
        });
        (of_nodes, of_arcs)
    }
}

/// The gradients at both ends of an encoder.
fn both_ends<'a, T>(
    output: Rows<'a, T>,
    input: Rows<'a, T>,
    start: &'a mut States<Aligned<T>>,
) -> EncoderGradients<'a, T> {
    let latent = output.width();
    EncoderGradients {
        output,
        input,
        start: start.each_mut().map(|states| Rows::new(states, latent)),
    }
}

/// The backward pass of one encoder.
struct EncoderBackward<'a, T> {
    layers: &'a EncoderLayers,
    layer: LayerWeights<'a, T>,
    input: EncoderInput<'a, T>,
    record: &'a EncoderRecord<T>,
    end_gradient: &'a States<Aligned<T>>,
}

impl<T: Real> EncoderBackward<'_, T> {
    /// Takes back contiguous ranges of rows. Chunks are counted from the start of each range, as in
    /// the forward pass.
    fn run<'r>(
        &self,
        ranges: impl Iterator<Item = &'r Range<usize>>,
        mut gradients: EncoderGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let mut first = None;
        for range in ranges {
            let first = *first.get_or_insert(range.start);
            let kept = EncoderKept {
                rows: range.clone(),
                record: self.record,
                end_gradient: self.end_gradient.each_ref().map(|states| &**states),
            };
            let gradients = gradients.part(&counted_from(range, first));
            self.layers
                .backward(self.layer, self.input, kept, gradients, group);
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
