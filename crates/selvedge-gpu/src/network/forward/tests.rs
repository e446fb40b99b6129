//! The forward pass on a device against the CPU engine and against the network as its equations
//! are written.

use selvedge_model::{Connectivity, Input, ModelSpec, Network, Pass, Workspace, reference};

use super::{ForwardPass, GraphArrays, InputArrays, Keep, Record, WeightArrays, forward};
use crate::device::Precision;
use crate::kernels::layers;
use crate::kernels::{Program, Sizes};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Schedule, Trace};
pub(crate) use crate::test_graphs::device;
use crate::test_graphs::{numbers, specs, squares, weights};

/// A network on a graph, lowered.
struct Lowered {
    plan: Plan,
    program: Program,
    weights: WeightArrays,
    graph: GraphArrays,
    input: InputArrays,
    record: Record,
    pack: Schedule,
    forward: Schedule,
}

impl Lowered {
    fn new(network: &Network, graph: &Connectivity, keep: Keep) -> Self {
        let mut plan = Plan::new();
        let mut program = Program::new(Sizes::of(network.spec()));
        program.add(&layers::PART);
        let weights = WeightArrays::new(&mut plan, network);
        let graph = GraphArrays::new(&mut plan, graph.vertex_count(), graph.arc_count());
        let input = InputArrays::new(&mut plan, network, &graph);
        let mut pack = Schedule::new("pack");
        weights.pack(&mut pack);
        let mut schedule = Schedule::new("forward");
        let pass = ForwardPass {
            network,
            weights: &weights,
            graph: &graph,
            input: &input,
            keep,
        };
        let record = forward(&mut plan, &mut schedule, pass);
        Self {
            plan,
            program,
            weights,
            graph,
            input,
            record,
            pack,
            forward: schedule,
        }
    }

    /// The arrays that are written from outside.
    fn given(&self) -> Vec<Region> {
        let mut given = vec![self.weights.flat(), self.input.nodes, self.input.arcs];
        given.extend(self.graph.regions());
        given
    }
}

fn features(spec: &ModelSpec, graph: &Connectivity) -> [Vec<f32>; 2] {
    let nodes = spec.window() * graph.vertex_count() * spec.node_width();
    let edges = spec.window() * graph.arc_count() * spec.edge_width();
    [numbers(nodes, 1.5, 1), numbers(edges, 1.5, 2)]
}

fn worst(found: &[f32], expected: impl IntoIterator<Item = f64>) -> f64 {
    let pairs = found.iter().map(|&x| f64::from(x)).zip(expected);
    pairs.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn schedules_read_what_they_wrote_and_stay_within_their_regions() {
    for spec in specs() {
        let graph = squares(&[30, 17]);
        let network = Network::new(&spec).expect("a spec");
        for keep in [Keep::Output, Keep::Activations(None)] {
            let lowered = Lowered::new(&network, &graph, keep);
            let mut trace = Trace::new(&lowered.plan, lowered.program.sizes());
            lowered
                .given()
                .into_iter()
                .for_each(|region| trace.give(region));
            trace.follow(&lowered.pack).expect("packing");
            trace.follow(&lowered.forward).expect("a forward pass");
            assert!(trace.holds(lowered.record.output));
            if keep != Keep::Output {
                for block in &lowered.record.blocks {
                    let kept = [block.before, block.after].concat();
                    assert!(kept.into_iter().all(|region| trace.holds(region)));
                    assert!(trace.holds(block.arc.hidden1) && trace.holds(block.node.hidden2));
                }
            }
        }
    }
}

#[test]
fn to_keep_nothing_takes_memory_that_does_not_grow_with_blocks() {
    let graph = squares(&[30]);
    let words = |blocks| {
        let spec = ModelSpec::physical(selvedge_model::Encoder::MLP, 16, blocks);
        let network = Network::new(&spec).expect("a spec");
        let lowered = Lowered::new(&network, &graph, Keep::Output);
        let weights = network.parameter_count() + blocks * 2 * 16 * 16;
        lowered.plan.words() - weights
    };
    // The arrays of weights alone are rounded up.
    assert!(words(9).abs_diff(words(1)) < 128);
}

#[test]
fn the_forward_pass_is_that_of_the_cpu_and_of_the_equations() {
    let device = device();
    for spec in specs() {
        let graph = squares(&[30, 17]);
        let network = Network::new(&spec).expect("a spec");
        let (weights, [nodes, edges]) = (weights(&network, 3), features(&spec, &graph));
        let input = Input {
            nodes: &nodes,
            arcs: &edges,
        };
        let mut workspace = Workspace::new();
        let cpu = network.forward(&weights, &graph, input, Pass::Inference, &mut workspace);
        let doubles = |values: &[f32]| values.iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
        let [weights64, nodes64, edges64] = [&weights, &nodes, &edges].map(|v| doubles(v));
        let input = Input {
            nodes: &nodes64,
            arcs: &edges64,
        };
        let exact = reference::forward(&network, &weights64, &graph, input);
        for keep in [Keep::Output, Keep::Activations(None)] {
            let lowered = Lowered::new(&network, &graph, keep);
            let mut loaded = device
                .load(&lowered.program, &lowered.plan, Precision::Full)
                .expect("kernels");
            lowered.graph.upload(&mut *loaded, &graph).expect("a graph");
            loaded
                .put(lowered.weights.flat(), &weights)
                .expect("weights");
            loaded.put(lowered.input.nodes, &nodes).expect("features");
            loaded.put(lowered.input.arcs, &edges).expect("features");
            for schedule in [&lowered.pack, &lowered.forward] {
                let prepared = loaded.prepare(schedule).expect("a schedule");
                loaded.run(prepared).expect("a run");
            }
            let found = loaded.get(lowered.record.output).expect("an output");
            let off = worst(&found, cpu.iter().map(|&x| f64::from(x)));
            assert!(off < 1e-5, "{off} off the CPU with {:?}", spec.encoder);
            let off = worst(&found, exact.iter().copied());
            assert!(
                off < 1e-5,
                "{off} off the equations with {:?}",
                spec.encoder
            );
        }
    }
}
