//! Specs of the networks that tests go through.

use selvedge_model::{
    Encoder, Instructions, ModelSpec, Network, NetworkScalar, PackedWeights, Purpose,
};

/// One of every encoder.
pub(crate) fn specs() -> Vec<ModelSpec> {
    vec![
        ModelSpec::physical(Encoder::MLP, 8, 3),
        ModelSpec::physical(Encoder::Gru { window: 4 }, 6, 2),
        ModelSpec::physical(Encoder::Gru { window: 1 }, 5, 1),
        ModelSpec::mesh_graph_nets(7, 2),
    ]
}

/// Weights for passes forward and backward.
pub(crate) fn packed<T: NetworkScalar>(network: &Network, weights: &[T]) -> PackedWeights<T> {
    network.pack(weights, Purpose::Training, Instructions::Detected)
}
