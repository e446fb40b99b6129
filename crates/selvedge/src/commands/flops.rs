//! The arithmetic of a network from its spec alone.
//!
//! It counts matrix products, two operations for each multiplication with its addition. Features,
//! activations, normalisation and sums of messages, a few percent, are left out.

use selvedge_model::{Encoder, ModelSpec};

/// Floating-point operations of one frame, for each vertex and each arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Flops {
    /// For each vertex.
    pub(crate) vertex: u64,
    /// For each arc.
    pub(crate) arc: u64,
}

/// Computation of the first layer of an arc update, W [v_s, v_r, e].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FirstEdgeLayer {
    /// Three products for each arc, as the equation is written.
    Whole,
    /// A v_s + B v_r + C e, with the first two products for each vertex: the engine's way.
    Split,
}

impl Flops {
    /// Operations of a frame of a cloth.
    #[must_use]
    pub(crate) fn per_frame(self, vertices: usize, arcs: usize) -> u64 {
        self.vertex * vertices as u64 + self.arc * arcs as u64
    }
}

/// The arithmetic of a network of this spec, one forward pass.
#[must_use]
pub(crate) fn flops(spec: &ModelSpec, first: FirstEdgeLayer) -> Flops {
    let (latent, blocks) = (spec.latent as u64, spec.blocks as u64);
    let square = latent * latent;
    // W [v, Σ e'] and two more layers for a vertex, two more layers for an arc.
    let (mut vertex, mut arc) = (4 * square, 2 * square);
    match first {
        FirstEdgeLayer::Whole => arc += 3 * square,
        FirstEdgeLayer::Split => {
            vertex += 2 * square;
            arc += square;
        }
    }
    let decoder = 2 * square + latent * spec.outputs() as u64;
    let looks_at_arcs = u64::from(blocks > 0);
    Flops {
        vertex: 2 * (encoder(spec, spec.node_width()) + blocks * vertex + decoder),
        arc: 2 * (looks_at_arcs * encoder(spec, spec.edge_width()) + blocks * arc),
    }
}

/// Multiplications that encode one row of `width` columns per frame of the window; a state that is
/// carried over spares all but one frame.
fn encoder(spec: &ModelSpec, width: usize) -> u64 {
    let (latent, width) = (spec.latent as u64, width as u64);
    let square = latent * latent;
    match spec.encoder {
        Encoder::Mlp { .. } => width * latent + 2 * square,
        Encoder::Gru { .. } | Encoder::StreamingGru { .. } => {
            let first = 3 * latent * (width + latent);
            let second = 3 * latent * (latent + latent);
            let steps = match spec.encoder {
                Encoder::StreamingGru { .. } => 1,
                _ => spec.window() as u64,
            };
            steps * (first + second) + square
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_network_costs_what_a_hand_counts() {
        // 12 columns of a vertex, 7 of an arc, latent 4, 2 blocks.
        let spec = ModelSpec::mesh_graph_nets(4, 2);
        assert_eq!((spec.node_width(), spec.edge_width()), (12, 7));
        // Encoder 12·4 + 4·4 + 4·4 = 80, two updates of 8·4 + 4·4 + 4·4 = 64, decoder 4·4 + 4·4 +
        // 4·3 = 44. Arcs: 7·4 + 16 + 16 = 60, two updates of 12·4 + 16 + 16 = 80.
        let whole = Flops {
            vertex: 2 * (80 + 2 * 64 + 44),
            arc: 2 * (60 + 2 * 80),
        };
        assert_eq!(flops(&spec, FirstEdgeLayer::Whole), whole);
        // Of the 48 of an arc's first layer, 32 become two products of 16 for a vertex.
        let split = Flops {
            vertex: whole.vertex + 2 * 2 * 32,
            arc: whole.arc - 2 * 2 * 32,
        };
        assert_eq!(flops(&spec, FirstEdgeLayer::Split), split);
        assert_eq!(split.per_frame(3, 10), 3 * split.vertex + 10 * split.arc);
    }

    #[test]
    fn a_recurrent_encoder_costs_its_gates_in_every_frame() {
        let of = |encoder| flops(&ModelSpec::physical(encoder, 5, 1), FirstEdgeLayer::Split);
        let [three, four] = [3, 4].map(|window| of(Encoder::Gru { window }));
        // Three gates of 5 from 16 (10) columns and 5 states, and from 5 and 5 in the second layer.
        assert_eq!(four.vertex - three.vertex, 2 * 15 * (16 + 5 + 5 + 5));
        assert_eq!(four.arc - three.arc, 2 * 15 * (10 + 5 + 5 + 5));
        // Without the window: Linear 5·5, against 16·5 + 5·5 + 5·5 of a perceptron.
        let perceptron = of(Encoder::MLP);
        assert_eq!(
            three.vertex - 3 * (four.vertex - three.vertex) + 2 * (80 + 25),
            perceptron.vertex
        );
    }

    #[test]
    fn the_papers_networks_cost_what_the_paper_implies() {
        // 1024 vertices and 2949 edges, in GFLOP to one decimal.
        let cost = |spec: &ModelSpec, first| {
            (flops(spec, first).per_frame(1024, 5898) as f64 / 1e8).round() / 10.0
        };
        let physical = |encoder| ModelSpec::physical(encoder, 128, 15);
        let gru = |window| physical(Encoder::Gru { window });
        assert_eq!(cost(&gru(10), FirstEdgeLayer::Whole), 37.8);
        assert_eq!(cost(&gru(5), FirstEdgeLayer::Whole), 27.3);
        assert_eq!(cost(&physical(Encoder::MLP), FirstEdgeLayer::Whole), 17.0);
        // The processor alone: 16.5 whole, 11.7 split.
        assert_eq!(cost(&gru(10), FirstEdgeLayer::Split), 33.0);
    }
}
