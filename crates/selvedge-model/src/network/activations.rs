//! The memory of a training pass from the spec alone: all that a
//! [`Workspace`](crate::Workspace) holds.

use crate::spec::{Encoder, ModelSpec};

/// Numbers that a training pass keeps, for each vertex and each arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Activations {
    /// For each vertex.
    pub vertex: u64,
    /// For each arc.
    pub arc: u64,
}

impl Activations {
    /// Numbers that a cloth needs.
    #[must_use]
    pub fn of(self, vertices: usize, arcs: usize) -> u64 {
        self.vertex * vertices as u64 + self.arc * arcs as u64
    }
}

/// Numbers that a workspace of this spec holds for the rows of its graph after a training pass with
/// dropout and its backward pass.
#[must_use]
pub fn activations(spec: &ModelSpec) -> Activations {
    let (latent, blocks, window) = (spec.latent as u64, spec.blocks as u64, spec.window() as u64);
    // Two hidden layers, the normalised output and its deviation.
    let perceptron = 3 * latent + 1;
    let encoded = match spec.encoder.is_recurrent() {
        false => perceptron,
        // Of each of two layers the states and four gates; what is dropped between them; the
        // output.
        true => (2 * (window + 1 + 4 * window) + window + 1) * latent + 1,
    };
    let carried = match spec.encoder {
        Encoder::StreamingGru { .. } => 2 * latent,
        _ => 0,
    };
    let decoder = 2 * latent;
    let looks_at_arcs = u64::from(blocks > 0);
    Activations {
        // A block keeps its input, the sums of messages and its perceptron. Beside the blocks: the
        // latent vertices, what two blocks' arcs gather of them, the output.
        vertex: encoded
            + blocks * (2 * latent + perceptron)
            + decoder
            + 5 * latent
            + spec.outputs() as u64
            + carried,
        // The latent arcs and the gradients of their first layer.
        arc: looks_at_arcs * encoded + blocks * (latent + perceptron) + 2 * latent + carried,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::connectivity::Connectivity;
    use crate::kernels::dropout::Dropout;
    use crate::network::workspace::Workspace;
    use crate::network::{Gradients, Input, Network, Pass};
    use crate::test_cloth::parts;

    #[test]
    fn a_workspace_holds_what_is_counted() {
        for (side, seed) in [(3, 1), (5, 2)] {
            let graph = parts(side, seed).graph();
            let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
            for encoder in [
                Encoder::MLP,
                Encoder::Gru { window: 2 },
                Encoder::Gru { window: 5 },
                Encoder::StreamingGru { window: 2 },
            ] {
                let spec = ModelSpec::physical(encoder, 4 + seed as usize, 1 + side);
                let network = Network::new(&spec).expect("a network");
                let weights = network.initialise(&mut || 0.5);
                let [node_width, edge_width] = [spec.node_width(), spec.edge_width()];
                let nodes = vec![0.1_f32; spec.window() * vertices * node_width];
                let edges = vec![0.1_f32; spec.window() * arcs * edge_width];
                let input = Input {
                    nodes: &nodes,
                    arcs: &edges,
                };
                let connectivity = Connectivity::of(graph.topology());
                let mut workspace = Workspace::new();
                let pass = Pass::Training(Some(Dropout {
                    rate: 0.5,
                    seeds: &[1],
                }));
                network.forward(&weights, &connectivity, input, pass, &mut workspace);
                let mut gradient = vec![0.0; weights.len()];
                let output = vec![1.0; 3 * vertices];
                let gradients = Gradients::new(&output, &mut gradient);
                network.backward(&weights, &connectivity, input, gradients, &mut workspace);
                let counted = activations(&spec).of(vertices, arcs);
                assert_eq!(workspace.number_count() as u64, counted, "{spec:?}");
            }
        }
    }
}
