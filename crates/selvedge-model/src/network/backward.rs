//! The backward pass: groups of leaves sum the gradients of a module's weights by themselves, and these
//! sums are added group after group, so that no number of threads changes any of them.

use std::ops::Range;

use rayon::prelude::*;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{Leaf, Rows, of_rows};
use crate::kernels::gemm::{Columns, Finish, multiply};
use crate::kernels::real::Real;
use crate::network::layers::block::BlockGradients;
use crate::network::layers::encoder::EncoderEnds;
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::parameters::ModuleGradient;
use crate::network::workspace::{EncoderState, Group, Workspace};

use super::passes::BackwardPass;
use super::{
    EDGE_ENCODER, FIRST_BLOCK, Gradients, Input, InputGradient, NODE_ENCODER, Network, OUTPUTS,
};

/// The gradients of what a streaming network carries from frame to frame.
#[derive(Default)]
pub struct StateGradients<'a, T> {
    /// With respect to the state after the frame, as the later frames have it; none is zero.
    pub end: Option<&'a EncoderState<T>>,
    /// With respect to the state before the frame, where asked for; overwritten.
    pub start: Option<&'a mut EncoderState<T>>,
}

impl Network {
    /// The derivatives of Σ `output` ∘ out, where out is what the last [`Self::forward`] with
    /// [`super::Pass::Training`] on the same arguments gave; its activations are used up.
    ///
    /// # Panics
    /// When the lengths are not those of the spec and the graph, or the last pass was not a
    /// forward one with [`super::Pass::Training`].
    pub fn backward<T: Real>(
        &self,
        (weights, gradients): (&[T], Gradients<'_, T>),
        graph: &Connectivity,
        input: Input<'_, T>,
        output: &[T],
        workspace: &mut Workspace<T>,
    ) {
        let packed = workspace.packed.take();
        assert!(
            packed.as_ref().is_some_and(|p| p.flat == weights),
            "a forward pass to learn from, with the same weights, comes first"
        );
        if let Some(packed) = packed {
            self.backward_packed((&packed, gradients), graph, input, output, workspace);
            workspace.packed = Some(packed);
        }
    }

    /// The same after [`Self::forward_packed`] with the same weights.
    ///
    /// # Panics
    /// As [`Self::backward`], and for weights that are not packed for training.
    pub fn backward_packed<T: Real>(
        &self,
        both: (&PackedWeights<T>, Gradients<'_, T>),
        graph: &Connectivity,
        input: Input<'_, T>,
        output: &[T],
        workspace: &mut Workspace<T>,
    ) {
        let (zero, states) = (EncoderState::new(), StateGradients::default());
        self.backward_carried(both, graph, (input, &zero, states), output, workspace);
    }

    /// The same after [`Self::forward_carried`], with the gradients of the states.
    ///
    /// # Panics
    /// As [`Self::backward_packed`].
    pub fn backward_carried<T: Real>(
        &self,
        (weights, gradients): (&PackedWeights<T>, Gradients<'_, T>),
        graph: &Connectivity,
        (input, state, states): (Input<'_, T>, &EncoderState<T>, StateGradients<'_, T>),
        output: &[T],
        workspace: &mut Workspace<T>,
    ) {
        let arguments = BackwardPass {
            weights,
            gradients,
            graph,
            given: (input, state),
            states,
            output,
            workspace,
        };
        T::backward(self, arguments);
    }

    pub(super) fn run_backward<T: Real>(&self, arguments: BackwardPass<'_, T>) {
        let BackwardPass {
            weights,
            gradients,
            graph,
            given,
            states,
            output,
            workspace: w,
        } = arguments;
        assert!(
            std::mem::take(&mut w.kept),
            "a forward pass to learn from comes first"
        );
        assert_eq!(
            weights.purpose,
            Purpose::Training,
            "what the weights are for"
        );
        assert_eq!(output.len(), graph.vertex_count() * OUTPUTS);
        assert_eq!(gradients.weights.len(), self.parameter_count());
        w.fit_groups(self, graph.leaves.len());
        self.decode_backward((weights, &mut *gradients.weights), graph, output, w);
        w.edges.fill(T::ZERO);
        for number in (0..self.blocks.len()).rev() {
            let both = (weights, &mut *gradients.weights);
            self.block_backward(both, graph, number, w);
        }
        let both = (weights, gradients.weights);
        self.encode_backward(both, graph, given, (gradients.input, states), w);
    }

    /// Leaves the gradient of the latent vertices before the decoder in their place.
    fn decode_backward<T: Real>(
        &self,
        (weights, gradient): (&PackedWeights<T>, &mut [T]),
        graph: &Connectivity,
        output: &[T],
        w: &mut Workspace<T>,
    ) {
        let (latent, module) = (self.spec.latent, FIRST_BLOCK + self.blocks.len());
        let (layer, range) = (weights.layer(module), self.weights_of(module, module));
        let rows = Rows {
            vertices: [(&mut *w.nodes, latent)],
            arcs: [],
        };
        let record = &w.decoder;
        let work = |leaves: &[Leaf], rows: Rows<'_, T, 1, 0>, group: &mut Group<T>| {
            let first_vertex = leaves[0].vertices.start;
            let [(all, _)] = rows.vertices;
            let (scratch, mut gradient) = group.begin(&range);
            for leaf in leaves {
                let vertices = &leaf.vertices;
                let local = vertices.start - first_vertex..vertices.end - first_vertex;
                let nodes = &mut all[of_rows(&local, latent)];
                let kept = record.tile(&self.decoder, vertices);
                let out = &mut scratch.output[..vertices.len() * OUTPUTS];
                out.copy_from_slice(&output[of_rows(vertices, OUTPUTS)]);
                let first = &mut scratch.first[..nodes.len()];
                let buffers = (&mut scratch.hidden[..nodes.len()], &mut *first);
                self.decoder
                    .backward(layer, kept, out, buffers, &mut gradient);
                let pair = (Columns::all(first, latent), Columns::all(nodes, latent));
                self.decoder.first_backward(layer, 0, pair, &mut gradient);
                let terms = &[self.decoder_first.back(layer, first)];
                multiply(layer.instructions, terms, latent, Finish::Set, nodes);
            }
        };
        rows.share(&graph.leaves, &mut w.groups, &work);
        add_groups(&w.groups, &mut gradient[range]);
    }

    fn block_backward<T: Real>(
        &self,
        (weights, gradient): (&PackedWeights<T>, &mut [T]),
        graph: &Connectivity,
        number: usize,
        w: &mut Workspace<T>,
    ) {
        let (latent, module) = (self.spec.latent, FIRST_BLOCK + number);
        let (layer, range) = (weights.layer(module), self.weights_of(module, module));
        let (block, record) = (&self.blocks[number], &w.blocks[number]);
        let [sums, _] = &mut w.at;
        w.first.resize(w.edges.len());
        let rows = Rows {
            vertices: [(&mut *w.nodes, latent), (&mut **sums, 2 * latent)],
            arcs: [(&mut *w.edges, latent), (&mut *w.first, latent)],
        };
        let work = |leaves: &[Leaf], rows: Rows<'_, T, 2, 2>, group: &mut Group<T>| {
            let start = [leaves[0].vertices.start, leaves[0].arcs.start];
            let [nodes, sums] = rows.vertices.map(|(array, _)| array);
            let [edges, first] = rows.arcs.map(|(array, _)| array);
            let (scratch, mut gradient) = group.begin(&range);
            for leaf in leaves {
                let vertices = leaf.vertices.start - start[0]..leaf.vertices.end - start[0];
                let arcs = leaf.arcs.start - start[1]..leaf.arcs.end - start[1];
                let rows = BlockGradients {
                    nodes: &mut nodes[of_rows(&vertices, latent)],
                    edges: &mut edges[of_rows(&arcs, latent)],
                    first: &mut first[of_rows(&arcs, latent)],
                    sums: &mut sums[of_rows(&vertices, 2 * latent)],
                };
                let group = (&mut *scratch, &mut gradient);
                block.backward(layer, (graph, leaf), record, rows, group);
            }
        };
        rows.share(&graph.leaves, &mut w.groups, &work);
        let rows = Rows {
            vertices: [(&mut *w.nodes, latent), (&mut **sums, 2 * latent)],
            arcs: [],
        };
        let first = &*w.first;
        let work = |leaves: &[Leaf], rows: Rows<'_, T, 2, 0>, group: &mut Group<T>| {
            let start = leaves[0].vertices.start;
            let [nodes, sums] = rows.vertices.map(|(array, _)| array);
            let mut gradient = ModuleGradient::new(&mut group.gradient, range.start);
            for leaf in leaves {
                let vertices = leaf.vertices.start - start..leaf.vertices.end - start;
                let rows = [
                    &mut nodes[of_rows(&vertices, latent)],
                    &mut sums[of_rows(&vertices, 2 * latent)],
                ];
                let kept = (record, first);
                block.ends_backward(layer, (graph, leaf), kept, rows, &mut gradient);
            }
        };
        rows.share(&graph.leaves, &mut w.groups, &work);
        add_groups(&w.groups, &mut gradient[range]);
    }

