//! Passes on a GPU against the processor's engine and against the network as its equations are
//! written.

use std::sync::Arc;

use selvedge_model::{
    Connectivity, Dropout, EdgeFeature, Encoder, Gradients, Input, InputGradient, Instructions,
    ModelSpec, Network, NetworkScalar, Pass, Purpose, Window, Workspace,
};

use crate::gpu::Gpu;
use crate::passes::{Passes, Training, side_by_side};
use crate::test_graphs::{gpu, numbers, specs, squares, weights};

#[path = "../../selvedge-model/tests/model/reference.rs"]
mod reference;

/// Numbers that two engines are given.
struct Given {
    network: Network,
    graph: Connectivity,
    weights: Vec<f32>,
    nodes: Vec<f32>,
    arcs: Vec<f32>,
    /// The gradient of the output.
    output: Vec<f32>,
}

impl Given {
    fn new(spec: &ModelSpec, counts: &[usize]) -> Self {
        let (network, graph) = (Network::new(spec).expect("a spec"), squares(counts));
        let nodes = spec.window() * graph.vertex_count() * spec.node_width();
        let arcs = spec.window() * graph.arc_count() * spec.edge_width();
        Self {
            weights: weights(&network, 3),
            nodes: numbers(nodes, 1.5, 1),
            arcs: numbers(arcs, 1.5, 2),
            output: numbers(3 * graph.vertex_count(), 1.0, 4),
            network,
            graph,
        }
    }

    fn passes(&self, gpu: &Arc<Gpu>, training: Option<Training>) -> Passes {
        let passes = Passes::new(gpu, &self.network, &self.graph, training, None);
        let passes = passes.expect("room");
        passes.set_weights(&self.weights);
        passes
    }

    fn forward(&self, passes: &mut Passes, seeds: &[u64]) -> Vec<f32> {
        let input = Window {
            nodes: self.nodes.clone(),
            arcs: self.arcs.clone(),
        };
        passes.forward(0, &input, seeds).expect("a pass")
    }

    /// The same numbers as `T`: weights, features of vertices and of arcs, gradient of the output.
    fn wide<T: NetworkScalar>(&self) -> [Vec<T>; 4] {
        let all = [&self.weights, &self.nodes, &self.arcs, &self.output];
        all.map(|x| x.iter().map(|&x| T::from_f64(f64::from(x))).collect())
    }
}

/// The largest difference, relative to the largest number.
fn off(found: &[f32], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let pairs = found.iter().zip(expected);
    let most = pairs.fold(0.0_f64, |most, (&x, y)| {
        let off = (f64::from(x) - y).abs();
        if off.is_nan() { f64::INFINITY } else { most.max(off) }
    });
    most / largest.max(f64::MIN_POSITIVE)
}

/// The presets at small sizes that do and do not fill a tile, and one at the paper's.
fn presets() -> Vec<ModelSpec> {
    let mut specs = specs();
    specs.push(ModelSpec::physical(Encoder::Gru { window: 5 }, 16, 2));
    specs.push(ModelSpec::physical(Encoder::Gru { window: 10 }, 16, 1));
    let mut full = ModelSpec::physical(Encoder::MLP, 70, 2);
    full.edge_features.insert(EdgeFeature::MaterialVector);
    specs.push(full);
    specs
}

#[test]
fn the_forward_pass_is_that_of_the_processor_and_of_the_equations() {
    let Some(gpu) = gpu() else { return };
    let mut worst = 0.0_f64;
    for spec in presets() {
        let given = Given::new(&spec, &[30, 17]);
        let mut workspace = Workspace::new();
        let input = Input {
            nodes: &given.nodes[..],
            arcs: &given.arcs,
        };
        let (network, graph) = (&given.network, &given.graph);
        let (purpose, pass) = (Purpose::Inference, Pass::Inference);
        let packed = network.pack(&given.weights, purpose, Instructions::Detected);
        let cpu = network.forward_packed(&packed, graph, input, pass, &mut workspace);
        let cpu = cpu.expect("nobody stops it").iter();
        let cpu: Vec<f64> = cpu.map(|&x| f64::from(x)).collect();
        let [weights, nodes, arcs, _] = given.wide::<f64>();
        let input = Input {
            nodes: &nodes[..],
            arcs: &arcs,
        };
        let exact = reference::forward(network, &weights, graph, input);
        let training = Training {
            frames: 1,
            dropout: 0.0,
        };
        for training in [None, Some(training)] {
            let found = given.forward(&mut given.passes(&gpu, training), &[]);
            for expected in [&cpu, &exact] {
                let off = off(&found, expected);
                worst = worst.max(off);
                assert!(off < 1e-5, "{off} with {:?}", spec.encoder);
            }
        }
    }
    eprintln!("forward: {worst:.1e} off at most");
}

#[test]
fn cloths_in_a_union_give_what_each_gives_alone_to_the_last_bit() {
    let Some(gpu) = gpu() else { return };
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 12, 2);
    let counts: Vec<usize> = (0..16).map(|n| 9 + 7 * (n % 5)).collect();
    let features = |given: &Given, seed| Window {
        nodes: numbers(given.nodes.len(), 1.5, seed),
        arcs: numbers(given.arcs.len(), 1.5, seed + 1),
    };
    let alone = counts.iter().enumerate().map(|(cloth, &count)| {
        let given = Given::new(&spec, &[count]);
        let window = features(&given, 2 * cloth as u64);
        let output = given.passes(&gpu, None).forward(0, &window, &[]);
        (window, output.expect("a pass"))
    });
    let (windows, outputs): (Vec<Window>, Vec<Vec<f32>>) = alone.unzip();
    let union = side_by_side(&spec, &windows.iter().collect::<Vec<_>>());
    let mut all = Given::new(&spec, &counts).passes(&gpu, None);
    let found = all.forward(0, &union, &[]).expect("a pass");
    assert_eq!(found, outputs.concat());
}

