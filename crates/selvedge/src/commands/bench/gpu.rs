//! `selvedge bench gpu`: forward passes, whole frames and steps of learning on a GPU, beside what
//! the card can do at most and, where asked for, other programs'. `page` writes what comes out.

mod page;

use std::sync::Arc;

use anyhow::ensure;
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_gpu::bench::NetworkCase;
use selvedge_gpu::bench::inference::Inference;
use selvedge_gpu::bench::learning::Learning;
use selvedge_gpu::bench::limits::{Limits, limits};
use selvedge_gpu::bench::profile::{Spent, Work};
use selvedge_gpu::device::{Device, Precision};
use selvedge_gpu::rollout::{Opening, Rollout};
use selvedge_lab::machine::{self, DeviceName};
use selvedge_model::{
    ClothGraph, Connectivity, Extent, Input, Model, ModelSpec, Network, Normalizer, Normalizers,
};
use serde::Serialize;
use serde_json::json;

use super::cloths::hanging;
use super::peer::Peer;
use super::variants::{Variant, named};
use super::{median, time};
use crate::cli::{Cloths, GpuArgs};
use crate::commands::flops::{FirstEdgeLayer, flops};
use crate::interrupt;
use crate::output::{Answer, End};

/// Runs of each that do not count.
const WARM: usize = 5;

/// Measures of a network on some cloths. A measure is missing where it failed, with the reason as a
/// remark. Another remark tells of commands that the card could not replay from a recording.
#[derive(Default, Serialize)]
struct Row {
    variant: &'static str,
    cloths: usize,
    vertices: usize,
    arcs: usize,
    /// Arithmetic as `selvedge presets` counts it.
    gflop: f64,
    commands: usize,
    /// A forward pass on features that lie ready.
    pass_ms: Option<f64>,
    /// The pass, of the card's measured products in the precision that it had.
    share_of_products: Option<f64>,
    /// The pass, of the card's measured bandwidth, each array counted once for each command that
    /// takes it.
    share_of_bandwidth: Option<f64>,
    /// A frame with handles up, features, network, integration, and positions down.
    frame_ms: Option<f64>,
    /// The paper's time of such a frame.
    paper_ms: Option<f64>,
    /// A step of learning on features that lie ready: forward, mean square error, backward, Adam.
    step_ms: Option<f64>,
    /// The other programs, in their order.
    peers: Vec<PeerTimes>,
    /// Commands by themselves.
    profile: Option<Profile>,
    remarks: Vec<String>,
}

/// A forward pass and a step of learning of another program.
#[derive(Default, Serialize)]
struct PeerTimes {
    pass_ms: Option<f64>,
    step_ms: Option<f64>,
}

/// The times of the commands of a frame and of a step of learning.
#[derive(Serialize)]
struct Profile {
    frame: Vec<Part>,
    step: Vec<Part>,
}

/// All commands of a name.
#[derive(Serialize)]
struct Part {
    name: String,
    commands: usize,
    elapsed_ms: f64,
    /// Of the card's measured products; none where there is none.
    share_of_products: Option<f64>,
    /// Of the card's measured bandwidth.
    share_of_bandwidth: f64,
}

/// Measures them.
///
/// # Errors
/// A device that is not there or fails, or another program that fails.
pub(super) fn run(args: &GpuArgs) -> anyhow::Result<Answer> {
    ensure!(
        args.machine.device != DeviceName::Cpu,
        "cpu is no GPU: take --device cuda (`selvedge bench engine` measures the processor)"
    );
    let device = machine::open_device(args.machine.device)?;
    let precision = machine::precision_of(args.machine.precision());
    let limits = limits(&*device, usize::from(args.side))?;
    let mut variants = named(&args.variant)?;
    if args.variant.is_empty() {
        variants.retain(|variant| variant.name != "small");
    }
    let bench = Bench {
        device: &*device,
        precision,
        args,
        limits: &limits,
    };
    let mut rows = Vec::new();
    for &Cloths { count, vertices } in &args.vertices {
        if interrupt::requested() {
            break;
        }
        let graph = hanging(vertices)?;
        for variant in &variants {
            if interrupt::requested() {
                break;
            }
            rows.push(bench.measure(variant, &graph, count)?);
        }
    }
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    let text = page::page(&device.name(), &limits, args, &rows);
    let report = json!({
        "device": device.name(), "precision": args.machine.precision().name(), "runs": args.runs,
        "full_flop_per_second": limits.products[0], "tensor_flop_per_second": limits.products[1],
        "half_flop_per_second": limits.products[2], "bytes_per_second": limits.bandwidth,
        "against": args.against, "rows": rows,
    });
    Ok(Answer::new(text, &report)?.ended(end))
}

struct Bench<'a> {
    device: &'a dyn Device,
    precision: Precision,
    args: &'a GpuArgs,
    limits: &'a Limits,
}

