//! The forward pass: the partitions are shared among threads once for the encoders and once for
//! each block. The last block also decodes.

use crate::graph::connectivity::Connectivity;
use crate::graph::share::{Rows, Share};
use crate::kernels::aligned::Aligned;
use crate::kernels::dropout::RowMasks;
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::network::arguments::{Input, Pass};
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER, Network};
use crate::network::layers::block::BlockSaved;
use crate::network::layers::encoder::EncoderInput;
use crate::network::layers::mlp::{ACTIVATIONS, tile};
use crate::network::layers::scratch::Scratch;
use crate::network::packed::PackedWeights;
use crate::network::workspace::Workspace;
use crate::spec::OUTPUTS;

/// The output `[vertices, 3]` and the activations of the decoder.
type Decoded<'a, T> = (Rows<'a, T>, [Rows<'a, T>; ACTIVATIONS]);

impl Network {
    pub(super) fn run_forward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        pass: Pass<'_>,
        workspace: &mut Workspace<T>,
    ) {
        assert_eq!(weights.flat.len(), self.parameter_count(), "packed weights");
        self.check_input(graph, input);
        workspace.fit(self, graph, pass);
        self.encode(weights, graph, input, workspace);
        for number in 0..self.blocks.len() {
            self.run_block(weights, graph, number, workspace);
        }
    }

    /// Panics where the input is not a window of the spec on the graph.
    pub(super) fn check_input<T>(&self, graph: &Connectivity, input: Input<'_, T>) {
        let (spec, frames) = (&self.spec, self.spec.window());
        let expected = [
            frames * graph.vertex_count() * spec.node_width(),
            frames * graph.arc_count() * spec.edge_width(),
        ];
        assert_eq!([input.nodes.len(), input.arcs.len()], expected, "input");
    }

    /// The inputs of the encoders of nodes and of arcs.
    pub(super) fn encoder_inputs<'a, T>(
        &self,
        input: Input<'a, T>,
        masks: &'a [RowMasks; 2],
    ) -> [EncoderInput<'a, T>; 2] {
        let [of_nodes, of_arcs] = masks;
        let window = self.spec.window();
        let nodes = EncoderInput {
            window,
            features: input.nodes,
            width: self.spec.node_width(),
            dropout: of_nodes.active(),
        };
        let arcs = EncoderInput {
            window,
            features: input.arcs,
            width: self.spec.edge_width(),
            dropout: of_arcs.active(),
        };
        [nodes, arcs]
    }

    /// Features to latent vectors, and the endpoint products for the first block.
    fn encode<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        w: &mut Workspace<T>,
    ) {
        let latent = self.spec.latent;
        let [nodes, arcs] = self.encoder_inputs(input, &w.dropout);
        let [products, _] = &mut w.endpoint_products;
        let share = Share {
            vertices: (
                (Rows::new(&mut w.nodes, latent), w.node_encoder.rows()),
                Rows::new(products, 2 * latent),
            ),
            arcs: (Rows::new(&mut w.arcs, latent), w.arc_encoder.rows()),
        };
        let (scratch, stop) = (&w.scratch, &w.stop);
        share.each(
            &graph.partitions,
            |partition, (mut encoded, mut products), mut of_arcs| {
                if stop.is_wanted() {
                    return;
                }
                Workspace::with_scratch(scratch, |scratch| {
                    let (layer, range) = (weights.layer(NODE_ENCODER), &partition.vertices);
                    self.node_encoder
                        .forward(layer, nodes, range, &mut encoded, scratch);
                    let (layer, range) = (weights.layer(ARC_ENCODER), &partition.arcs);
                    self.arc_encoder
                        .forward(layer, arcs, range, &mut of_arcs, scratch);
                    let layer = weights.layer(FIRST_BLOCK);
                    self.blocks[0].endpoint_products(layer, &encoded.0, &mut products);
                });
            },
        );
    }

    /// One block, and the endpoint products for the next one, or the decoder after the last.
    fn run_block<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        w: &mut Workspace<T>,
    ) {
        let (latent, block) = (self.spec.latent, &self.blocks[number]);
        let (products, next_products) = in_turn(&mut w.endpoint_products, number);
        let BlockSaved {
            nodes: of_nodes,
            arcs: of_arcs,
        } = &mut w.blocks[number];
        let share = Share {
            vertices: (
                Rows::new(&mut w.nodes, latent),
                of_nodes.rows(),
                Rows::new(next_products, 2 * latent),
                (Rows::new(&mut w.output, OUTPUTS), w.decoder.rows()),
            ),
            arcs: (Rows::new(&mut w.arcs, latent), of_arcs.rows()),
        };
        let (scratch, stop) = (&w.scratch, &w.stop);
        share.each(&graph.partitions, |partition, of_vertices, arcs| {
            if stop.is_wanted() {
                return;
            }
            let (mut nodes, kept, mut next_products, decoded) = of_vertices;
            let input = (graph, partition, products);
            Workspace::with_scratch(scratch, |scratch| {
                let layer = weights.layer(FIRST_BLOCK + number);
                block.forward(layer, input, (&mut nodes, kept), arcs, scratch);
                let Some(next) = self.blocks.get(number + 1) else {
                    return self.decode(weights, &nodes, decoded, scratch);
                };
                let layer = weights.layer(FIRST_BLOCK + number + 1);
                next.endpoint_products(layer, &nodes, &mut next_products);
            });
        });
    }

    /// Latent nodes of a partition to the output.
    fn decode<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        nodes: &[T],
        (output, activations): Decoded<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let layer = weights.layer(FIRST_BLOCK + self.blocks.len());
        let (mlp, count) = (&self.decoder, nodes.len() / self.spec.latent);
        let mut tile = tile(activations, &mut scratch.tiles, count);
        let terms = &[self.decoder_first.times(layer, nodes)];
        mlp.first_layer(layer, terms, mlp.first_epilogue(layer), &mut tile);
        mlp.forward(layer, tile, Normalised::Set(output.values));
    }
}

/// The endpoint products of block `number`, and the room for those of the next.
fn in_turn<T>(products: &mut [Aligned<T>; 2], number: usize) -> (&[T], &mut Aligned<T>) {
    let [even, odd] = products;
    if number.is_multiple_of(2) {
        (&*even, odd)
    } else {
        (&*odd, even)
    }
}
