//! The layers and whole networks against PyTorch: tests/pytorch/layers.safetensors, which
//! tests/pytorch/generate.py wrote beside it. PyTorch's outputs and gradients are f64: ours in f64
//! must be the same but for the order of sums, ours in f32 within 1e-5 of the largest entry of each
//! tensor. `cargo test -p selvedge-model pytorch -- --nocapture` prints the largest differences.

// What is measured is there to be read.
#![allow(clippy::print_stdout)]

use std::collections::{BTreeMap, BTreeSet};

use selvedge_cloth::Topology;

use super::block::{Block, BlockInput, BlockKept, BlockRecord};
use super::block_rows::{ArcGradients, ArcRows, NodeGradients, NodeRows};
use super::encoder::{
    EncoderGradients, EncoderInput, EncoderKept, EncoderLayers, EncoderRecord, EncoderRows,
};
use super::mlp::{Mlp, MlpGradients, MlpRecord};
use super::scratch::{GroupScratch, GroupWork, Scratch};
use crate::graph::connectivity::Connectivity;
use crate::graph::share::Rows;
use crate::kernels::gemm::{Columns, Epilogue, multiply};
use crate::kernels::norm::{
    NormGradient, NormKept, NormRows, Normalised, layer_norm, layer_norm_backward,
};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::network::packed::{
    LayerWeights, ModuleBuilder, ModuleSize, PackedModule, Packer, Piece, Purpose,
};
use crate::network::parameters::{ModuleGradient, Parameter};
use crate::network::workspace::Workspace;
use crate::network::{Gradients, Input, InputGradient, Network, NetworkScalar, Pass};
use crate::spec::{Encoder, ModelSpec};

const USING: Instructions = Instructions::Detected;

#[path = "../../../tests/pytorch/fixture.rs"]
mod fixture;

const FIXTURE: &[u8] = include_bytes!("../../../tests/pytorch/layers.safetensors");

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

/// A layer by itself, its parameters under PyTorch's names without a path, and room for its
/// matrices.
fn laid_out<L>(make: impl FnOnce(&mut ModuleBuilder) -> L) -> (L, Vec<Parameter>, ModuleSize) {
    let mut module = ModuleBuilder::default();
    let layer = make(&mut module);
    let ModuleBuilder { layout, size } = module;
    let mut parameters = layout.finish();
    for parameter in &mut parameters {
        parameter.name = parameter.name.replacen("layer.", "", 1);
    }
    (layer, parameters, size)
}

