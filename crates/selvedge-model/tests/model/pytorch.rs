//! A whole network against PyTorch: tests/pytorch/layers.safetensors, which
//! tests/pytorch/generate.py wrote beside it. It has every kind of layer: recurrent encoders, blocks
//! of perceptrons with LayerNorm, a decoder without. PyTorch's outputs and gradients are f64: ours
//! in f64 must be the same but for the order of sums, ours in f32 within 1e-5 of the largest entry
//! of each tensor.

use std::collections::BTreeMap;

use selvedge_cloth::Topology;
use selvedge_model::{
    Connectivity, Encoder, InputGradient, ModelSpec, Network, NetworkScalar, Pass,
};

use crate::specs::{both, input, packed};

#[path = "../pytorch/fixture.rs"]
mod fixture;

const FIXTURE: &[u8] = include_bytes!("../pytorch/layers.safetensors");

fn tensor(name: &str) -> Vec<f64> {
    fixture::tensor(FIXTURE, name)
}

fn real<T: NetworkScalar>(values: &[f64]) -> Vec<T> {
    values.iter().map(|&x| T::from_f64(x)).collect()
}

/// The cloth of the fixture, and where our arcs stand among its own.
fn cloth() -> (Connectivity, Vec<usize>) {
    let whole = |name| -> Vec<u32> { tensor(name).into_iter().map(|x| x as u32).collect() };
    let (faces, arcs) = (whole("faces"), whole("arcs"));
    let topology = Topology::new(9, faces.as_chunks::<3>().0).expect("a strip");
    let graph = Connectivity::of(&topology);
    let places: BTreeMap<[u32; 2], usize> =
        arcs.as_chunks::<2>().0.iter().copied().zip(0..).collect();
    let ours = graph.senders().iter().zip(graph.receivers());
    let order: Vec<usize> = ours.map(|(&s, &r)| places[&[s, r]]).collect();
    assert_eq!(order.len(), places.len());
    (graph, order)
}

/// Rows of the fixture's arcs in our order; `[window, arcs, width]`.
fn reordered(values: &[f64], order: &[usize], width: usize) -> Vec<f64> {
    let frames = values.chunks_exact(order.len() * width);
    let rows =
        frames.flat_map(|frame| order.iter().map(move |&row| &frame[row * width..][..width]));
    rows.flatten().copied().collect()
}

/// Compares with what PyTorch has, within a part of the largest entry.
fn compare<T: NetworkScalar>(what: &str, found: &[T], expected: &[f64]) {
    // f64: a few hundred roundings of 1e-16, amplified by LayerNorms as in f32.
    let limit = if size_of::<T>() == 4 { 1e-5 } else { 1e-13 };
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let pairs = found.iter().zip(expected);
    let worst = pairs
        .map(|(x, y)| (x.to_f64() - y).abs())
        .fold(0.0, f64::max);
    assert!(worst <= limit * largest, "{what}: {:e}", worst / largest);
}

fn network_case<T: NetworkScalar>() {
    let of = |name: &str| tensor(&format!("network-gru/{name}"));
    let (graph, order) = cloth();
    let spec = ModelSpec::physical(Encoder::Gru { window: 3 }, 6, 2);
    let network = Network::new(&spec).expect("a valid spec");
    let parameters = network.parameters().iter();
    let weights: Vec<f64> = parameters
        .flat_map(|p| of(&format!("weight.{}", p.name)))
        .collect();
    let weights: Vec<T> = real(&weights);
    let nodes: Vec<T> = real(&of("input.nodes"));
    let arcs: Vec<T> = real(&reordered(&of("input.edges"), &order, 10));
    let input = input(&nodes, &arcs);
    let packed = packed(&network, &weights);
    let [mut by_nodes, mut by_arcs] = [&nodes, &arcs].map(|x| vec![T::ZERO; x.len()]);
    let output: Vec<T> = real(&of("cotangent.rows"));
    let by_input = InputGradient {
        nodes: &mut by_nodes,
        arcs: &mut by_arcs,
    };
    let (pass, by_input) = (Pass::Training(None), Some(by_input));
    let [out, gradient] = both(&network, &packed, (&graph, input), pass, &output, by_input);
    compare("output", &out, &of("output.rows"));
    compare("nodes", &by_nodes, &of("gradient.input.nodes"));
    let expected = reordered(&of("gradient.input.edges"), &order, 10);
    compare("arcs", &by_arcs, &expected);
    for parameter in network.parameters() {
        let expected = of(&format!("gradient.weight.{}", parameter.name));
        compare(
            &parameter.name,
            &gradient[parameter.range.clone()],
            &expected,
        );
    }
}

#[test]
fn the_whole_network_is_pytorchs() {
    network_case::<f64>();
    network_case::<f32>();
}
