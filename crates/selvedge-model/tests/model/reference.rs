//! The network as its equations are written, in `f64`, with no split layer, no tiles and no shared
//! code: the slow obvious version that every fast one is tested against.
//!
//! Weights are found by name, as a PyTorch module would find them.

use selvedge_model::{Connectivity, Encoder, Input, Network};

type Rows = Vec<Vec<f64>>;

struct Weights<'a> {
    network: &'a Network,
    values: &'a [f64],
}

impl Weights<'_> {
    fn get(&self, name: &str) -> &[f64] {
        let found = self.network.parameters().iter().find(|p| p.name == name);
        found.map_or(&[], |parameter| &self.values[parameter.range.clone()])
    }

    /// W x + b, with `suffix` between the kind of tensor and its end (`_ih_l0` in a GRU).
    fn linear(&self, path: &str, suffix: &str, x: &[f64]) -> Vec<f64> {
        let weight = self.get(&format!("{path}.weight{suffix}"));
        let bias = self.get(&format!("{path}.bias{suffix}"));
        let rows = weight.chunks_exact(x.len()).zip(bias);
        rows.map(|(row, b)| b + row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>())
            .collect()
    }

    fn layer_norm(&self, path: &str, x: &[f64]) -> Vec<f64> {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64;
        let weight = self.get(&format!("{path}.weight"));
        let bias = self.get(&format!("{path}.bias"));
        let scaled = x.iter().zip(weight).zip(bias);
        scaled
            .map(|((x, w), b)| (x - mean) / (variance + 1e-5).sqrt() * w + b)
            .collect()
    }

    fn mlp(&self, path: &str, x: &[f64]) -> Vec<f64> {
        let relu = |x: Vec<f64>| -> Vec<f64> { x.into_iter().map(|x| x.max(0.0)).collect() };
        let h = relu(self.linear(&format!("{path}.0"), "", x));
        let h = relu(self.linear(&format!("{path}.2"), "", &h));
        self.linear(&format!("{path}.4"), "", &h)
    }

    fn normalised_mlp(&self, path: &str, x: &[f64]) -> Vec<f64> {
        self.layer_norm(&format!("{path}.5"), &self.mlp(path, x))
    }

    /// The last state of the second layer over a window of inputs.
    fn gru(&self, path: &str, window: &[&[f64]], hidden: usize) -> Vec<f64> {
        let mut inputs: Rows = window.iter().map(|x| x.to_vec()).collect();
        for layer in 0..2 {
            let mut state = vec![0.0; hidden];
            for x in &mut inputs {
                let i = self.linear(path, &format!("_ih_l{layer}"), x);
                let h = self.linear(path, &format!("_hh_l{layer}"), &state);
                let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
                for k in 0..hidden {
                    let r = sigmoid(i[k] + h[k]);
                    let z = sigmoid(i[hidden + k] + h[hidden + k]);
                    let n = (i[2 * hidden + k] + r * h[2 * hidden + k]).tanh();
                    state[k] = (1.0 - z) * n + z * state[k];
                }
                *x = state.clone();
            }
        }
        inputs.pop().unwrap_or_default()
    }

    fn encode(&self, path: &str, input: &[f64], width: usize, rows: usize) -> Rows {
        let latent = self.network.spec().latent;
        (0..rows)
            .map(|row| {
                let at = |step: usize| &input[(step * rows + row) * width..][..width];
                match self.network.spec().encoder {
                    Encoder::Mlp { .. } => self.normalised_mlp(path, at(0)),
                    Encoder::Gru { .. } => {
                        let frames = input.len() / (rows * width);
                        let window: Vec<&[f64]> = (0..frames).map(at).collect();
                        let last = self.gru(&format!("{path}.gru"), &window, latent);
                        let out = self.linear(&format!("{path}.linear"), "", &last);
                        self.layer_norm(&format!("{path}.norm"), &out)
                    }
                }
            })
            .collect()
    }
}

/// Normalised accelerations `[vertices, 3]`, as [`Network::forward_packed`] gives them. A recurrent
/// encoder starts from zero and takes all frames of the input; a stream's state is that of the
/// frames before.
pub(crate) fn forward(
    network: &Network,
    weights: &[f64],
    graph: &Connectivity,
    input: Input<'_, f64>,
) -> Vec<f64> {
    let spec = network.spec();
    let weights = Weights {
        network,
        values: weights,
    };
    let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
    let width = spec.node_width();
    let mut nodes = weights.encode("encoder.nodes", input.nodes, width, vertices);
    let width = spec.edge_width();
    let mut latent_arcs = weights.encode("encoder.edges", input.arcs, width, arcs);
    for block in 0..spec.blocks {
        let mut incoming = vec![vec![0.0; spec.latent]; vertices];
        for (arc, edge) in latent_arcs.iter_mut().enumerate() {
            let (s, r) = (
                graph.senders()[arc] as usize,
                graph.receivers()[arc] as usize,
            );
            let joined = [&*nodes[s], &*nodes[r], &**edge].concat();
            let update = weights.normalised_mlp(&format!("processor.{block}.edge"), &joined);
            for k in 0..spec.latent {
                incoming[r][k] += update[k];
                edge[k] += update[k];
            }
        }
        for (node, incoming) in nodes.iter_mut().zip(&incoming) {
            let joined = [&**node, &**incoming].concat();
            let update = weights.normalised_mlp(&format!("processor.{block}.node"), &joined);
            for (x, u) in node.iter_mut().zip(update) {
                *x += u;
            }
        }
    }
    nodes
        .iter()
        .flat_map(|node| weights.mlp("decoder", node))
        .collect()
}