    fn encode_backward<T: Real>(
        &self,
        (weights, gradient): (&PackedWeights<T>, &mut [T]),
        graph: &Connectivity,
        given: (Input<'_, T>, &EncoderState<T>),
        (to_input, states): (Option<InputGradient<'_, T>>, StateGradients<'_, T>),
        w: &mut Workspace<T>,
    ) {
        let (spec, latent) = (&self.spec, self.spec.latent);
        let windows = self.windows(graph, given.0, given.1);
        let inputs = self.encoder_inputs(given, windows, &w.dropout);
        let widths = [
            windows[0] * spec.node_width(),
            windows[1] * spec.edge_width(),
        ];
        let counts = [graph.vertex_count(), graph.arc_count()];
        for (k, rows) in w.to_input.iter_mut().enumerate() {
            let wanted = if to_input.is_some() { counts[k] } else { 0 };
            rows.resize(wanted * widths[k]);
        }
        let mut nowhere = EncoderState::new();
        let start = match states.start {
            Some(start) => {
                start.fit(counts, latent);
                start
            }
            None => &mut nowhere,
        };
        let [s0, s1] = start.nodes.each_mut().map(|s| (&mut **s, latent));
        let [t0, t1] = start.edges.each_mut().map(|s| (&mut **s, latent));
        let [to_nodes, to_edges] = &mut w.to_input;
        let rows = Rows {
            vertices: [(&mut *w.nodes, latent), (to_nodes, widths[0]), s0, s1],
            arcs: [(&mut *w.edges, latent), (to_edges, widths[1]), t0, t1],
        };
        let records = [&w.node_encoder, &w.edge_encoder];
        let range = self.weights_of(NODE_ENCODER, EDGE_ENCODER);
        let zero = EncoderState::new();
        let end = states.end.unwrap_or(&zero);
        let ends = [&end.nodes, &end.edges].map(|s| s.each_ref().map(|s| &**s));
        let work = |leaves: &[Leaf], rows: Rows<'_, T, 4, 4>, group: &mut Group<T>| {
            let (scratch, mut gradient) = group.begin(&range);
            let kinds = [rows.vertices, rows.arcs].map(|rows| rows.map(|(array, _)| array));
            for (k, [output, to_input, start0, start1]) in kinds.into_iter().enumerate() {
                let (module, encoder) = match k {
                    0 => (NODE_ENCODER, &self.node_encoder),
                    _ => (EDGE_ENCODER, &self.edge_encoder),
                };
                // The chunks are those of the forward pass, which are counted leaf by leaf.
                let ranges = leaves.iter().map(|leaf| match k {
                    0 => leaf.vertices.clone(),
                    _ => leaf.arcs.clone(),
                });
                let mut first = None;
                for range in ranges {
                    let first = *first.get_or_insert(range.start);
                    let local = range.start - first..range.end - first;
                    let ends = EncoderEnds {
                        output: &mut output[of_rows(&local, latent)],
                        to_input: rows_of(to_input, &local, widths[k]),
                        end: ends[k],
                        start: [
                            rows_of(start0, &local, latent),
                            rows_of(start1, &local, latent),
                        ],
                    };
                    let group = (&mut *scratch, &mut gradient);
                    let kept = (range, records[k]);
                    encoder.backward(weights.layer(module), inputs[k], kept, ends, group);
                }
            }
        };
        rows.share(&graph.leaves, &mut w.groups, &work);
        add_groups(&w.groups, &mut gradient[range]);
        if let Some(to_input) = to_input {
            for (k, to) in [to_input.nodes, to_input.edges].into_iter().enumerate() {
                frame_by_frame(&w.to_input[k], widths[k] / windows[k], windows[k], to);
            }
        }
    }
}

/// Rows of an array, or nothing of an empty one.
fn rows_of<'a, T>(array: &'a mut [T], rows: &Range<usize>, width: usize) -> &'a mut [T] {
    array.get_mut(of_rows(rows, width)).unwrap_or_default()
}

/// `[rows, window, width]` to `[window, rows, width]`.
fn frame_by_frame<T: Copy>(from: &[T], width: usize, window: usize, to: &mut [T]) {
    let rows = from.len() / (width * window);
    for (row, frames) in from.chunks_exact(width * window).enumerate() {
        for (frame, values) in frames.chunks_exact(width).enumerate() {
            to[(frame * rows + row) * width..][..width].copy_from_slice(values);
        }
    }
}

impl<T: Real> Group<T> {
    /// A gradient of zeros for the weights of a module, and the scratch.
    fn begin(
        &mut self,
        weights: &Range<usize>,
    ) -> (
        &mut crate::network::layers::GroupScratch<T>,
        ModuleGradient<'_, T>,
    ) {
        self.gradient.resize(weights.len());
        self.gradient.fill(T::ZERO);
        let gradient = ModuleGradient::new(&mut self.gradient, weights.start);
        (&mut self.scratch, gradient)
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
