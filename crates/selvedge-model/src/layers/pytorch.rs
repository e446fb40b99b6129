//! The layers and whole networks against PyTorch: tests/pytorch/layers.safetensors, which
//! tests/pytorch/generate.py wrote beside it. PyTorch's outputs and gradients are f64: ours in f64 must be the same
//! but for the order of sums, ours in f32 within 1e-5 of the largest entry of each tensor.
//! `cargo test -p selvedge-model pytorch -- --nocapture` prints the largest differences.

// What is measured is there to be read.
#![allow(clippy::print_stdout)]

use std::collections::{BTreeMap, BTreeSet};

use selvedge_cloth::Topology;

use super::block::{Block, BlockRecord, BlockScratch, Latents};
use super::encoder::{EncoderEnds, EncoderLayers, EncoderRecord};
use super::mlp::{Mlp, MlpRecord, MlpScratch};
use crate::connectivity::Connectivity;
use crate::kernels::{NormRows, layer_norm, layer_norm_backward};
use crate::network::{Gradients, Input, InputGradient, Network, Pass, Workspace};
use crate::parameters::{LayoutBuilder, Parameter};
use crate::product::Store;
use crate::real::Real;
use crate::spec::{Encoder, ModelSpec};

#[path = "../../tests/pytorch/fixture.rs"]
mod fixture;

const FIXTURE: &[u8] = include_bytes!("../../tests/pytorch/layers.safetensors");

fn tensor(name: &str) -> Vec<f64> {
    fixture::tensor(FIXTURE, name)
}

fn real<T: Real>(values: &[f64]) -> Vec<T> {
    values.iter().map(|&x| T::from_f64(x)).collect()
}

/// One case of the fixture and the largest difference found in it.
struct Case {
    name: &'static str,
    limit: f64,
    worst: f64,
}

impl Case {
    fn new<T: Real>(name: &'static str) -> Self {
        // f64: a few hundred roundings of 1e-16, amplified by LayerNorms as in f32.
        let narrow = size_of::<T>() == size_of::<f32>();
        Self {
            name,
            limit: if narrow { 1e-5 } else { 1e-13 },
            worst: 0.0,
        }
    }

    fn tensor(&self, name: &str) -> Vec<f64> {
        tensor(&format!("{}/{name}", self.name))
    }

    fn real<T: Real>(&self, name: &str) -> Vec<T> {
        real(&self.tensor(name))
    }

    /// The flat array of weights that `parameters` lay out, from the tensors of `kind`.
    fn flat(&self, kind: &str, parameters: &[Parameter]) -> Vec<f64> {
        let of = |p: &Parameter| self.tensor(&format!("{kind}.{}", p.name));
        parameters.iter().flat_map(of).collect()
    }

    fn compare<T: Real>(&mut self, what: &str, found: &[T], expected: &[f64]) {
        assert_eq!(found.len(), expected.len(), "{}: {what}", self.name);
        let largest = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let differences = found
            .iter()
            .zip(expected)
            .map(|(x, y)| (x.to_f64() - y).abs());
        let worst = differences.fold(0.0, f64::max) / largest;
        assert!(worst <= self.limit, "{}: {what}: {worst:e}", self.name);
        self.worst = self.worst.max(worst);
    }

    /// Every weight's gradient by itself.
    fn compare_weights<T: Real>(&mut self, parameters: &[Parameter], found: &[T]) {
        for parameter in parameters {
            let expected = self.tensor(&format!("gradient.weight.{}", parameter.name));
            self.compare(&parameter.name, &found[parameter.range.clone()], &expected);
        }
    }

    fn tell(&self) {
        println!(
            "{:12} {:.1e} (allowed {:.0e})",
            self.name, self.worst, self.limit
        );
    }
}

/// Parameters of a layer by itself, under PyTorch's names without a path.
fn laid_out<L>(make: impl FnOnce(&mut LayoutBuilder) -> L) -> (L, Vec<Parameter>) {
    let mut layout = LayoutBuilder::default();
    let layer = make(&mut layout);
    let mut parameters = layout.finish();
    for parameter in &mut parameters {
        parameter.name = parameter.name.replacen("layer.", "", 1);
    }
    (layer, parameters)
}

/// The cloth of the fixture, and where our arcs stand among its own.
fn cloth() -> (Connectivity, Vec<usize>) {
    let whole = |name| {
        tensor(name)
            .into_iter()
            .map(|x| x as u32)
            .collect::<Vec<_>>()
    };
    let (faces, arcs) = (whole("faces"), whole("arcs"));
    let topology = Topology::new(9, faces.as_chunks::<3>().0).expect("a strip");
    let graph = Connectivity::of(&topology);
    let places: BTreeMap<[u32; 2], usize> =
        arcs.as_chunks::<2>().0.iter().copied().zip(0..).collect();
    let ours = graph.senders.iter().zip(&graph.receivers);
    let order: Vec<usize> = ours.map(|(&s, &r)| places[&[s, r]]).collect();
    assert_eq!(order.iter().collect::<BTreeSet<_>>().len(), places.len());
    (graph, order)
}

