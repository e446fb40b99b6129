//! Networks, graphs and numbers for the tests of this crate.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_model::{Connectivity, Encoder, ModelSpec, Network};

/// The arcs of squares of so many vertices, side by side.
pub(crate) fn squares(counts: &[usize]) -> Connectivity {
    let parts: Vec<Connectivity> = counts
        .iter()
        .map(|&vertices| {
            let spec = SquareSpec {
                vertices,
                size: 1.0,
                seed: vertices as u64,
            };
            let sheet = square(&spec).expect("a square");
            Connectivity::of(sheet.mesh.topology())
        })
        .collect();
    Connectivity::union(&parts)
}

/// Numbers in (-size, size).
pub(crate) fn numbers(count: usize, size: f32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| size * (2.0 * rng.random::<f32>() - 1.0))
        .collect()
}

/// Weights of a network, biases and normalisations among them, none of which is special.
pub(crate) fn weights(network: &Network, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut weights = network.initialise(&mut || rng.random());
    for weight in &mut weights {
        *weight += 0.05 * (2.0 * rng.random::<f32>() - 1.0);
    }
    weights
}

/// Specs of every encoder, with sizes that do and do not fill a warp.
pub(crate) fn specs() -> Vec<ModelSpec> {
    let physical = |encoder, latent, blocks| ModelSpec::physical(encoder, latent, blocks);
    vec![
        ModelSpec::mesh_graph_nets(16, 2),
        physical(Encoder::MLP, 32, 3),
        physical(Encoder::Mlp { window: 3 }, 20, 1),
        physical(Encoder::Gru { window: 1 }, 12, 1),
        physical(Encoder::Gru { window: 4 }, 24, 2),
        physical(Encoder::NodeGru { window: 3 }, 36, 2),
        physical(Encoder::StreamingGru { window: 2 }, 16, 2),
    ]
}
