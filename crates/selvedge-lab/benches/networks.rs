//! Times the networks: a forward pass and a training step on ready features, on the processor or on
//! a GPU, and of another program beside them. Prints a table row per network, for
//! `docs/src/benchmarks.md`.
//!
//! `cargo bench -p selvedge-lab --bench networks -- [KEY=VALUE ...]` with `network` (`gru-10`,
//! `gru-5`, `mlp`, `meshgraphnets`, `small`; all), `vertices` of a cloth (1024), `cloths` in a pass
//! (1), `runs` that count (10), `threads` (1), and `against` (none), a program that runs the same
//! networks, such as `python benches/peers/networks.py`. With `--features gpu` also `device` (cpu, gpu,
//! gpu:N). Times are medians.
//!
//! The other program gets one line of JSON on its standard input: spec, vertices, node_width,
//! edge_width, senders, receivers, threads. It answers "ready"; then, for each line "frame" or
//! "step", it runs one and answers with the milliseconds that it took.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program that prints its result"
)]

mod settings;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::square;
use selvedge_model::{
    Connectivity, Encoder, Gradients, Input, Instructions, ModelSpec, Network, Pass, Purpose,
    Workspace,
};
use selvedge_train::{Adam, AdamSettings};

/// Runs that do not count, before those that do.
const WARM: usize = 3;

fn main() {
    let settings = settings::read([
        ("network", "all"),
        ("vertices", "1024"),
        ("cloths", "1"),
        ("runs", "10"),
        ("threads", "1"),
        ("against", ""),
        ("device", "cpu"),
    ]);
    let number = |key: &str| -> usize { settings[key].parse().unwrap() };
    let physical = |window, latent, blocks| {
        let encoder = match window {
            1 => Encoder::MLP,
            window => Encoder::Gru { window },
        };
        ModelSpec::physical(encoder, latent, blocks)
    };
    let networks = [
        ("gru-10", physical(10, 128, 15)),
        ("gru-5", physical(5, 128, 15)),
        ("mlp", physical(1, 128, 15)),
        ("meshgraphnets", ModelSpec::mesh_graph_nets(128, 15)),
        ("small", physical(5, 64, 8)),
    ];
    let wanted = |name: &str| ["all", name].contains(&settings["network"].as_str());
    let one = Connectivity::of(square(number("vertices"), 1.0, 1).unwrap().mesh.topology());
    let graph = Connectivity::union(std::iter::repeat_n(&one, number("cloths")));
    println!("| network | pass | step | other pass | other step |");
    for (name, spec) in networks.iter().filter(|(name, _)| wanted(name)) {
        let mut times = measure(spec, &graph, &settings);
        times.extend(peer(spec, &graph, &settings));
        let times = times.iter().map(|ms| format!(" {ms:.2} ms |"));
        println!("| {name} |{}", times.collect::<String>());
    }
}

/// Median times of a forward pass and of a training step `[ms]`.
fn measure(spec: &ModelSpec, graph: &Connectivity, settings: &BTreeMap<&str, String>) -> Vec<f64> {
    let network = Network::new(spec).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let weights = network.initialise(&mut || rng.random::<f64>());
    let mut numbers = |count: usize| -> Vec<f32> {
        let number = |_| 3.0 * rng.random::<f32>() - 1.5;
        (0..count).map(number).collect()
    };
    let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
    let nodes = numbers(spec.window() * vertices * spec.node_width());
    let edges = numbers(spec.window() * arcs * spec.edge_width());
    let target = numbers(3 * vertices);
    let input = Input {
        nodes: &nodes,
        arcs: &edges,
    };
    let runs: usize = settings["runs"].parse().unwrap();
    let timed = |work: &mut dyn FnMut()| {
        let one = |_| {
            let begin = Instant::now();
            work();
            1e3 * begin.elapsed().as_secs_f64()
        };
        median((0..WARM + runs).map(one).skip(WARM).collect())
    };
    if settings["device"] != "cpu" {
        return on_gpu(
            (&network, &weights),
            graph,
            input,
            &target,
            settings,
            &timed,
        );
    }
    let pack = |purpose| network.pack(&weights, purpose, Instructions::Detected);
    let mut workspace = Workspace::new();
    let packed = pack(Purpose::Inference);
    let pass = timed(&mut || {
        let out = network.forward_packed(&packed, graph, input, Pass::Inference, &mut workspace);
        out.unwrap();
    });
    let (mut packed, mut learned) = (pack(Purpose::Training), weights.clone());
    let mut workspace = Workspace::new();
    let mut adam = Adam::new(AdamSettings::default(), weights.len()).unwrap();
    let (mut gradient, mut by_output) = (vec![0.0; weights.len()], vec![0.0; target.len()]);
    let step = timed(&mut || {
        network.repack(&learned, &mut packed);
        let pass = Pass::Training(None);
        let out = network.forward_packed(&packed, graph, input, pass, &mut workspace);
        let out = out.unwrap();
        let scale = 2.0 / out.len() as f32;
        for ((to, x), y) in by_output.iter_mut().zip(out).zip(&target) {
            *to = scale * (x - y);
        }
        gradient.fill(0.0);
        let gradients = Gradients {
            output: &by_output,
            weights: &mut gradient,
            input: None,
        };
        let back = network.backward_packed(&packed, graph, input, gradients, &mut workspace);
        back.unwrap();
        adam.step(&mut learned, &gradient, 1e-5);
    });
    vec![pass, step]
}

