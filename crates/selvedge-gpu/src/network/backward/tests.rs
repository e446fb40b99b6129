//! The backward pass on a device against the CPU engine's, for every encoder and with dropout.

use selvedge_model::{
    Connectivity, Dropout as CpuDropout, Gradients, Input, InputGradient, Network, NetworkScalar,
    Pass, Purpose, Workspace,
};

use super::{BackwardPass, backward};
use crate::device::{Loaded, Precision};
use crate::kernels::{Program, Sizes};
use crate::kernels::{backward as kernels, layers};
use crate::network::{
    Dropout, DropoutSizes, ForwardPass, GraphArrays, InputArrays, Keep, OUTPUTS, Record,
    WeightArrays, forward,
};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Schedule, Trace};
use crate::test_graphs::{device, numbers, specs, squares, weights};

const RATE: f64 = 0.3;
/// Squares of a graph, each with its seed.
const CLOTHS: usize = 2;
const SEEDS: [u64; CLOTHS] = [0x1234_5678_9abc_def0, 0xfedc_ba98_7654_3210];

/// A network on a graph, lowered both ways.
struct Lowered {
    plan: Plan,
    program: Program,
    weights: WeightArrays,
    gradient: Region,
    ones: Region,
    graph: GraphArrays,
    input: InputArrays,
    to_input: InputArrays,
    dropout: Option<Dropout>,
    output: Region,
    record: Record,
    schedules: [Schedule; 3],
}

impl Lowered {
    fn new(network: &Network, graph: &Connectivity, drops: bool) -> Self {
        let mut plan = Plan::new();
        let mut program = Program::new(Sizes::of(network.spec()));
        program.add(&layers::PART);
        program.add(&kernels::PART);
        let weights = WeightArrays::new(&mut plan, network);
        let gradient = plan.floats("gradient", network.parameter_count());
        let counts = [graph.vertex_count(), graph.arc_count()];
        let ones = plan.floats("ones", counts[0].max(counts[1]));
        let graph = GraphArrays::new(&mut plan, counts[0], counts[1]);
        let [input, to_input] = [(); 2].map(|()| InputArrays::new(&mut plan, network, &graph));
        let sizes = DropoutSizes {
            slots: CLOTHS,
            slot: counts.map(|rows| rows / CLOTHS),
            steps: network.spec().window(),
        };
        let dropout = Dropout::new(&mut plan, if drops { RATE } else { 0.0 }, sizes);
        let output = plan.floats("gradient of the output", counts[0] * OUTPUTS);
        let mut schedules = ["pack", "forward", "backward"].map(Schedule::new);
        weights.pack(&mut schedules[0]);
        let pass = ForwardPass {
            network,
            weights: &weights,
            graph: &graph,
            input: &input,
            keep: Keep::Activations(dropout),
        };
        let record = forward(&mut plan, &mut schedules[1], pass);
        let pass = BackwardPass {
            network,
            weights: &weights,
            gradient,
            ones,
            graph: &graph,
            input: &input,
            record: &record,
            dropout,
            output,
            to_input: Some(&to_input),
        };
        schedules[2].clear(gradient);
        backward(&mut plan, &mut schedules[2], &pass);
        Self {
            plan,
            program,
            weights,
            gradient,
            ones,
            graph,
            input,
            to_input,
            dropout,
            output,
            record,
            schedules,
        }
    }

    fn follow(&self) {
        let mut trace = Trace::new(&self.plan, self.program.sizes());
        let mut given = vec![self.weights.flat(), self.input.nodes, self.input.arcs];
        given.extend(self.graph.regions());
        given.extend([self.ones, self.output]);
        if let Some(dropout) = &self.dropout {
            given.extend(dropout.seeds);
        }
        given.into_iter().for_each(|region| trace.give(region));
        for schedule in &self.schedules {
            trace.follow(schedule).expect("a schedule");
        }
        assert!(trace.holds(self.gradient) && trace.holds(self.to_input.nodes));
        assert!(trace.holds(self.record.output));
    }
}

/// Numbers that the two engines are given.
struct Given {
    weights: Vec<f32>,
    nodes: Vec<f32>,
    edges: Vec<f32>,
    output: Vec<f32>,
}

impl Given {
    fn new(network: &Network, lowered: &Lowered) -> Self {
        Self {
            weights: weights(network, 3),
            nodes: numbers(lowered.input.nodes.count(), 1.5, 1),
            edges: numbers(lowered.input.arcs.count(), 1.5, 2),
            output: numbers(lowered.output.count(), 1.0, 4),
        }
    }
}

/// The gradients of weights, of vertex features and of arc features.
type All = Vec<Vec<f32>>;