#[test]
fn launches_of_a_frame_are_few() {
    let Some(gpu) = gpu() else { return };
    for (encoder, most) in [
        (Encoder::MLP, 149),
        (Encoder::Gru { window: 5 }, 165),
        (Encoder::Gru { window: 10 }, 185),
    ] {
        let given = Given::new(&ModelSpec::physical(encoder, 8, 15), &[9]);
        let found = given.passes(&gpu, None).launches();
        eprintln!("{encoder:?}, 15 blocks: {found} launches");
        assert!(found <= most, "{encoder:?}: {found}");
    }
}

const SEEDS: [u64; 2] = [0x1234_5678_9abc_def0, 0xfedc_ba98_7654_3210];

/// Gradients of weights, of features of vertices and of arcs on the processor.
fn on_processor<T: NetworkScalar>(given: &Given, rate: f64) -> [Vec<f64>; 3] {
    let (network, graph) = (&given.network, &given.graph);
    let [weights, nodes, arcs, output] = given.wide::<T>();
    let packed = network.pack(&weights, Purpose::Training, Instructions::Detected);
    let input = Input {
        nodes: &nodes[..],
        arcs: &arcs,
    };
    let dropout = Dropout {
        rate,
        seeds: &SEEDS,
    };
    let mut workspace = Workspace::new();
    let pass = Pass::Training((rate > 0.0).then_some(dropout));
    let out = network.forward_packed(&packed, graph, input, pass, &mut workspace);
    out.expect("nobody stops it");
    let mut all = [&weights, &nodes, &arcs].map(|x| vec![T::ZERO; x.len()]);
    let [by_weights, nodes, arcs] = &mut all;
    let gradients = Gradients {
        output: &output,
        weights: by_weights,
        input: Some(InputGradient { nodes, arcs }),
    };
    let back = network.backward_packed(&packed, graph, input, gradients, &mut workspace);
    back.expect("nobody stops it");
    all.map(|x| x.iter().map(|x| x.to_f64()).collect())
}

/// |found - expected| / |expected|.
fn relative(found: &[f32], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let pairs = found.iter().zip(expected);
    let off = squares(&mut pairs.map(|(&x, &y)| f64::from(x) - y));
    let size = squares(&mut expected.iter().copied());
    (off / size.max(f64::MIN_POSITIVE)).sqrt()
}

/// Compares all gradients, tensor by tensor, and returns the largest difference.
fn compare_gradients(gpu: &Arc<Gpu>, given: &Given, rate: f64) -> f64 {
    let training = Training {
        frames: 1,
        dropout: rate,
    };
    let mut passes = given.passes(gpu, Some(training));
    given.forward(&mut passes, &SEEDS);
    passes.clear_gradient();
    let input = passes.backward_to_input(0, &given.output).expect("a pass");
    let weights = passes.gradient(0..given.weights.len()).expect("a gradient");
    let exact = on_processor::<f64>(given, rate);
    let mut worst = 0.0_f64;
    let mut near = |name: &str, found: &[f32], exact: &[f64]| {
        let off = relative(found, exact);
        worst = worst.max(off);
        let encoder = given.network.spec().encoder;
        assert!(
            off < 1e-4,
            "{off} in {name} with {encoder:?}, dropout {rate}"
        );
    };
    for parameter in given.network.parameters() {
        let range = parameter.range.clone();
        near(&parameter.name, &weights[range.clone()], &exact[0][range]);
    }
    near("vertices", &input.nodes, &exact[1]);
    near("arcs", &input.arcs, &exact[2]);
    // Without the features, and once more on top of what is there.
    passes.backward(0, &given.output).expect("a pass");
    let twice = passes.gradient(0..given.weights.len()).expect("a gradient");
    let doubled: Vec<f64> = weights.iter().map(|&g| 2.0 * f64::from(g)).collect();
    assert!(relative(&twice, &doubled) < 1e-6);
    worst
}

#[test]
fn gradients_of_weights_and_features_are_those_of_the_processor() {
    let Some(gpu) = gpu() else { return };
    let mut worst = 0.0_f64;
    for spec in presets() {
        let given = Given::new(&spec, &[30, 17]);
        worst = worst.max(compare_gradients(&gpu, &given, 0.0));
    }
    eprintln!("gradients: {worst:.1e} off at most");
}

#[test]
fn the_same_values_are_dropped_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    for spec in presets().into_iter().filter(|spec| spec.window() > 1) {
        let given = Given::new(&spec, &[40, 23]);
        compare_gradients(&gpu, &given, 0.3);
    }
}

#[test]
fn the_same_pass_twice_gives_the_same_bytes() {
    let Some(gpu) = gpu() else { return };
    let given = Given::new(
        &ModelSpec::physical(Encoder::Gru { window: 3 }, 20, 2),
        &[30],
    );
    let training = Training {
        frames: 1,
        dropout: 0.2,
    };
    let run = || {
        let mut passes = given.passes(&gpu, Some(training));
        let output = given.forward(&mut passes, &SEEDS[..1]);
        passes.clear_gradient();
        passes.backward(0, &given.output).expect("a pass");
        [
            output,
            passes.gradient(0..given.weights.len()).expect("a gradient"),
        ]
        .map(|x| {
            let bits: Vec<u32> = x.iter().map(|x| x.to_bits()).collect();
            bits
        })
    };
    assert_eq!(run(), run());
}