#[cfg(feature = "gpu")]
fn on_gpu(
    (network, weights): (&Network, &[f32]),
    graph: &Connectivity,
    input: Input<'_, f32>,
    target: &[f32],
    settings: &BTreeMap<&str, String>,
    timed: &dyn Fn(&mut dyn FnMut()) -> f64,
) -> Vec<f64> {
    use selvedge_gpu::passes::{Passes, Training};
    use selvedge_lab::machine::Machine;
    use selvedge_model::Window;

    let opened = Machine::open(settings["device"].parse().unwrap()).unwrap();
    let Machine::Gpu(gpu) = opened else {
        panic!("device={} is no GPU", settings["device"])
    };
    let window = Window {
        nodes: input.nodes.to_vec(),
        arcs: input.arcs.to_vec(),
    };
    let mut inference = Passes::new(&gpu, network, graph, None, None).unwrap();
    inference.set_weights(weights);
    let pass = timed(&mut || {
        inference.forward(0, &window, &[]).unwrap();
    });
    drop(inference);
    let training = Training {
        frames: 1,
        dropout: 0.0,
    };
    let mut passes = Passes::new(&gpu, network, graph, Some(training), None).unwrap();
    let mut adam = Adam::new(AdamSettings::default(), weights.len()).unwrap();
    passes.set_weights(weights);
    let step = timed(&mut || {
        let out = passes.forward(0, &window, &[]).unwrap();
        let scale = 2.0 / out.len() as f32;
        let by_output = out.iter().zip(target).map(|(x, y)| scale * (x - y));
        passes.clear_gradient();
        passes
            .backward(0, &by_output.collect::<Vec<f32>>())
            .unwrap();
        passes.step(f64::MAX, adam.next_rates(1e-5), 0.0).unwrap();
        adam.count_step();
    });
    vec![pass, step]
}

#[cfg(not(feature = "gpu"))]
fn on_gpu(
    _: (&Network, &[f32]),
    _: &Connectivity,
    _: Input<'_, f32>,
    _: &[f32],
    settings: &BTreeMap<&str, String>,
    _: &dyn Fn(&mut dyn FnMut()) -> f64,
) -> Vec<f64> {
    panic!("device={}: build with --features gpu", settings["device"])
}

/// The same of the other program; nothing where none is named.
fn peer(spec: &ModelSpec, graph: &Connectivity, settings: &BTreeMap<&str, String>) -> Vec<f64> {
    let mut words = settings["against"].split_whitespace();
    let Some(program) = words.next() else {
        return Vec::new();
    };
    let piped = Command::new(program)
        .args(words)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let mut child = piped.unwrap();
    let mut to = child.stdin.take().unwrap();
    let mut from = BufReader::new(child.stdout.take().unwrap());
    let mut ask = |line: &str| {
        writeln!(to, "{line}").unwrap();
        let mut answer = String::new();
        from.read_line(&mut answer).unwrap();
        answer.trim().to_owned()
    };
    let network = serde_json::json!({
        "spec": spec,
        "vertices": graph.vertex_count(),
        "node_width": spec.node_width(),
        "edge_width": spec.edge_width(),
        "senders": graph.senders(),
        "receivers": graph.receivers(),
        "threads": settings["threads"].parse::<usize>().unwrap(),
    });
    assert_eq!(ask(&network.to_string()), "ready");
    let runs: usize = settings["runs"].parse().unwrap();
    let times = ["frame", "step"].map(|what| {
        let one = |_| ask(what).parse().unwrap();
        median((0..WARM + runs).map(one).skip(WARM).collect())
    });
    drop(to);
    child.wait().unwrap();
    times.to_vec()
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
