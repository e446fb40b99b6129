//! The network against its slow reference, its gradients against finite differences, its layout
//! against the paper's numbers, its results against the number of threads.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::Stop;
use selvedge_model::{
    Connectivity, Dropout, Encoder, Gradients, Input, InputGradient, Instructions, Model,
    ModelSpec, Network, OUTPUTS, Pass, Purpose, Stopped, Workspace,
};

use crate::reference;
use crate::specs::{both, forward, input, packed, specs};
use crate::strip::strip;

struct Case {
    network: Network,
    graph: Connectivity,
    weights: Vec<f64>,
    nodes: Vec<f64>,
    arcs: Vec<f64>,
}

fn case(spec: &ModelSpec, columns: u32, seed: u64) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let network = Network::new(spec).expect("a valid spec");
    let graph = strip(columns);
    // Shifted away from the constant start, so that weights of a LayerNorm are tested too.
    let start = network.initialise(&mut || rng.random::<f64>());
    let weights = start
        .iter()
        .map(|&w| f64::from(w) + 0.1 * (rng.random::<f64>() - 0.5))
        .collect();
    let mut numbers = |count: usize| {
        (0..count)
            .map(|_| 2.0 * rng.random::<f64>() - 1.0)
            .collect()
    };
    let nodes = numbers(spec.window() * graph.vertex_count() * spec.node_width());
    let arcs = numbers(spec.window() * graph.arc_count() * spec.edge_width());
    Case {
        network,
        graph,
        weights,
        nodes,
        arcs,
    }
}

impl Case {
    fn input(&self) -> Input<'_, f64> {
        input(&self.nodes, &self.arcs)
    }

    /// Weights, nodes and arcs in f32.
    fn narrow(&self) -> [Vec<f32>; 3] {
        [&self.weights, &self.nodes, &self.arcs].map(|x| x.iter().map(|&x| x as f32).collect())
    }

    fn objective(&self, weights: &[f64], pass: Pass<'_>) -> f64 {
        let packed = packed(&self.network, weights);
        let out = forward(&self.network, &packed, &self.graph, self.input(), pass);
        let terms = out.iter().enumerate();
        terms.map(|(k, x)| x * coefficient(k)).sum()
    }
}

fn coefficient(k: usize) -> f64 {
    ((k * 37 % 11) as f64 - 5.0) / 5.0
}

#[test]
fn parameter_counts_are_the_papers() {
    let count = |spec: &ModelSpec| Network::new(spec).expect("valid").parameter_count();
    let gru = Encoder::Gru { window: 10 };
    assert_eq!(count(&ModelSpec::physical(gru, 128, 15)), 2_605_955);
    assert_eq!(
        count(&ModelSpec::physical(Encoder::MLP, 128, 15)),
        2_334_595
    );
    assert_eq!(count(&ModelSpec::mesh_graph_nets(128, 15)), 2_333_699);
}

