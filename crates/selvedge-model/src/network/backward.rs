//! The backward pass. Each group of partitions sums the gradients of a module's weights by itself,
//! and these sums are added group after group, so that no number of threads changes any of them.

use crate::graph::partition::split;
use crate::kernels::gemm::Epilogue;
use crate::kernels::real::Real;
use crate::network::definition::{ARC_ENCODER, FIRST_BLOCK, NODE_ENCODER};
use crate::network::kept::Group;
use crate::network::packed::Purpose;
use crate::network::passes::{Gradients, Passage};
use crate::network::workspace::{Workspace, add_groups, by_group};
use crate::spec::OUTPUTS;

impl<T: Real> Passage<'_, T> {
    pub(super) fn backward(self, mut gradients: Gradients<'_, T>, w: &mut Workspace<T>) {
        let network = self.network;
        let kept = std::mem::take(&mut w.kept);
        assert!(kept, "a forward pass to learn from comes first");
        let purpose = self.weights.purpose;
        assert_eq!(purpose, Purpose::Training, "purpose of the packed weights");
        assert_eq!(gradients.output.len(), self.graph.vertex_count() * OUTPUTS);
        assert_eq!(gradients.weights.len(), network.parameter_count());
        w.fit_groups(network);
        self.decode_backward(&mut gradients, w);
        for number in (0..network.blocks.len()).rev() {
            if w.stop.is_wanted() {
                return;
            }
            self.block_backward(number, gradients.weights, w);
        }
        self.encode_backward(gradients, w);
    }

    /// Leaves the gradient of the latent nodes before the decoder in their place, and that of the
    /// arcs, which is 0.
    fn decode_backward(self, gradients: &mut Gradients<'_, T>, w: &mut Workspace<T>) {
        let module = FIRST_BLOCK + self.network.blocks.len();
        let (layer, (_, range)) = (self.weights.layer(module), &self.network.modules[module]);
        let (decoder, of_output) = (&self.network.decoder, gradients.output);
        by_group(&mut w.groups, Some(range), &mut w.parts, |group, part| {
            part.arcs.fill(T::ZERO);
            let Some(kept) = &part.decoder else { return };
            let Group { scratch, gradient } = group;
            let (vertices, nodes) = (&part.rows.vertices, &mut *part.nodes);
            let [output, hidden, by_sums, _] = &mut scratch.tiles;
            let output = &mut output[..vertices.len() * OUTPUTS];
            output.copy_from_slice(&of_output[vertices.start * OUTPUTS..vertices.end * OUTPUTS]);
            let [hidden, by_sums] = [hidden, by_sums].map(|tile| &mut tile[..nodes.len()]);
            let through = [output, hidden, &mut *by_sums];
            decoder.backward(layer, ([&*nodes], kept), through, gradient);
            decoder.input_backward(layer, 0, by_sums, Epilogue::Set, nodes);
        });
        add_groups(&w.groups, &mut gradients.weights[range.clone()]);
    }

    /// Takes the gradients of the latent vectors from after a block to before it: through the
    /// updates of arcs and nodes first, then through the endpoint products, which need the arcs of
    /// all partitions.
    fn block_backward(self, number: usize, gradient: &mut [T], w: &mut Workspace<T>) {
        let (network, graph) = (self.network, self.graph);
        let (latent, module) = (network.spec.latent, FIRST_BLOCK + number);
        let (layer, (_, range)) = (self.weights.layer(module), &network.modules[module]);
        let (block, stop) = (&network.blocks[number], &w.stop);
        w.by_sums.resize(graph.arc_count() * latent);
        let [sums, _] = &mut w.endpoint_products;
        let rows = split(sums, 2 * latent, graph.vertex_ranges()).into_iter();
        let rows = rows.zip(split(&mut w.by_sums, latent, graph.arc_ranges()));
        let rows = w.parts.iter_mut().zip(rows);
        by_group(&mut w.groups, Some(range), rows, |group, (part, sums)| {
            if !stop.is_wanted() {
                block.backward(layer, (graph, number), part, sums, group);
            }
        });
        let sums = split(sums, 2 * latent, graph.vertex_ranges());
        let (rows, of_arcs) = (w.parts.iter_mut().zip(sums), (graph, number, &*w.by_sums));
        by_group(&mut w.groups, None, rows, |group, (part, sums)| {
            block.endpoints_backward(layer, of_arcs, part, sums, &mut group.gradient);
        });
        add_groups(&w.groups, &mut gradient[range.clone()]);
    }

    /// The gradients of both encoders' weights, and of the input where wanted.
    fn encode_backward(self, gradients: Gradients<'_, T>, w: &mut Workspace<T>) {
        self.check_input();
        let (network, weights, graph) = (self.network, self.weights, self.graph);
        let (frames, widths) = (network.spec.window(), network.input_widths());
        let [nodes, arcs] = self.encoder_inputs(&w.dropout);
        let [of_nodes, of_arcs] = &network.encoders;
        // Of each partition the rows in each frame, which lie apart.
        let partitions = graph.partitions.iter();
        let mut wanted: Vec<[Vec<&mut [T]>; 2]> = partitions.map(|_| Default::default()).collect();
        if let Some(to) = gradients.input {
            for (kind, to) in [to.nodes, to.arcs].into_iter().enumerate() {
                for frame in to.chunks_exact_mut((to.len() / frames).max(1)) {
                    let rows = match kind {
                        0 => split(frame, widths[kind], graph.vertex_ranges()),
                        _ => split(frame, widths[kind], graph.arc_ranges()),
                    };
                    for (wanted, rows) in wanted.iter_mut().zip(rows) {
                        wanted[kind].push(rows);
                    }
                }
            }
        }
        let range = network.modules[NODE_ENCODER].1.start..network.modules[ARC_ENCODER].1.end;
        let rows = w.parts.iter_mut().zip(wanted);
        by_group(
            &mut w.groups,
            Some(&range),
            rows,
            |group, (part, wanted)| {
                let [kept_nodes, kept_arcs] = &part.encoders;
                let [to_nodes, to_arcs] = wanted;
                let (layer, rows) = (weights.layer(NODE_ENCODER), &part.rows);
                let (kept, to) = ((nodes, &**kept_nodes), (&mut *part.nodes, to_nodes));
                of_nodes.backward(layer, kept, &rows.vertices, to, group);
                let layer = weights.layer(ARC_ENCODER);
                let (kept, to) = ((arcs, &**kept_arcs), (&mut *part.arcs, to_arcs));
                of_arcs.backward(layer, kept, &rows.arcs, to, group);
            },
        );
        add_groups(&w.groups, &mut gradients.weights[range]);
    }
}