/// The packed matrices of a layer.
fn packed<T: Real>(
    size: &ModuleSize,
    flat: &[T],
    pack: impl FnOnce(&mut Packer<'_, T>),
) -> PackedModule<T> {
    let mut module = PackedModule::new(size, Purpose::Training);
    let mut packer = Packer {
        instructions: USING,
        flat,
        module: &mut module,
    };
    pack(&mut packer);
    module
}

fn layer<'a, T>(flat: &'a [T], module: &'a PackedModule<T>) -> LayerWeights<'a, T> {
    LayerWeights {
        instructions: USING,
        flat,
        module,
    }
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
    let norm = NormRows {
        normal: &mut normal,
        inverse_deviation: &mut inverse_deviation,
    };
    layer_norm(USING, norm, &weight, &shift, Normalised::Set(&mut out));
    case.compare("output", &out, &case.tensor("output.rows"));
    let mut gradient: Vec<T> = case.real("cotangent.rows");
    let [mut by_weight, mut by_shift] = [(); 2].map(|()| vec![T::ZERO; weight.len()]);
    let kept = NormKept {
        normal: &normal,
        inverse_deviation: &inverse_deviation,
    };
    let sums = NormGradient {
        weight: &mut by_weight,
        shift: &mut by_shift,
    };
    layer_norm_backward(USING, &mut gradient, kept, &weight, sums);
    case.compare("input", &gradient, &case.tensor("gradient.input.rows"));
    case.compare("weight", &by_weight, &case.tensor("gradient.weight.weight"));
    case.compare("bias", &by_shift, &case.tensor("gradient.weight.bias"));
    case.tell();
}

fn mlp_case<T: Real>() {
    let mut case = Case::new::<T>("mlp");
    let ((mlp, first), parameters, size) = laid_out(|module| {
        let mlp = Mlp::normalised(module, "layer", 7, 6);
        (mlp, Piece::whole(&mut module.size, &mlp.first))
    });
    let flat: Vec<T> = real(&case.flat("weight", &parameters));
    let module = packed(&size, &flat, |packer| {
        mlp.pack(packer);
        first.pack(packer);
    });
    let weights = layer(&flat, &module);
    let input: Vec<T> = case.real("input.rows");
    let rows = input.len() / 7;
    let mut record = MlpRecord::default();
    record.fit(&mlp, rows);
    let mut out = vec![T::ZERO; rows * 6];
    let mut scratch = Scratch::default();
    let mut tile = scratch.tiles.tile(record.rows(&mlp), rows, 6);
    let terms = &[first.times(weights, &input)];
    mlp.first_layer(weights, terms, mlp.first_epilogue(weights), &mut tile);
    mlp.forward(weights, tile, Normalised::Set(&mut out));
    case.compare("output", &out, &case.tensor("output.rows"));
    let mut gradient = vec![T::ZERO; flat.len()];
    let mut sums = ModuleGradient::new(&mut gradient, 0);
    let mut output: Vec<T> = case.real("cotangent.rows");
    let [mut hidden, mut by_first] = [(); 2].map(|()| vec![T::ZERO; rows * 6]);
    let kept = record.tile(&mlp, &(0..rows));
    let gradients = MlpGradients {
        output: &mut output,
        hidden: &mut hidden,
        pre_activation: &mut by_first,
    };
    mlp.backward(weights, kept, gradients, &mut sums);
    let (left, right) = (Columns::all(&by_first, 6), Columns::all(&input, 7));
    mlp.first_backward(weights, 0, left, right, &mut sums);
    let mut by_input = vec![T::ZERO; input.len()];
    let term = first.back(weights, &by_first);
    multiply(USING, &[term], 7, Epilogue::Set, &mut by_input);
    case.compare("input", &by_input, &case.tensor("gradient.input.rows"));
    case.compare_weights(&parameters, &gradient);
    case.tell();
}

/// Rows of four frames of seven columns, frame by frame as the fixture has them.
fn frame_by_frame<T: Real>(rows: &[T]) -> Vec<T> {
    let frame = |frame: usize| rows.chunks_exact(28).map(move |row| &row[frame * 7..][..7]);
    (0..4).flat_map(frame).flatten().copied().collect()
}

fn gru_case<T: Real>() {
    let mut case = Case::new::<T>("gru");
    let (layers, parameters, size) =
        laid_out(|module| EncoderLayers::new(module, "layer", Encoder::Gru { window: 4 }, 7, 6));
    let flat: Vec<T> = real(&case.flat("weight", &parameters));
    let module = packed(&size, &flat, |packer| layers.pack(packer));
    let features: Vec<T> = case.real("input.window");
    let rows = features.len() / (4 * 7);
    let input = EncoderInput {
        window: 4,
        features: &features,
        width: 7,
        dropout: None,
        start: [&[], &[]],
    };
    let mut record = EncoderRecord::default();
    record.fit(&layers, rows, 4, None);
    let mut out = vec![T::ZERO; rows * 6];
    let mut written = EncoderRows {
        out: Rows::new(&mut out, 6),
        record: record.rows(&layers),
        end: Default::default(),
    };
    let mut scratch = Scratch::default();
    scratch.fit(6, 28, 6);
    let weights = layer(&flat, &module);
    layers.forward(weights, input, 0..rows, &mut written, &mut scratch);
    case.compare("output", &out, &case.tensor("output.rows"));
    // All states of the second layer, and the last of both: the first state kept is the zero one.
    let size = rows * 6;
    let states = [0, 1].map(|layer| record.gru.states[layer][size..].to_vec());
    case.compare("states", &states[1], &case.tensor("output.states"));
    let last = states.map(|states| states[3 * size..].to_vec()).concat();
    case.compare("last states", &last, &case.tensor("output.last"));
    let mut gradient = vec![T::ZERO; flat.len()];
    let mut by_input = vec![T::ZERO; features.len()];
    let mut cotangent = case.real("cotangent.rows");
    let gradients = EncoderGradients {
        output: Rows::new(&mut cotangent, 6),
        input: Rows::new(&mut by_input, 28),
        start: Default::default(),
    };
    let mut scratch = group_scratch(6, 28, 6);
    let mut group = GroupWork {
        scratch: &mut scratch,
        gradient: ModuleGradient::new(&mut gradient, 0),
    };
    let kept = EncoderKept {
        rows: 0..rows,
        record: &record,
        end_gradient: [&[], &[]],
    };
    layers.backward(weights, input, kept, gradients, &mut group);
    let by_frame = frame_by_frame(&by_input);
    case.compare("input", &by_frame, &case.tensor("gradient.input.window"));
    case.compare_weights(&parameters, &gradient);
    case.tell();
}

fn group_scratch<T: Real>(latent: usize, joined: usize, states: usize) -> GroupScratch<T> {
    let mut scratch = GroupScratch::default();
    scratch.fit(latent, joined, states);
    scratch
}

fn block_rows<'a, T: Real>(
    block: &Block,
    record: &'a mut BlockRecord<T>,
    nodes: &'a mut [T],
    edges: &'a mut [T],
) -> (NodeRows<'a, T>, ArcRows<'a, T>) {
    let (node_record, arc_record) = record.rows(block);
    let nodes = NodeRows {
        nodes: Rows::new(nodes, 5),
        record: node_record,
    };
    let arcs = ArcRows {
        arcs: Rows::new(edges, 5),
        record: arc_record,
    };
    (nodes, arcs)
}

