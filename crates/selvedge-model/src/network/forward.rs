//! The forward pass: the partitions are shared among threads once for the encoders and once for
//! each block. The last block also decodes.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Rows, each_with_rows};
use crate::kernels::dropout::RowMasks;
use crate::kernels::real::Real;
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER, Network};
use crate::network::kept::Part;
use crate::network::layers::encoder::EncoderInput;
use crate::network::packed::PackedWeights;
use crate::network::passes::{Input, Pass};
use crate::network::workspace::{Workspace, with_scratch};
use crate::spec::OUTPUTS;

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
        self.encode(weights, input, workspace);
        for number in 0..self.blocks.len() {
            self.run_block(weights, graph, number, workspace);
        }
    }

    /// Panics where the input is not a window of the spec on the graph.
    pub(super) fn check_input<T>(&self, graph: &Connectivity, input: Input<'_, T>) {
        let (rows, frames) = (
            [graph.vertex_count(), graph.arc_count()],
            self.spec.window(),
        );
        let widths = self.input_widths();
        let expected = [0, 1].map(|kind| frames * rows[kind] * widths[kind]);
        assert_eq!([input.nodes.len(), input.arcs.len()], expected, "input");
    }

    /// The inputs of the encoders of nodes and of arcs.
    pub(super) fn encoder_inputs<'a, T>(
        &self,
        input: Input<'a, T>,
        masks: &'a [RowMasks; 2],
    ) -> [EncoderInput<'a, T>; 2] {
        [0, 1].map(|kind| EncoderInput {
            window: self.spec.window(),
            features: [input.nodes, input.arcs][kind],
            width: self.input_widths()[kind],
            dropout: masks[kind].active(),
        })
    }

    /// Features to latent vectors, and the endpoint products for the first block.
    fn encode<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        input: Input<'_, T>,
        w: &mut Workspace<T>,
    ) {
        let [nodes, arcs] = self.encoder_inputs(input, &w.dropout);
        let [of_nodes, of_arcs] = &self.encoders;
        let [products, _] = &mut w.endpoint_products;
        let products = Rows {
            values: products,
            width: 2 * self.spec.latent,
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
                self.blocks[0].endpoint_products(layer, &part.nodes, products);
            });
        });
    }

    /// One block, and the endpoint products for the next one, or the decoder after the last.
    fn run_block<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        w: &mut Workspace<T>,
    ) {
        let [even, odd] = &mut w.endpoint_products;
        let (products, next_products) = match number.is_multiple_of(2) {
            true => (&*even, odd),
            false => (&*odd, even),
        };
        let rows = [
            Rows {
                values: next_products,
                width: 2 * self.spec.latent,
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
                let block = &self.blocks[number];
                block.forward(layer, (graph, products), number, part, scratch);
                let layer = weights.layer(FIRST_BLOCK + number + 1);
                let Some(next) = self.blocks.get(number + 1) else {
                    let kept = (part.decoder.as_mut(), &mut scratch.tiles);
                    return self.decoder.forward(layer, &part.nodes, kept, output);
                };
                next.endpoint_products(layer, &part.nodes, next_products);
            });
        });
    }
}