#[test]
fn the_fast_network_is_the_reference() {
    // 60 columns: more than one tile of arcs and of vertices, the last one shorter.
    for spec in specs() {
        let case = case(&spec, 60, 1);
        let expected = reference::forward(&case.network, &case.weights, &case.graph, case.input());
        for pass in [Pass::Inference, Pass::Training(None)] {
            let packed = packed(&case.network, &case.weights);
            let found = forward(&case.network, &packed, &case.graph, case.input(), pass);
            for (found, expected) in found.iter().zip(&expected) {
                // Sums of a few hundred terms of order one in another order.
                assert!(
                    (found - expected).abs() < 1e-11,
                    "{spec:?}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn f32_agrees_with_f64() {
    for spec in specs() {
        f32_agrees(&case(&spec, 60, 2), &format!("{spec:?}"));
    }
}

#[test]
fn f32_agrees_with_f64_on_trained_weights() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../assets/models/paper.safetensors"
    );
    let bytes = std::fs::read(file).expect("the shipped model");
    let model = Model::from_bytes(&bytes).expect("a model");
    let case = Case {
        weights: model.weights().iter().map(|&w| f64::from(w)).collect(),
        ..case(model.spec(), 60, 3)
    };
    f32_agrees(&case, "paper");
}

/// That the engine in `f32`, with wide instructions and with plain ones, is the reference but for
/// rounding.
fn f32_agrees(case: &Case, name: &str) {
    let expected = reference::forward(&case.network, &case.weights, &case.graph, case.input());
    let [weights, nodes, arcs] = case.narrow();
    let input = input(&nodes, &arcs);
    let scale = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    for instructions in [Instructions::Detected, Instructions::Plain] {
        let (network, graph, pass) = (&case.network, &case.graph, Pass::Inference);
        let packed = network.pack(&weights, Purpose::Inference, instructions);
        let found = forward(network, &packed, graph, input, pass);
        for (&found, expected) in found.iter().zip(&expected) {
            // A few roundings of 6e-8 per layer, amplified by LayerNorms: 1e-5 of the scale.
            let off = (f64::from(found) - expected).abs() / scale;
            assert!(off < 1e-5, "{name}, {instructions:?}: {off:e}");
        }
    }
}

#[test]
fn gradients_match_finite_differences_in_every_tensor() {
    let dropout = Dropout {
        rate: 0.2,
        seeds: &[7],
    };
    for (number, spec) in specs().iter().enumerate() {
        let dropout = [1, 4].contains(&number).then_some(dropout);
        let mut case = case(spec, 4, 3);
        let pass = Pass::Training(dropout);
        let count = case.graph.vertex_count() * OUTPUTS;
        let output: Vec<f64> = (0..count).map(coefficient).collect();
        let [mut nodes, mut arcs] = [&case.nodes, &case.arcs].map(|x| vec![f64::NAN; x.len()]);
        let by_input = InputGradient {
            nodes: &mut nodes,
            arcs: &mut arcs,
        };
        let (packed, of) = (
            packed(&case.network, &case.weights),
            (&case.graph, case.input()),
        );
        let [_, gradient] = both(&case.network, &packed, of, pass, &output, Some(by_input));
        check_input_gradient(&mut case, pass, &nodes, &arcs);
        for parameter in case.network.parameters() {
            let count = parameter.range.len();
            for k in (0..count).step_by((count / 5).max(1)) {
                let place = parameter.range.start + k;
                let slope = slope(&case, place, pass);
                let error = (slope - gradient[place]).abs();
                // Central differences of step 2e-6: error 4e-12 curvature + 1e-8 rounding; a ReLU
                // that switches within the step shows as a part of its slope.
                assert!(
                    error < 2e-7 * (1.0 + slope.abs()),
                    "{}[{k}]: slope {slope}, gradient {}",
                    parameter.name,
                    gradient[place]
                );
            }
        }
    }
}

/// The gradient of every seventh number of the input against finite differences.
fn check_input_gradient(case: &mut Case, pass: Pass<'_>, nodes: &[f64], arcs: &[f64]) {
    type Part = fn(&mut Case) -> &mut Vec<f64>;
    let parts: [(&str, Part, &[f64]); 2] = [
        ("nodes", |case| &mut case.nodes, nodes),
        ("arcs", |case| &mut case.arcs, arcs),
    ];
    let step = 1e-5;
    for (name, part, gradient) in parts {
        for place in (0..gradient.len()).step_by(7) {
            let mut at = |moved: f64| {
                part(case)[place] += moved;
                let value = case.objective(&case.weights, pass);
                part(case)[place] -= moved;
                value
            };
            let slope = (at(step) - at(-step)) / (2.0 * step);
            // As for the weights.
            assert!(
                (slope - gradient[place]).abs() < 2e-7 * (1.0 + slope.abs()),
                "{name}[{place}]: slope {slope}, gradient {}",
                gradient[place]
            );
        }
    }
}

fn slope(case: &Case, place: usize, pass: Pass<'_>) -> f64 {
    let step = 2e-6;
    let mut weights = case.weights.clone();
    weights[place] += step;
    let above = case.objective(&weights, pass);
    weights[place] -= 2.0 * step;
    let below = case.objective(&weights, pass);
    (above - below) / (2.0 * step)
}

#[test]
fn dropout_changes_training_only_and_follows_its_seed() {
    let case = case(&ModelSpec::physical(Encoder::Gru { window: 3 }, 8, 1), 5, 4);
    let run = |pass| case.objective(&case.weights, pass);
    let dropped = |seeds: &'static [u64]| Pass::Training(Some(Dropout { rate: 0.5, seeds }));
    assert_eq!(run(Pass::Inference), run(Pass::Training(None)));
    assert_eq!(run(dropped(&[1])), run(dropped(&[1])));
    assert_ne!(run(dropped(&[1])), run(dropped(&[2])));
    assert_ne!(run(dropped(&[1])), run(Pass::Inference));
}

/// The input of a union. Inputs are window-major: the parts' rows alternate step by step.
fn join(parts: &[Case], of: fn(&Case) -> &[f64], window: usize) -> Vec<f64> {
    let steps = (0..window).flat_map(|step| {
        parts.iter().flat_map(move |part| {
            let rows = of(part).len() / window;
            of(part)[step * rows..][..rows].to_vec()
        })
    });
    steps.collect()
}

#[test]
fn a_union_computes_and_drops_what_its_parts_do() {
    for spec in specs() {
        let parts = &[case(&spec, 3, 5), case(&spec, 150, 6)];
        let whole = Connectivity::union(parts.iter().map(|part| &part.graph));
        let nodes = join(parts, |c| &c.nodes, spec.window());
        let arcs = join(parts, |c| &c.arcs, spec.window());
        let input = input(&nodes, &arcs);
        let (network, weights) = (&parts[0].network, &parts[0].weights);
        let packed = packed(network, weights);
        // A cloth has its seed wherever it stands.
        let dropped = |seeds| Pass::Training(Some(Dropout { rate: 0.4, seeds }));
        let mut passes = vec![(Pass::Inference, [Pass::Inference; 2])];
        if spec.window() > 1 {
            passes.push((dropped(&[8, 9]), [dropped(&[8]), dropped(&[9])]));
        }
        for (pass, of_parts) in passes {
            let together = forward(network, &packed, &whole, input, pass);
            let apart = parts.iter().zip(of_parts).flat_map(|(part, pass)| {
                forward(network, &packed, &part.graph, part.input(), pass)
            });
            let apart: Vec<f64> = apart.collect();
            assert_eq!(together.len(), apart.len());
            for (a, b) in together.iter().zip(&apart) {
                assert!((a - b).abs() < 1e-11, "{spec:?} {pass:?}");
            }
        }
    }
}

#[test]
fn a_machine_without_wide_vectors_gives_the_same_but_for_rounding() {
    for spec in specs() {
        let case = case(&spec, 60, 10);
        let [weights, nodes, arcs] = case.narrow();
        let input = input(&nodes, &arcs);
        let output: Vec<f32> = (0..OUTPUTS * case.graph.vertex_count())
            .map(|k| coefficient(k) as f32)
            .collect();
        let [wide, plain] = [Instructions::Detected, Instructions::Plain].map(|instructions| {
            let (network, graph, pass) = (&case.network, &case.graph, Pass::Training(None));
            let packed = network.pack(&weights, Purpose::Training, instructions);
            both(network, &packed, (graph, input), pass, &output, None)
        });
        for (wide, plain) in wide.iter().zip(&plain) {
            let scale = plain.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
            for (a, b) in wide.iter().zip(plain) {
                // As f32 against f64.
                assert!((a - b).abs() < 1e-5 * scale, "{spec:?}: {a} {b}");
            }
        }
    }
}

fn on_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("a pool").install(work)
}

#[test]
fn threads_change_no_bit() {
    for spec in specs() {
        let case = case(&spec, 150, 12);
        let [weights, nodes, arcs] = case.narrow();
        let run = || {
            let input = input(&nodes, &arcs);
            let (network, graph) = (&case.network, &case.graph);
            let packed = packed(network, &weights);
            let frame = forward(network, &packed, graph, input, Pass::Inference);
            let output: Vec<f32> = (0..frame.len()).map(|k| coefficient(k) as f32).collect();
            let (of, pass) = ((graph, input), Pass::Training(None));
            let learned = both(network, &packed, of, pass, &output, None);
            (frame, learned)
        };
        let one = on_threads(1, run);
        assert_eq!(one, on_threads(2, run));
        assert_eq!(one, on_threads(3, run));
    }
}

#[test]
fn a_pass_that_is_stopped_gives_nothing() {
    let case = case(
        &ModelSpec::physical(Encoder::Gru { window: 2 }, 6, 2),
        20,
        11,
    );
    let (network, graph, input) = (&case.network, &case.graph, case.input());
    let packed = network.pack(&case.weights, Purpose::Training, Instructions::Detected);
    let pass = Pass::Training(None);
    let stop = Stop::default();
    let mut workspace = Workspace::new();
    workspace.stop_by(stop.clone());
    let out = network.forward_packed(&packed, graph, input, pass, &mut workspace);
    let output = vec![1.0; out.expect("nobody stops it yet").len()];
    stop.ask();
    let mut gradient = vec![0.0; case.weights.len()];
    let gradients = Gradients {
        output: &output,
        weights: &mut gradient,
        input: None,
    };
    let back = network.backward_packed(&packed, graph, input, gradients, &mut workspace);
    assert_eq!(back, Err(Stopped));
    let out = network.forward_packed(&packed, graph, input, pass, &mut workspace);
    assert_eq!(out, Err(Stopped));
}

#[test]
fn activations_serve_one_backward_pass() {
    for passes in [vec![Pass::Inference], vec![Pass::Training(None); 2]] {
        let case = case(&ModelSpec::mesh_graph_nets(4, 1), 2, 9);
        let mut workspace = Workspace::new();
        let weights = packed(&case.network, &case.weights);
        let (network, graph, input) = (&case.network, &case.graph, case.input());
        let out = network.forward_packed(&weights, graph, input, passes[0], &mut workspace);
        out.expect("no stop");
        let mut gradient = vec![0.0; case.weights.len()];
        let output = vec![1.0; case.graph.vertex_count() * 3];
        let mut backward = || {
            let gradients = Gradients {
                output: &output,
                weights: &mut gradient,
                input: None,
            };
            let back = network.backward_packed(&weights, graph, input, gradients, &mut workspace);
            back.expect("no stop");
        };
        for _ in 1..passes.len() {
            backward();
        }
        let again = std::panic::catch_unwind(std::panic::AssertUnwindSafe(backward));
        assert!(again.is_err(), "{passes:?}");
    }
}
