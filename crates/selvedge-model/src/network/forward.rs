//! The forward pass: one sharing of the leaves among threads for the encoders, and one for each block,
//! the last of which also decodes.

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Leaf, Rows};
use crate::kernels::real::Real;
use crate::kernels::{Normalised, RowMasks};
use crate::network::layers::block::BlockRows;
use crate::network::layers::encoder::{EncoderInput, EncoderRows};
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::workspace::{EncoderState, Workspace};

use super::passes::ForwardPass;
use super::{EDGE_ENCODER, FIRST_BLOCK, Input, NODE_ENCODER, Network, OUTPUTS, Pass};

/// Arrays of rows that are not wanted.
fn none<'a, T, const N: usize>() -> [(&'a mut [T], usize); N] {
    std::array::from_fn(|_| Default::default())
}

impl Network {
    /// Normalised accelerations `[vertices, 3]` for normalised features.
    ///
    /// Packs the weights first; [`Self::forward_packed`] spares that where they stay the same.
    ///
    /// # Panics
    /// When the lengths of `weights` or `input` are not those of the spec and the graph.
    pub fn forward<'w, T: Real>(
        &self,
        weights: &[T],
        graph: &Connectivity,
        input: Input<'_, T>,
        pass: Pass<'_>,
        workspace: &'w mut Workspace<T>,
    ) -> &'w [T] {
        let purpose = match pass {
            Pass::Inference => Purpose::Inference,
            Pass::Training(_) => Purpose::Training,
        };
        let fits = |packed: &PackedWeights<T>| {
            let lengths = packed.modules.iter().map(|m| m.forward.len());
            packed.flat.len() == self.parameter_count()
                && packed.purpose == purpose
                && lengths.eq(self.module_sizes().iter().map(|size| size.forward))
        };
        let packed = match workspace.packed.take().filter(fits) {
            Some(mut packed) => {
                packed.update(self, weights);
                packed
            }
            None => PackedWeights::new(self, weights, purpose, workspace.instructions),
        };
        self.forward_packed(&packed, graph, input, pass, workspace);
        workspace.packed = Some(packed);
        &workspace.output
    }

    /// The same for weights that are packed; `forward` packs them anew every time.
    ///
    /// # Panics
    /// When the lengths of `input` are not those of the spec and the graph.
    pub fn forward_packed<'w, T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        pass: Pass<'_>,
        workspace: &'w mut Workspace<T>,
    ) -> &'w [T] {
        self.forward_carried(
            weights,
            graph,
            (input, &EncoderState::new()),
            pass,
            workspace,
        )
    }

    /// The same for a network that streams, from the encoders' state of the frame before; after it
    /// stands in [`Workspace::end_state`]. The input of a state that is not zero is one frame.
    ///
    /// # Panics
    /// When the lengths of `input` or of the state are not those of the spec and the graph.
    pub fn forward_carried<'w, T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        (input, state): (Input<'_, T>, &EncoderState<T>),
        pass: Pass<'_>,
        workspace: &'w mut Workspace<T>,
    ) -> &'w [T] {
        let arguments = ForwardPass {
            weights,
            graph,
            given: (input, state),
            pass,
            workspace: &mut *workspace,
        };
        T::forward(self, arguments);
        &workspace.output
    }

    pub(super) fn run_forward<T: Real>(&self, arguments: ForwardPass<'_, T>) {
        let ForwardPass {
            weights,
            graph,
            given,
            pass,
            workspace,
        } = arguments;
        let (input, state) = given;
        assert_eq!(weights.flat.len(), self.parameter_count(), "packed weights");
        assert!(state.is_zero() || self.streams(), "a state to carry");
        let windows = self.windows(graph, input, state);
        workspace.fit(self, graph, pass, windows);
        self.encode(weights, graph, given, windows, workspace);
        for number in 0..self.blocks.len() {
            self.run_block(weights, graph, number, workspace);
        }
    }

    /// Frames of vertices and of arcs in the input.
    pub(super) fn windows<T>(
        &self,
        graph: &Connectivity,
        input: Input<'_, T>,
        state: &EncoderState<T>,
    ) -> [usize; 2] {
        let (spec, [vertices, arcs]) = (&self.spec, [graph.vertex_count(), graph.arc_count()]);
        let windows = if state.nodes[0].is_empty() {
            [spec.node_window(), spec.edge_window()]
        } else {
            [1, 1]
        };
        let expected = [
            windows[0] * vertices * spec.node_width(),
            windows[1] * arcs * spec.edge_width(),
        ];
        assert_eq!([input.nodes.len(), input.edges.len()], expected, "input");
        windows
    }

    /// What goes into the encoders of vertices and of arcs.
    pub(super) fn encoder_inputs<'a, T>(
        &self,
        (input, state): (Input<'a, T>, &'a EncoderState<T>),
        windows: [usize; 2],
        [of_vertices, of_arcs]: &'a [RowMasks; 2],
    ) -> [EncoderInput<'a, T>; 2] {
        let nodes = EncoderInput {
            window: windows[0],
            features: input.nodes,
            width: self.spec.node_width(),
            dropout: of_vertices.active(),
            start: state.nodes.each_ref().map(|s| &**s),
        };
        let edges = EncoderInput {
            window: windows[1],
            features: input.edges,
            width: self.spec.edge_width(),
            dropout: of_arcs.active(),
            start: state.edges.each_ref().map(|s| &**s),
        };
        [nodes, edges]
    }

    /// Features to latent vectors, and the products of the vertices for the first block.
    fn encode<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        given: (Input<'_, T>, &EncoderState<T>),
        windows: [usize; 2],
        w: &mut Workspace<T>,
    ) {
        let latent = self.spec.latent;
        let [nodes, edges] = self.encoder_inputs(given, windows, &w.dropout);
        let (node_record, edge_record) = if w.kept {
            let nodes = w.node_encoder.rows(&self.node_encoder);
            (nodes, w.edge_encoder.rows(&self.edge_encoder))
        } else {
            (none(), none())
        };
        let [n0, n1, n2, n3, n4, n5, n6] = node_record;
        let [e0, e1, e2, e3, e4, e5, e6] = edge_record;
        let [ns, es] = [&mut w.end.nodes, &mut w.end.edges]
            .map(|states| states.each_mut().map(|s| (&mut **s, latent)));
        let [[ns0, ns1], [es0, es1]] = [ns, es];
        let [at, _] = &mut w.at;
        let rows = Rows {
            vertices: [
                (&mut *w.nodes, latent),
                (at, 2 * latent),
                ns0,
                ns1,
                n0,
                n1,
                n2,
                n3,
                n4,
                n5,
                n6,
            ],
            arcs: [
                (&mut *w.edges, latent),
                es0,
                es1,
                e0,
                e1,
                e2,
                e3,
                e4,
                e5,
                e6,
            ],
        };
        let scratch = &w.scratch;
        let work = |leaves: &[Leaf], rows: Rows<'_, T, 11, 10>, (): &mut ()| {
            let [out, at, s0, s1, node_record @ ..] = rows.vertices.map(|(array, _)| array);
            let [edge_out, end0, end1, record @ ..] = rows.arcs.map(|(array, _)| array);
            let edge_rows = EncoderRows {
                out: edge_out,
                record,
                end: [end0, end1],
            };
            let [leaf] = leaves else { return };
            Workspace::with_scratch(scratch, |scratch| {
                let node_rows = EncoderRows {
                    out: &mut *out,
                    record: node_record,
                    end: [s0, s1],
                };
                let layer = weights.layer(NODE_ENCODER);
                let range = leaf.vertices.clone();
                self.node_encoder
                    .forward(layer, nodes, range, node_rows, scratch);
                let layer = weights.layer(EDGE_ENCODER);
                let range = leaf.arcs.clone();
                self.edge_encoder
                    .forward(layer, edges, range, edge_rows, scratch);
                self.blocks[0].products_per_vertex(weights.layer(FIRST_BLOCK), out, at);
            });
        };
        // Of no size: nothing is allocated.
        let mut leaves = vec![(); graph.leaves.len()];
        rows.share(&graph.leaves, &mut leaves, &work);
    }

    /// One block, and the products of the vertices for the next one, or the decoder after the last.
    fn run_block<T: Real>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        number: usize,
        w: &mut Workspace<T>,
    ) {
        let latent = self.spec.latent;
        let (block, last) = (&self.blocks[number], number + 1 == self.blocks.len());
        let (node_record, edge_record) = if w.kept {
            w.blocks[number].rows(block)
        } else {
            (none(), none())
        };
        let decoder = if w.kept && last {
            w.decoder.rows(&self.decoder)
        } else {
            none()
        };
        let [n0, n1, n2, n3, n4, n5] = node_record;
        let [e0, e1, e2, e3, e4] = edge_record;
        let [d0, d1, d2, d3] = decoder;
        let [even, odd] = &mut w.at;
        let (at, next_at) = if number.is_multiple_of(2) {
            (&*even, odd)
        } else {
            (&*odd, even)
        };
        let rows = Rows {
            vertices: [
                (&mut *w.nodes, latent),
                (next_at, 2 * latent),
                (&mut *w.output, OUTPUTS),
                n0,
                n1,
                n2,
                n3,
                n4,
                n5,
                d0,
                d1,
                d2,
                d3,
            ],
            arcs: [(&mut *w.edges, latent), e0, e1, e2, e3, e4],
        };
        let scratch = &w.scratch;
        let module = FIRST_BLOCK + number;
        let work = |leaves: &[Leaf], rows: Rows<'_, T, 13, 6>, (): &mut ()| {
            let [nodes, next_at, out, n0, n1, n2, n3, n4, n5, decoder @ ..] =
                rows.vertices.map(|(array, _)| array);
            let [edges, edge_record @ ..] = rows.arcs.map(|(array, _)| array);
            let [leaf] = leaves else { return };
            Workspace::with_scratch(scratch, |scratch| {
                let block_rows = BlockRows {
                    nodes: &mut *nodes,
                    edges,
                    node_record: [n0, n1, n2, n3, n4, n5],
                    edge_record,
                };
                let layer = weights.layer(module);
                block.forward(layer, (graph, leaf), at, block_rows, scratch);
                let layer = weights.layer(module + 1);
                if let Some(next) = self.blocks.get(number + 1) {
                    next.products_per_vertex(layer, nodes, next_at);
                    return;
                }
                let count = 0..leaf.vertices.len();
                let mut tile = scratch.tiles.tile(decoder, &count, latent);
                let (terms, mlp) = (&[self.decoder_first.times(layer, nodes)], &self.decoder);
                mlp.first_layer(layer, terms, mlp.first_finish(layer), &mut tile);
                mlp.forward(layer, tile, Normalised::Set(out));
            });
        };
        let mut leaves = vec![(); graph.leaves.len()];
        rows.share(&graph.leaves, &mut leaves, &work);
    }
}