impl Bench<'_> {
    fn measure(&self, variant: &Variant, graph: &ClothGraph, cloths: usize) -> anyhow::Result<Row> {
        let spec = &variant.spec;
        let one = Connectivity::of(graph.topology());
        let union = Connectivity::union(std::iter::repeat_n(&one, cloths));
        let (vertices, arcs) = (union.vertex_count(), union.arc_count());
        let flop = flops(spec, FirstEdgeLayer::Split).per_frame(vertices, arcs) as f64;
        let mut row = Row {
            variant: variant.name,
            cloths,
            vertices: graph.vertex_count(),
            arcs: graph.arc_count(),
            gflop: 1e-9 * flop,
            paper_ms: paper_ms(variant.name)
                .filter(|_| cloths == 1 && vertices.abs_diff(1024) < 16),
            ..Row::default()
        };
        let model = model(variant)?;
        match self.passes(&model, &union, &mut row.remarks) {
            Ok((ms, commands, work)) => {
                row.pass_ms = Some(ms);
                row.commands = commands;
                row.share_of_products = Some(flop / self.products() / (1e-3 * ms));
                row.share_of_bandwidth = Some(self.of_bandwidth(work, ms));
            }
            Err(error) => row.remarks.push(format!("pass: {error:#}")),
        }
        let mut frame = Vec::new();
        match self.frames(model, graph, cloths, &mut row.remarks) {
            Ok((ms, parts)) => (row.frame_ms, frame) = (Some(ms), parts),
            Err(error) => row.remarks.push(format!("frame: {error:#}")),
        }
        let mut step = Vec::new();
        match self.steps(spec, &union, &mut row.remarks) {
            Ok((ms, parts)) => (row.step_ms, step) = (Some(ms), parts),
            Err(error) => row.remarks.push(format!("step: {error:#}")),
        }
        row.profile = self.args.profile.then_some(Profile { frame, step });
        for (number, command) in self.args.against.iter().enumerate() {
            let mut times = PeerTimes::default();
            if let Err(error) = self.peer(command, spec, graph, cloths, &mut times) {
                row.remarks.push(format!("({}): {error:#}", number + 1));
            }
            row.peers.push(times);
        }
        Ok(row)
    }

    /// The card's measured products in the precision that is used `[operations per second]`.
    fn products(&self) -> f64 {
        match self.precision {
            Precision::Full => self.limits.products[0],
            Precision::Tensor => self.limits.products[1],
            Precision::Half => self.limits.products[2],
        }
    }

    fn of_bandwidth(&self, work: Work, elapsed_ms: f64) -> f64 {
        work.bytes / self.limits.bandwidth / (1e-3 * elapsed_ms)
    }

    fn parts(&self, spent: Vec<Spent>) -> Vec<Part> {
        let part = |spent: Spent| Part {
            share_of_products: (spent.work.flop > 0.0)
                .then(|| spent.work.flop / self.products() / (1e-3 * spent.elapsed_ms)),
            share_of_bandwidth: self.of_bandwidth(spent.work, spent.elapsed_ms),
            name: spent.name,
            commands: spent.commands,
            elapsed_ms: spent.elapsed_ms,
        };
        spent.into_iter().map(part).collect()
    }

    /// Measures another program; times from before a failure stay.
    fn peer(
        &self,
        command: &str,
        spec: &ModelSpec,
        graph: &ClothGraph,
        cloths: usize,
        times: &mut PeerTimes,
    ) -> anyhow::Result<()> {
        let mut peer = Peer::start_many(command, spec, graph.topology(), cloths, 1)?;
        let both = [("frame", &mut times.pass_ms), ("step", &mut times.step_ms)];
        for (what, ms) in both {
            let mut found = Vec::new();
            for _ in 0..WARM + usize::from(self.args.runs) {
                found.push(peer.run(what)?);
            }
            *ms = Some(median(found.split_off(WARM)));
        }
        Ok(())
    }

    /// A forward pass `[ms]`, its commands, and what they move and multiply.
    fn passes(
        &self,
        model: &Model,
        graph: &Connectivity,
        remarks: &mut Vec<String>,
    ) -> anyhow::Result<(f64, usize, Work)> {
        let network = model.network();
        let (extent, [nodes, edges]) = drawn(network, graph);
        let case = NetworkCase {
            network,
            weights: model.weights(),
            graph,
            extent,
        };
        let mut inference = Inference::new(self.device, case, self.precision)?;
        inference.put(Input {
            nodes: &nodes,
            arcs: &edges,
        })?;
        inference.put_state(0.1)?;
        let mut times = Vec::new();
        for _ in 0..WARM + usize::from(self.args.runs) {
            inference.wait()?;
            let mut ran = Ok(());
            times.push(time(|| {
                ran = inference.run().and_then(|()| inference.wait())
            }));
            ran?;
        }
        let elapsed_ms = median(times.split_off(WARM));
        remarks.extend(unrecorded("pass", inference.unrecorded()));
        Ok((elapsed_ms, inference.commands(), inference.work()))
    }

    /// A step of learning `[ms]`, and where its time goes if that is asked for.
    fn steps(
        &self,
        spec: &ModelSpec,
        graph: &Connectivity,
        remarks: &mut Vec<String>,
    ) -> anyhow::Result<(f64, Vec<Part>)> {
        let network = Network::new(spec)?;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let (extent, [nodes, edges]) = drawn(&network, graph);
        let case = NetworkCase {
            network: &network,
            weights: &weights,
            graph,
            extent,
        };
        let mut learning = Learning::new(self.device, case, self.precision)?;
        let input = Input {
            nodes: &nodes,
            arcs: &edges,
        };
        learning.put(input, &vec![0.5; 3 * graph.vertex_count()])?;
        learning.put_state(0.1)?;
        let mut times = Vec::new();
        for _ in 0..WARM + usize::from(self.args.runs) {
            learning.wait()?;
            let mut ran = Ok(());
            times.push(time(|| {
                ran = learning.step(1e-5).and_then(|()| learning.wait());
            }));
            ran?;
        }
        let elapsed_ms = median(times.split_off(WARM));
        remarks.extend(unrecorded("step", learning.unrecorded()));
        if !self.args.profile {
            return Ok((elapsed_ms, Vec::new()));
        }
        Ok((elapsed_ms, self.parts(learning.profile()?)))
    }

    /// A frame of a rollout `[ms]`, and where its time goes if that is asked for.
    fn frames(
        &self,
        model: Model,
        graph: &ClothGraph,
        cloths: usize,
        remarks: &mut Vec<String>,
    ) -> anyhow::Result<(f64, Vec<Part>)> {
        let start: [&[Vec3]; 1] = [graph.rest_positions()];
        let openings = (0..cloths).map(|_| Opening {
            graph: graph.clone(),
            start: &start,
        });
        let model = Arc::new(model);
        let mut rollout = Rollout::new(self.device, model, openings.collect(), self.precision)?;
        let targets = graph.handles().select(graph.rest_positions());
        let targets = vec![&*targets; cloths];
        let mut times = Vec::new();
        for _ in 0..WARM + usize::from(self.args.runs) {
            let mut ran = Ok(());
            times.push(time(|| ran = rollout.step(&targets)));
            ran?;
        }
        let elapsed_ms = median(times.split_off(WARM));
        remarks.extend(unrecorded("frame", rollout.unrecorded()));
        if !self.args.profile {
            return Ok((elapsed_ms, Vec::new()));
        }
        Ok((elapsed_ms, self.parts(rollout.profile(&targets)?)))
    }
}

