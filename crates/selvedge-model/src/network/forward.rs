//! The forward pass: the partitions are shared among threads once for the encoders and once for
//! each block. The last block also decodes.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::Partition;
use crate::graph::share::{Rows, Share, split_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::dropout::RowMasks;
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::network::arguments::{Carried, Pass};
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER, Network};
use crate::network::layers::block::BlockInput;
use crate::network::layers::block_rows::{ArcRows, NodeRows};
use crate::network::layers::encoder::{EncoderInput, EncoderRecordRows, EncoderRows};
use crate::network::layers::mlp::MlpRows;
use crate::network::layers::scratch::Scratch;
use crate::network::packed::PackedWeights;
use crate::network::workspace::Workspace;

split_rows! {
    /// Rows of vertices that the encoders write.
    struct EncodedNodes<'a, T> {
        encoder: EncoderRows<'a, T>,
        /// Endpoint products for the first block, `[vertices, 2 latent]`.
        products: Rows<'a, T>,
    }
}

split_rows! {
    /// Rows of vertices that a block writes, and the products or the decoder after it.
    struct ProcessedNodes<'a, T> {
        block: NodeRows<'a, T>,
        /// Endpoint products for the next block, `[vertices, 2 latent]`.
        next: Rows<'a, T>,
        /// `[vertices, outputs]`, from the last block only.
        output: Rows<'a, T>,
        decoder: MlpRows<'a, T>,
    }
}

