//! Networks, graphs and numbers for the tests of this crate.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, Environment, Handles};
use selvedge_model::{
    ClothGraph, Connectivity, EdgeFeature, Encoder, Model, ModelSpec, Network, Normalizer,
    Normalizers,
};

use crate::gpu::{Gpu, GpuError};

/// The arcs of squares of so many vertices, side by side.
pub(crate) fn squares(counts: &[usize]) -> Connectivity {
    let parts: Vec<Connectivity> = counts
        .iter()
        .map(|&vertices| {
            let sheet = square(vertices, 1.0, vertices as u64).expect("a square");
            let handles = Handles::new(&[0], vertices).expect("a handle");
            let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).expect("a cloth");
            let graph = ClothGraph::new(&cloth, Environment::default(), 60.0);
            let graph = graph.expect("a graph");
            graph.connectivity().clone()
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
        physical(Encoder::MLP, 20, 1),
        physical(Encoder::Gru { window: 1 }, 12, 1),
        physical(Encoder::Gru { window: 4 }, 24, 2),
        physical(Encoder::Gru { window: 3 }, 36, 2),
        physical(Encoder::Gru { window: 2 }, 16, 2),
    ]
}

/// A hanging square of `side`² vertices, its handles the upper corners.
///
/// The tests of `selvedge-model` have one like it. Nothing depends on their being the same, and a
/// feature to share it would build that crate and all above it a second time.
pub(crate) fn hanging(side: usize, seed: u64) -> Cloth {
    let vertices = side * side;
    let sheet = square(vertices, 1.0, seed).expect("a square");
    let [left, right] = sheet.labels["upper-corners"][..] else {
        panic!("two upper corners");
    };
    let handles = Handles::new(&[right, left], vertices).expect("two corners");
    let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).expect("a cloth");
    let ripple = |p: &DVec3| DVec3::new(0.05 * (9.0 * p.z).sin() * p.y, p.y, p.z);
    let rest = sheet.mesh.positions().iter().map(|p| ripple(p).as_vec3());
    cloth
        .with_rest_positions(rest.collect())
        .expect("a rest pose")
}

/// The graph of [`hanging`] in moving air.
pub(crate) fn cloth(side: usize, seed: u64) -> ClothGraph {
    let environment = Environment {
        wind: DVec3::new(0.4, 0.1, -0.7),
        air_drag: 0.3,
        ..Environment::default()
    };
    ClothGraph::new(&hanging(side, seed), environment, 60.0).expect("a graph")
}

/// `positions` moved at random by up to `size` `[m]` per coordinate.
pub(crate) fn shaken(positions: &[Vec3], size: f32, seed: u64) -> Vec<Vec3> {
    let moves = numbers(3 * positions.len(), size, seed);
    let moves = moves.as_chunks::<3>().0.iter();
    let pairs = positions.iter().zip(moves);
    pairs.map(|(&p, &by)| p + Vec3::from_array(by)).collect()
}

/// All features.
pub(crate) fn full_specs() -> Vec<ModelSpec> {
    let mut specs = specs();
    for encoder in [Encoder::Gru { window: 3 }, Encoder::MLP] {
        let mut spec = ModelSpec::physical(encoder, 12, 1);
        spec.edge_features.insert(EdgeFeature::MaterialVector);
        specs.push(spec);
    }
    specs
}

/// A model of `spec` whose accelerations are about `size` `[m/frame²]`, with statistics none of
/// which is special but for one constant column.
pub(crate) fn model(spec: &ModelSpec, size: f64, seed: u64) -> Model {
    let network = Network::new(spec).expect("a spec");
    let statistics = |width: usize, constant: usize| {
        let mean = (0..width).map(|k| 0.01 * (k as f64).sin()).collect();
        let mut deviation: Vec<f64> = (0..width).map(|k| 0.1 + 0.01 * k as f64).collect();
        if let Some(d) = deviation.get_mut(constant) {
            *d = 0.0;
        }
        Normalizer::new(mean, deviation).expect("statistics")
    };
    let normalizers = Normalizers {
        nodes: statistics(spec.node_width(), 8),
        edges: statistics(spec.edge_width(), 40),
        acceleration: Normalizer::new(vec![0.0; 3], vec![size; 3]).expect("statistics"),
    };
    let weights = weights(&network, seed);
    Model::new(spec, weights, normalizers, String::new()).expect("a model")
}

/// The first GPU; on a machine without one a driver that calculates on the processor, such as
/// Mesa's lavapipe. None, which is said, where there is neither: its tests then show nothing,
/// or fail with `SELVEDGE_ALL_TOOLS`.
pub(crate) fn gpu() -> Option<Arc<Gpu>> {
    static FOUND: OnceLock<Option<Arc<Gpu>>> = OnceLock::new();
    let opened = FOUND.get_or_init(|| match Gpu::open(0) {
        Ok(gpu) => Some(gpu),
        Err(GpuError::None) => None,
        Err(error) => panic!("{error}"),
    });
    if opened.is_none() {
        let all = std::env::var_os("SELVEDGE_ALL_TOOLS");
        assert!(all.is_none(), "no driver for a GPU: run .ci/setup first");
        eprintln!("no GPU and no software driver for one (mesa-vulkan-drivers): not tested");
    }
    opened.clone()
}