/// A remark where a device was called piece by piece.
fn unrecorded(what: &str, reason: Option<&str>) -> Option<String> {
    reason.map(|reason| format!("{what}: not replayed from a recording: {reason}"))
}

/// The paper's time of a frame of 1024 vertices on an RTX 3080 `[ms]`.
fn paper_ms(variant: &str) -> Option<f64> {
    match variant {
        "gru-10" => Some(37.0),
        "gru-5" => Some(26.0),
        "meshgraphnets" => Some(12.0),
        _ => None,
    }
}

/// Drawn features for a network on a graph; one frame where it streams, which goes on from states.
fn drawn(network: &Network, graph: &Connectivity) -> (Extent, [Vec<f32>; 2]) {
    let spec = network.spec();
    let (extent, [of_nodes, of_edges]) = if network.streams() {
        (Extent::Newest, [1, 1])
    } else {
        (Extent::Whole, [spec.window(); 2])
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut numbers = |count: usize| -> Vec<f32> {
        (0..count)
            .map(|_| 3.0 * rng.random::<f32>() - 1.5)
            .collect()
    };
    let nodes = numbers(of_nodes * graph.vertex_count() * spec.node_width());
    let edges = numbers(of_edges * graph.arc_count() * spec.edge_width());
    (extent, [nodes, edges])
}

/// A model whose accelerations are so small that the cloth stays where it is.
pub(super) fn model(variant: &Variant) -> anyhow::Result<Model> {
    let network = Network::new(&variant.spec)?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let weights = network.initialise(&mut || rng.random::<f64>());
    let ones =
        |width: usize, deviation: f64| Normalizer::new(vec![0.0; width], vec![deviation; width]);
    let normalizers = Normalizers {
        nodes: ones(variant.spec.node_width(), 1.0)?,
        edges: ones(variant.spec.edge_width(), 1.0)?,
        acceleration: ones(3, 1e-5)?,
    };
    Ok(Model::new(
        &variant.spec,
        weights,
        normalizers,
        String::new(),
    )?)
}