/// Rows of the fixture's arcs in our order; `[window, arcs, width]`.
fn reordered(values: &[f64], order: &[usize], width: usize) -> Vec<f64> {
    let frames = values.chunks_exact(order.len() * width);
    let rows =
        frames.flat_map(|frame| order.iter().map(move |&row| &frame[row * width..][..width]));
    rows.flatten().copied().collect()
}

fn layer_norm_case<T: Real>() {
    let mut case = Case::new::<T>("layer-norm");
    let mut normal: Vec<T> = case.real("input.rows");
    let [weight, shift]: [Vec<T>; 2] = ["weight.weight", "weight.bias"].map(|name| case.real(name));
    let rows = normal.len() / weight.len();
    let mut inverse_deviation = vec![T::ZERO; rows];
    let mut out = vec![T::ZERO; normal.len()];
    let bias = vec![T::ZERO; weight.len()];
    let norm = NormRows {
        normal: &mut normal,
        inverse_deviation: &mut inverse_deviation,
    };
    layer_norm(norm, &bias, &weight, &shift, &mut out);
    case.compare("output", &out, &case.tensor("output.rows"));
    let mut gradient: Vec<T> = case.real("cotangent.rows");
    let [mut by_weight, mut by_shift] = [(); 2].map(|()| vec![T::ZERO; weight.len()]);
    let kept = (&*normal, &*inverse_deviation);
    layer_norm_backward(&mut gradient, kept, &weight, &mut by_weight, &mut by_shift);
    case.compare("input", &gradient, &case.tensor("gradient.input.rows"));
    case.compare("weight", &by_weight, &case.tensor("gradient.weight.weight"));
    case.compare("bias", &by_shift, &case.tensor("gradient.weight.bias"));
    case.tell();
}

fn mlp_case<T: Real>() {
    let mut case = Case::new::<T>("mlp");
    let (mlp, parameters) = laid_out(|layout| Mlp::normalised(layout, "layer", 7, 6));
    let weights: Vec<T> = real(&case.flat("weight", &parameters));
    let input: Vec<T> = case.real("input.rows");
    let rows = input.len() / 7;
    let mut record = MlpRecord::default();
    record.fit(&mlp, rows);
    let mut out = vec![T::ZERO; rows * 6];
    let tile = record.tile(&mlp, &(0..rows));
    mlp.first_product(&weights, (0, 7), (&input, Store::Replace), tile.hidden1);
    mlp.finish(&weights, tile, &mut out);
    case.compare("output", &out, &case.tensor("output.rows"));
    let mut gradient = vec![T::ZERO; weights.len()];
    let mut output: Vec<T> = case.real("cotangent.rows");
    let mut scratch = MlpScratch::new(6);
    let tile = record.tile(&mlp, &(0..rows));
    mlp.finish_backward(&weights, &tile, &mut output, &mut scratch, &mut gradient);
    let mut by_input = vec![T::ZERO; input.len()];
    let pair = (&scratch.first[..rows * 6], &*input);
    let to_input = Some((&mut *by_input, Store::Replace));
    mlp.first_backward(&weights, (0, 7), pair, &mut gradient, to_input);
    case.compare("input", &by_input, &case.tensor("gradient.input.rows"));
    case.compare_weights(&parameters, &gradient);
    case.tell();
}

fn gru_case<T: Real>() {
    let mut case = Case::new::<T>("gru");
    let encoder = Encoder::Gru { window: 4 };
    let (layers, parameters) =
        laid_out(|layout| EncoderLayers::new(layout, "layer", [7, 6], encoder));
    let weights: Vec<T> = real(&case.flat("weight", &parameters));
    let input: Vec<T> = case.real("input.window");
    let rows = input.len() / (4 * 7);
    let mut record = EncoderRecord::default();
    let mut out = vec![T::ZERO; rows * 6];
    layers.forward(&weights, (&input, 7), None, &mut record, &mut out);
    case.compare("output", &out, &case.tensor("output.rows"));
    // All states of the second layer, and the last of both: the first state kept is the zero one.
    let size = rows * 6;
    let states = [0, 1].map(|layer| record.gru.states[layer][size..].to_vec());
    case.compare("states", &states[1], &case.tensor("output.states"));
    let last = states.map(|states| states[3 * size..].to_vec()).concat();
    case.compare("last states", &last, &case.tensor("output.last"));
    let mut gradient = vec![T::ZERO; weights.len()];
    let mut by_input = vec![T::ZERO; input.len()];
    let ends = EncoderEnds {
        to_input: Some(&mut by_input),
        output: &mut case.real("cotangent.rows"),
    };
    layers.backward(
        (&weights, &mut gradient),
        (&input, 7),
        None,
        &mut record,
        ends,
    );
    case.compare("input", &by_input, &case.tensor("gradient.input.window"));
    case.compare_weights(&parameters, &gradient);
    case.tell();
}