fn block_nodes<'a, T>(nodes: &'a mut [T], sums: &'a mut [T]) -> NodeGradients<'a, T> {
    NodeGradients {
        nodes: Rows::new(nodes, 5),
        sums: Rows::new(sums, 10),
    }
}

fn block_arcs<'a, T>(arcs: &'a mut [T], pre_activation: &'a mut [T]) -> ArcGradients<'a, T> {
    ArcGradients {
        arcs: Rows::new(arcs, 5),
        pre_activation: Rows::new(pre_activation, 5),
    }
}

/// Scratch of a forward pass of width 5.
fn scratch<T: Real>() -> Scratch<T> {
    let mut scratch = Scratch::default();
    scratch.fit(5, 0, 0);
    scratch
}

fn block_case<T: Real>() {
    let mut case = Case::new::<T>("block");
    let (graph, order) = cloth();
    let (block, parameters, size) =
        laid_out(|module| Block::new(module, "layer", &ModelSpec::mesh_graph_nets(5, 1)));
    let flat: Vec<T> = real(&case.flat("weight", &parameters));
    let module = packed(&size, &flat, |packer| block.pack(packer));
    let weights = layer(&flat, &module);
    let mut nodes: Vec<T> = case.real("input.nodes");
    let arcs = |case: &Case, name: &str| reordered(&case.tensor(name), &order, 5);
    let mut edges: Vec<T> = real(&arcs(&case, "input.edges"));
    let [partition] = &*graph.partitions else {
        panic!("one partition");
    };
    let mut products = vec![T::ZERO; 2 * nodes.len()];
    block.endpoint_products(weights, &nodes, &mut products);
    let mut record = BlockRecord::default();
    record.fit(&block, graph.vertex_count(), graph.arc_count());
    let (mut node_rows, arc_rows) = block_rows(&block, &mut record, &mut nodes, &mut edges);
    let input = BlockInput {
        graph: &graph,
        partition,
        endpoint_products: &products,
    };
    block.forward(weights, input, &mut node_rows, arc_rows, &mut scratch());
    case.compare("nodes", &nodes, &case.tensor("output.nodes"));
    case.compare("edges", &edges, &arcs(&case, "output.edges"));
    let mut gradient = vec![T::ZERO; flat.len()];
    nodes = case.real("cotangent.nodes");
    edges = real(&arcs(&case, "cotangent.edges"));
    let mut pre_activation = vec![T::ZERO; edges.len()];
    let mut group = GroupWork {
        scratch: &mut group_scratch(5, 0, 0),
        gradient: ModuleGradient::new(&mut gradient, 0),
    };
    let kept = BlockKept {
        graph: &graph,
        partition,
        record: &record,
    };
    let by_nodes = block_nodes(&mut nodes, &mut products);
    let by_arcs = block_arcs(&mut edges, &mut pre_activation);
    block.backward(weights, kept, by_nodes, by_arcs, &mut group);
    let by_nodes = block_nodes(&mut nodes, &mut products);
    block.endpoints_backward(weights, kept, &pre_activation, by_nodes, &mut group);
    case.compare("nodes", &nodes, &case.tensor("gradient.input.nodes"));
    case.compare("edges", &edges, &arcs(&case, "gradient.input.edges"));
    case.compare_weights(&parameters, &gradient);
    case.tell();
}

fn network_case<T: NetworkScalar>(name: &'static str, encoder: Encoder) {
    let mut case = Case::new::<T>(name);
    let (graph, order) = cloth();
    let network = Network::new(&ModelSpec::physical(encoder, 6, 2)).expect("a valid spec");
    let weights: Vec<T> = real(&case.flat("weight", network.parameters()));
    let nodes: Vec<T> = case.real("input.nodes");
    let edges: Vec<T> = real(&reordered(&case.tensor("input.edges"), &order, 10));
    let input = Input {
        nodes: &nodes,
        arcs: &edges,
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
    let output: Vec<T> = case.real("cotangent.rows");
    let gradients = Gradients {
        input: Some(InputGradient {
            nodes: &mut by_nodes,
            arcs: &mut by_edges,
        }),
        ..Gradients::new(&output, &mut gradient)
    };
    network.backward(&weights, &graph, input, gradients, &mut workspace);
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
    let encoder = Encoder::Gru { window: 3 };
    network_case::<f64>("network-gru", encoder);
    network_case::<f32>("network-gru", encoder);
}
