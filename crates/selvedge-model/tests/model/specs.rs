//! Specs of the networks that tests go through.

use selvedge_model::{Encoder, ModelSpec, PhysicsBase};

/// One of every encoder, and of networks that correct physics.
pub(crate) fn specs() -> Vec<ModelSpec> {
    vec![
        ModelSpec::physical(Encoder::MLP, 8, 3),
        ModelSpec::physical(Encoder::Gru { window: 4 }, 6, 2),
        ModelSpec::physical(Encoder::Gru { window: 1 }, 5, 1),
        ModelSpec::mesh_graph_nets(7, 2),
        ModelSpec::physical(Encoder::StreamingGru { window: 2 }, 17, 1),
        correcting(9),
    ]
}

/// A network that corrects physics.
pub(crate) fn correcting(latent: usize) -> ModelSpec {
    ModelSpec {
        node_features: Default::default(),
        edge_features: Default::default(),
        base: Some(PhysicsBase { substeps: 1 }),
        ..ModelSpec::physical(Encoder::MLP, latent, 0)
    }
}