fn block_case<T: Real>() {
    let mut case = Case::new::<T>("block");
    let (graph, order) = cloth();
    let (block, parameters) = laid_out(|layout| Block::new(layout, "layer", 5));
    let weights: Vec<T> = real(&case.flat("weight", &parameters));
    let mut nodes: Vec<T> = case.real("input.nodes");
    let arcs = |case: &Case, name: &str| reordered(&case.tensor(name), &order, 5);
    let mut edges: Vec<T> = real(&arcs(&case, "input.edges"));
    let (mut record, mut scratch) = (BlockRecord::default(), BlockScratch::default());
    let mut latents = Latents {
        nodes: &mut nodes,
        edges: &mut edges,
    };
    block.forward(&weights, &graph, &mut latents, &mut record, &mut scratch);
    case.compare("nodes", &nodes, &case.tensor("output.nodes"));
    case.compare("edges", &edges, &arcs(&case, "output.edges"));
    let mut gradient = vec![T::ZERO; weights.len()];
    let mut nodes: Vec<T> = case.real("cotangent.nodes");
    let mut edges: Vec<T> = real(&arcs(&case, "cotangent.edges"));
    let mut latents = Latents {
        nodes: &mut nodes,
        edges: &mut edges,
    };
    let both = (&*weights, &mut *gradient);
    block.backward(both, &graph, &mut latents, &mut record, &mut scratch);
    case.compare("nodes", &nodes, &case.tensor("gradient.input.nodes"));
    case.compare("edges", &edges, &arcs(&case, "gradient.input.edges"));
    case.compare_weights(&parameters, &gradient);
    case.tell();
}

fn network_case<T: Real>(name: &'static str, encoder: Encoder) {
    let mut case = Case::new::<T>(name);
    let (graph, order) = cloth();
    let network = Network::new(&ModelSpec::physical(encoder, 6, 2)).expect("a valid spec");
    let weights: Vec<T> = real(&case.flat("weight", network.parameters()));
    let nodes: Vec<T> = case.real("input.nodes");
    let edges: Vec<T> = real(&reordered(&case.tensor("input.edges"), &order, 10));
    let input = Input {
        nodes: &nodes,
        edges: &edges,
    };
    let mut workspace = Workspace::new();
    let out = network.forward(
        &weights,
        &graph,
        input,
        Pass::Training(None),
        &mut workspace,
    );
    let out = out.to_vec();
    case.compare("output", &out, &case.tensor("output.rows"));
    let mut gradient = vec![T::ZERO; weights.len()];
    let [mut by_nodes, mut by_edges] = [&nodes, &edges].map(|x| vec![T::ZERO; x.len()]);
    let gradients = Gradients {
        weights: &mut gradient,
        input: Some(InputGradient {
            nodes: &mut by_nodes,
            edges: &mut by_edges,
        }),
    };
    let output: Vec<T> = case.real("cotangent.rows");
    network.backward(
        (&weights, gradients),
        &graph,
        input,
        &output,
        &mut workspace,
    );
    case.compare("nodes", &by_nodes, &case.tensor("gradient.input.nodes"));
    let expected = reordered(&case.tensor("gradient.input.edges"), &order, 10);
    case.compare("edges", &by_edges, &expected);
    case.compare_weights(network.parameters(), &gradient);
    case.tell();
}

#[test]
fn layer_norm_is_pytorchs() {
    layer_norm_case::<f64>();
    layer_norm_case::<f32>();
}

#[test]
fn the_perceptron_is_pytorchs() {
    mlp_case::<f64>();
    mlp_case::<f32>();
}

#[test]
fn the_recurrent_encoder_is_pytorchs() {
    gru_case::<f64>();
    gru_case::<f32>();
}

#[test]
fn a_graph_block_is_pytorchs() {
    block_case::<f64>();
    block_case::<f32>();
}

#[test]
fn the_whole_network_is_pytorchs() {
    for (name, encoder) in [
        ("network-mlp", Encoder::Mlp { window: 2 }),
        ("network-gru", Encoder::Gru { window: 3 }),
    ] {
        network_case::<f64>(name, encoder);
        network_case::<f32>(name, encoder);
    }
}
