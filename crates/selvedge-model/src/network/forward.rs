//! The forward pass: the partitions are shared among threads once for the encoders and once for
//! each block. The last block also decodes.

use crate::graph::partition::{Rows, each_with_rows};
use crate::kernels::dropout::RowMasks;
use crate::kernels::real::Real;
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER};
use crate::network::kept::Part;
use crate::network::layers::encoder::EncoderInput;
use crate::network::passes::{Pass, Passage};
use crate::network::workspace::{Workspace, with_scratch};
use crate::spec::OUTPUTS;

impl<T: Real> Passage<'_, T> {
    pub(super) fn forward(self, pass: Pass<'_>, workspace: &mut Workspace<T>) {
        let (network, weights) = (self.network, self.weights.flat.len());
        assert_eq!(weights, network.parameter_count(), "packed weights");
        self.check_input();
        workspace.fit(network, self.graph, pass);
        self.encode(workspace);
        for number in 0..network.blocks.len() {
            self.run_block(number, workspace);
        }
    }

    /// Panics where the input is not a window of the spec on the graph.
    pub(super) fn check_input(self) {
        let rows = [self.graph.vertex_count(), self.graph.arc_count()];
        let (frames, widths) = (self.network.spec.window(), self.network.input_widths());
        let expected = [0, 1].map(|kind| frames * rows[kind] * widths[kind]);
        let found = [self.input.nodes.len(), self.input.arcs.len()];
        assert_eq!(found, expected, "input");
    }

    /// The inputs of the encoders of nodes and of arcs.
    pub(super) fn encoder_inputs<'a>(
        &'a self,
        masks: &'a [RowMasks; 2],
    ) -> [EncoderInput<'a, T>; 2] {
        [0, 1].map(|kind| EncoderInput {
            window: self.network.spec.window(),
            features: [self.input.nodes, self.input.arcs][kind],
            width: self.network.input_widths()[kind],
            dropout: masks[kind].active(),
        })
    }

    /// Features to latent vectors, and the endpoint products for the first block.
    fn encode(self, w: &mut Workspace<T>) {
        let (network, weights) = (self.network, self.weights);
        let [nodes, arcs] = self.encoder_inputs(&w.dropout);
        let [of_nodes, of_arcs] = &network.encoders;
        let [products, _] = &mut w.endpoint_products;
        let products = Rows {
            values: products,
            width: 2 * network.spec.latent,
        };
        let (scratch, stop) = (&w.scratch, &w.stop);
        let vertices = |part: &Part<T>| part.rows.vertices.len();
        each_with_rows(&mut w.parts, [products], &vertices, &|part, [products]| {
            if stop.is_wanted() {
                return;
            }
            with_scratch(scratch, |scratch| {
                let (layer, rows) = (weights.layer(NODE_ENCODER), &part.rows);
                let [kept_nodes, kept_arcs] = &mut part.encoders;
                let to = (&mut *part.nodes, &mut **kept_nodes);
                of_nodes.forward(layer, nodes, &rows.vertices, to, scratch);
                let layer = weights.layer(ARC_ENCODER);
                let to = (&mut *part.arcs, &mut **kept_arcs);
                of_arcs.forward(layer, arcs, &rows.arcs, to, scratch);
                let layer = weights.layer(FIRST_BLOCK);
                network.blocks[0].endpoint_products(layer, &part.nodes, products);
            });
        });
    }

    /// One block, and the endpoint products for the next one, or the decoder after the last.
    fn run_block(self, number: usize, w: &mut Workspace<T>) {
        let (network, weights) = (self.network, self.weights);
        let [even, odd] = &mut w.endpoint_products;
        let (products, next_products) =
            if number.is_multiple_of(2) { (&*even, odd) } else { (&*odd, even) };
        let rows = [
            Rows {
                values: next_products,
                width: 2 * network.spec.latent,
            },
            Rows {
                values: &mut w.output,
                width: OUTPUTS,
            },
        ];
        let (scratch, stop) = (&w.scratch, &w.stop);
        let vertices = |part: &Part<T>| part.rows.vertices.len();
        each_with_rows(&mut w.parts, rows, &vertices, &|part, rows| {
            let [next_products, output] = rows;
            if stop.is_wanted() {
                return;
            }
            with_scratch(scratch, |scratch| {
                let layer = weights.layer(FIRST_BLOCK + number);
                let block = &network.blocks[number];
                block.forward(layer, (self.graph, products), number, part, scratch);
                let layer = weights.layer(FIRST_BLOCK + number + 1);
                let Some(next) = network.blocks.get(number + 1) else {
                    let kept = (part.decoder.as_mut(), &mut scratch.tiles);
                    return network
                        .decoder
                        .forward_whole(layer, &part.nodes, kept, output);
                };
                next.endpoint_products(layer, &part.nodes, next_products);
            });
        });
    }
}