impl Network {
    pub(super) fn run_forward<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        carried: Carried<'_, T>,
        pass: Pass<'_>,
        workspace: &mut Workspace<T>,
    ) {
        assert_eq!(weights.flat.len(), self.parameter_count(), "packed weights");
        let state = carried.state;
        assert!(state.is_zero() || self.streams(), "a state to carry");
        let frames = self.frames(graph, carried);
        workspace.fit(self, graph, pass, frames);
        self.encode(weights, graph, carried, frames, workspace);
        if self.blocks.is_empty() {
            self.decode_all(weights, graph, workspace);
        }
        for number in 0..self.blocks.len() {
            self.run_block(weights, graph, number, workspace);
        }
    }

    /// Frames in the input.
    pub(super) fn frames<T>(&self, graph: &Connectivity, carried: Carried<'_, T>) -> usize {
        let (spec, input) = (&self.spec, carried.input);
        let frames = match carried.state.nodes[0].is_empty() {
            true => spec.window(),
            false => 1,
        };
        let expected = [
            frames * graph.vertex_count() * spec.node_width(),
            frames * graph.arc_count() * spec.edge_width(),
        ];
        assert_eq!([input.nodes.len(), input.arcs.len()], expected, "input");
        frames
    }

    /// The inputs of the encoders of nodes and of arcs.
    pub(super) fn encoder_inputs<'a, T>(
        &self,
        carried: Carried<'a, T>,
        frames: usize,
        masks: &'a [RowMasks; 2],
    ) -> [EncoderInput<'a, T>; 2] {
        let [of_nodes, of_arcs] = masks;
        let Carried { input, state } = carried;
        let nodes = EncoderInput {
            window: frames,
            features: input.nodes,
            width: self.spec.node_width(),
            dropout: of_nodes.active(),
            start: state.nodes.each_ref().map(|s| &**s),
        };
        let arcs = EncoderInput {
            window: frames,
            features: input.arcs,
            width: self.spec.edge_width(),
            dropout: of_arcs.active(),
            start: state.arcs.each_ref().map(|s| &**s),
        };
        [nodes, arcs]
    }

    /// Features to latent vectors, and the endpoint products for the first block.
    fn encode<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        carried: Carried<'_, T>,
        frames: usize,
        w: &mut Workspace<T>,
    ) {
        let latent = self.spec.latent;
        let [nodes, arcs] = self.encoder_inputs(carried, frames, &w.dropout);
        let (mut node_record, mut arc_record) = <(EncoderRecordRows<'_, T>, _)>::default();
        if w.kept {
            node_record = w.node_encoder.rows(&self.node_encoder);
            if let Some(encoder) = &self.arc_encoder {
                arc_record = w.arc_encoder.rows(encoder);
            }
        }
        let [first_products, _] = &mut w.endpoint_products;
        let share = Share {
            vertices: EncodedNodes {
                encoder: EncoderRows {
                    out: Rows::new(&mut w.nodes, latent),
                    end: w.end.nodes.each_mut().map(|s| Rows::new(s, latent)),
                    record: node_record,
                },
                products: Rows::new(first_products, 2 * latent),
            },
            arcs: EncoderRows {
                out: Rows::new(&mut w.arcs, latent),
                end: w.end.arcs.each_mut().map(|s| Rows::new(s, latent)),
                record: arc_record,
            },
        };
        let (scratch, stop) = (&w.scratch, &w.stop);
        let work = |partitions: &[Partition],
                    share: Share<EncodedNodes<'_, T>, EncoderRows<'_, T>>,
                    (): &mut ()| {
            let [partition] = partitions else { return };
            if stop.is_wanted() {
                return;
            }
            let (mut rows, mut arc_rows) = (share.vertices, share.arcs);
            Workspace::with_scratch(scratch, |scratch| {
                let (layer, range) = (weights.layer(NODE_ENCODER), partition.vertices.clone());
                self.node_encoder
                    .forward(layer, nodes, range, &mut rows.encoder, scratch);
                if let Some(encoder) = &self.arc_encoder {
                    let (layer, range) = (weights.layer(ARC_ENCODER), partition.arcs.clone());
                    encoder.forward(layer, arcs, range, &mut arc_rows, scratch);
                }
                if let Some(block) = self.blocks.first() {
                    let layer = weights.layer(FIRST_BLOCK);
                    block.endpoint_products(layer, &rows.encoder.out, &mut rows.products);
                }
            });
        };
        share.among(&graph.partitions, &mut one_each(graph), &work);
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
        let (mut node_record, mut arc_record) = Default::default();
        let mut decoder = MlpRows::default();
        if w.kept {
            (node_record, arc_record) = w.blocks[number].rows(block);
            decoder = w.decoder.rows(&self.decoder);
        }
        let (products, next_products) = in_turn(&mut w.endpoint_products, number);
        let share = Share {
            vertices: ProcessedNodes {
                block: NodeRows {
                    nodes: Rows::new(&mut w.nodes, latent),
                    record: node_record,
                },
                next: Rows::new(next_products, 2 * latent),
                output: Rows::new(&mut w.output, self.spec.outputs()),
                decoder,
            },
            arcs: ArcRows {
                arcs: Rows::new(&mut w.arcs, latent),
                record: arc_record,
            },
        };
        let (scratch, stop) = (&w.scratch, &w.stop);
        let work = |partitions: &[Partition],
                    share: Share<ProcessedNodes<'_, T>, ArcRows<'_, T>>,
                    (): &mut ()| {
            let [partition] = partitions else { return };
            if stop.is_wanted() {
                return;
            }
            let mut rows = share.vertices;
            let input = BlockInput {
                graph,
                partition,
                endpoint_products: products,
            };
            Workspace::with_scratch(scratch, |scratch| {
                let layer = weights.layer(FIRST_BLOCK + number);
                block.forward(layer, input, &mut rows.block, share.arcs, scratch);
                let Some(next) = self.blocks.get(number + 1) else {
                    return self.decode(weights, rows, scratch);
                };
                let layer = weights.layer(FIRST_BLOCK + number + 1);
                next.endpoint_products(layer, &rows.block.nodes, &mut rows.next);
            });
        };
        share.among(&graph.partitions, &mut one_each(graph), &work);
    }

    /// Latent nodes to the output, where there is no block that does so at its end.
    fn decode_all<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        w: &mut Workspace<T>,
    ) {
        let mut decoder = MlpRows::default();
        if w.kept {
            decoder = w.decoder.rows(&self.decoder);
        }
        let share = Share {
            vertices: ProcessedNodes {
                block: NodeRows {
                    nodes: Rows::new(&mut w.nodes, self.spec.latent),
                    record: Default::default(),
                },
                next: Rows::default(),
                output: Rows::new(&mut w.output, self.spec.outputs()),
                decoder,
            },
            arcs: (),
        };
        let scratch = &w.scratch;
        let work = |_: &[Partition], share: Share<ProcessedNodes<'_, T>, ()>, (): &mut ()| {
            Workspace::with_scratch(scratch, |scratch| {
                self.decode(weights, share.vertices, scratch);
            });
        };
        share.among(&graph.partitions, &mut one_each(graph), &work);
    }

    /// Latent nodes of a partition to accelerations.
    fn decode<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        rows: ProcessedNodes<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let layer = weights.layer(FIRST_BLOCK + self.blocks.len());
        let (mlp, latent, nodes) = (&self.decoder, self.spec.latent, rows.block.nodes);
        let count = nodes.len() / latent;
        let mut tile = scratch.tiles.tile(rows.decoder, count, latent);
        let terms = &[self.decoder_first.times(layer, &nodes)];
        mlp.first_layer(layer, terms, mlp.first_epilogue(layer), &mut tile);
        mlp.forward(layer, tile, Normalised::Set(rows.output.values));
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

/// A group for each partition, with no state: of no size, so that nothing is allocated.
fn one_each(graph: &Connectivity) -> Vec<()> {
    vec![(); graph.partitions.len()]
}