fn on_device(lowered: &Lowered, graph: &Connectivity, given: &Given) -> All {
    let device = device();
    let loaded = device.load(&lowered.program, &lowered.plan, Precision::Full);
    let mut loaded = loaded.expect("kernels");
    let loaded: &mut dyn Loaded = &mut *loaded;
    lowered.graph.upload(loaded, graph).expect("a graph");
    let ones = vec![1.0; lowered.ones.count()];
    let floats = [
        (lowered.weights.flat(), &given.weights),
        (lowered.input.nodes, &given.nodes),
        (lowered.input.arcs, &given.edges),
        (lowered.output, &given.output),
        (lowered.ones, &ones),
    ];
    for (region, values) in floats {
        loaded.put(region, values).expect("room");
    }
    if let Some(dropout) = &lowered.dropout {
        dropout.upload(&mut *loaded, &SEEDS).expect("room");
    }
    for schedule in &lowered.schedules {
        let prepared = loaded.prepare(schedule).expect("a schedule");
        loaded.run(prepared).expect("a run");
    }
    let regions = [
        lowered.gradient,
        lowered.to_input.nodes,
        lowered.to_input.arcs,
    ];
    let got = regions
        .into_iter()
        .map(|r| loaded.get(r).expect("a result"));
    got.collect()
}

fn on_cpu<T: NetworkScalar>(
    network: &Network,
    graph: &Connectivity,
    given: &Given,
    drops: bool,
) -> Vec<Vec<f64>> {
    let using = selvedge_model::Instructions::Detected;
    let scalar = |x: f32| T::from_f64(f64::from(x));
    let [given_weights, given_nodes, given_edges, given_output] =
        [&given.weights, &given.nodes, &given.edges, &given.output]
            .map(|numbers| numbers.iter().map(|&x| scalar(x)).collect::<Vec<T>>());
    let packed = network.pack(&given_weights, Purpose::Training, using);
    let input = Input {
        nodes: &given_nodes,
        arcs: &given_edges,
    };
    let dropout = drops.then_some(CpuDropout {
        rate: RATE,
        seeds: &SEEDS,
    });
    let mut workspace = Workspace::new();
    let pass = Pass::Training(dropout);
    let out = network.forward_packed(&packed, graph, input, pass, &mut workspace);
    out.expect("nobody stops it");
    let mut all = [&given.weights, &given.nodes, &given.edges].map(|x| vec![T::ZERO; x.len()]);
    let [weights, nodes, edges] = &mut all;
    let gradients = Gradients {
        output: &given_output,
        weights,
        input: Some(InputGradient { nodes, arcs: edges }),
    };
    let back = network.backward_packed(&packed, graph, input, gradients, &mut workspace);
    back.expect("nobody stops it");
    let wide = |numbers: &Vec<T>| numbers.iter().map(|x| x.to_f64()).collect();
    all.iter().map(wide).collect()
}

/// |found - expected| / |expected|.
fn relative(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let pairs = found.iter().zip(expected);
    let off = squares(&mut pairs.map(|(&x, &y)| x - y));
    let size = squares(&mut expected.iter().copied());
    (off / size.max(f64::MIN_POSITIVE)).sqrt()
}

fn compare(network: &Network, graph: &Connectivity, drops: bool) {
    let lowered = Lowered::new(network, graph, drops);
    lowered.follow();
    let given = Given::new(network, &lowered);
    let found = on_device(&lowered, graph, &given);
    let narrow = on_cpu::<f32>(network, graph, &given, drops);
    let exact = on_cpu::<f64>(network, graph, &given, drops);
    let what = format!("{:?}, dropout {drops}", network.spec().encoder);
    // Weights over tokens have gradients that nearly cancel: there the CPU's own f32 are farther
    // off.
    let near = |name: &str, found: &[f64], narrow: &[f64], exact: &[f64]| {
        let (off, own) = (relative(found, exact), relative(narrow, exact));
        let bound = f64::max(1e-4, 4.0 * own);
        assert!(
            off < bound,
            "{off} off in {name} with {what}, the CPU {own}"
        );
        let is_token = name.contains("tokens.slice");
        assert!(
            is_token || own < 1e-4,
            "the CPU is {own} off in {name} with {what}"
        );
    };
    let wide: Vec<Vec<f64>> = found
        .iter()
        .map(|numbers| numbers.iter().map(|&x| f64::from(x)).collect())
        .collect();
    for parameter in network.parameters() {
        let [found, narrow, exact] = [&wide, &narrow, &exact].map(|all| {
            let range = parameter.range.clone();
            &all[0][range]
        });
        near(&parameter.name, found, narrow, exact);
    }
    let others = wide.iter().zip(&narrow).zip(&exact).enumerate();
    for (number, ((found, narrow), exact)) in others.skip(1) {
        near(&format!("gradient {number}"), found, narrow, exact);
    }
}

#[test]
fn gradients_of_weights_and_features_are_those_of_the_cpu() {
    for spec in specs() {
        let graph = squares(&[30, 17]);
        let network = Network::new(&spec).expect("a spec");
        compare(&network, &graph, false);
    }
}

#[test]
fn the_same_values_are_dropped_as_on_the_cpu() {
    // Several leaves and several chunks; slots of one size.
    for spec in specs().into_iter().filter(|spec| spec.window() > 1) {
        let graph = squares(&[150; CLOTHS]);
        let network = Network::new(&spec).expect("a spec");
        compare(&network, &graph, true);
    }
}
