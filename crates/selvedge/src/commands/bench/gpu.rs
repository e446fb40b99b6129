//! `selvedge bench gpu`: forward passes, whole frames and steps of learning on a GPU, beside what the card
//! can do at most and, where asked for, other programs'.

use std::sync::Arc;

use anyhow::ensure;
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_gpu::device::{Device, Precision};
use selvedge_gpu::inference::Inference;
use selvedge_gpu::learning::Learning;
use selvedge_gpu::limits::{Limits, limits};
use selvedge_gpu::rollout::{Opening, Rollout};
use selvedge_model::{
    ClothGraph, Connectivity, Extent, FirstEdgeLayer, Input, Model, ModelSpec, Network, Normalizer,
    Normalizers, flops,
};
use serde::Serialize;
use serde_json::json;

use super::cloths::hanging;
use super::peer::Peer;
use super::variants::{Variant, named};
use super::{median, time};
use crate::cli::{DeviceName, GpuArgs};
use crate::interrupt;
use crate::machine;
use crate::output::{Answer, End};

/// Runs of each that do not count.
const WARM: usize = 5;

/// What was measured of a network on some cloths.
#[derive(Serialize)]
struct Row {
    variant: &'static str,
    cloths: usize,
    vertices: usize,
    arcs: usize,
    /// Arithmetic as `selvedge presets` counts it.
    gflop: f64,
    commands: usize,
    /// A forward pass on features that lie ready; none where the memory does not suffice.
    pass_ms: Option<f64>,
    /// A frame with handles up, features, network, integration, and positions down.
    frame_ms: Option<f64>,
    /// The pass, of the card's measured products in the precision that it had.
    share_of_products: Option<f64>,
    /// A step of learning on features that lie ready: forward, mean square error, backward, Adam.
    step_ms: Option<f64>,
    peer_ms: Vec<f64>,
    peer_step_ms: Vec<f64>,
    /// Why something was not measured.
    remarks: Vec<String>,
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
    let device = machine::device(args.machine.device)?;
    let precision = machine::precision(args.machine.precision);
    let limits = limits(&*device, usize::from(args.side))?;
    let mut variants = named(&args.variant)?;
    if args.variant.is_empty() {
        variants.retain(|variant| variant.name != "small");
    }
    let mut rows = Vec::new();
    for (vertices, cloths) in sizes(args) {
        let graph = hanging(vertices)?;
        for variant in &variants {
            if interrupt::requested() {
                break;
            }
            let bench = Bench {
                device: &*device,
                precision,
                args,
                limits: &limits,
            };
            rows.push(bench.measure(variant, &graph, cloths)?);
        }
    }
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    let text = format!(
        "{}\n{}",
        heading(&*device, &limits, args),
        table(&rows, args)
    );
    let report = json!({
        "device": device.name(), "precision": args.machine.precision.name(), "runs": args.runs,
        "full_flop_per_second": limits.products[0], "tensor_flop_per_second": limits.products[1],
        "half_flop_per_second": limits.products[2], "bytes_per_second": limits.bandwidth,
        "against": args.against, "rows": rows,
    });
    Ok(Answer::new(text, &report)?.ended(end))
}

/// Vertices of a cloth, and how many cloths.
fn sizes(args: &GpuArgs) -> Vec<(usize, usize)> {
    let sizes = args.vertices.iter().map(|&n| (n as usize, 1));
    let many = args
        .vertices
        .first()
        .map(|&n| (n as usize, usize::from(args.cloths)));
    sizes
        .chain(many.filter(|&(_, cloths)| cloths > 0))
        .collect()
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
            commands: 0,
            pass_ms: None,
            frame_ms: None,
            share_of_products: None,
            step_ms: None,
            peer_ms: Vec::new(),
            peer_step_ms: Vec::new(),
            remarks: Vec::new(),
        };
        let model = model(variant)?;
        match self.passes(&model, &union) {
            Ok((ms, commands)) => {
                let of = match self.precision {
                    Precision::Full => self.limits.products[0],
                    Precision::Tensor => self.limits.products[1],
                    Precision::Half => self.limits.products[2],
                };
                row.pass_ms = Some(ms);
                row.commands = commands;
                row.share_of_products = Some(flop / of / (1e-3 * ms));
            }
            Err(error) => row.remarks.push(format!("pass: {error:#}")),
        }
        match self.frames(model, graph, cloths) {
            Ok(ms) => row.frame_ms = Some(ms),
            Err(error) => row.remarks.push(format!("frame: {error:#}")),
        }
        match self.steps(&variant.spec, &union) {
            Ok(ms) => row.step_ms = Some(ms),
            Err(error) => row.remarks.push(format!("step: {error:#}")),
        }
        for command in &self.args.against {
            let mut peer = Peer::start_many(command, spec, (graph.topology(), cloths), 1)?;
            for (what, ms) in [("frame", &mut row.peer_ms), ("step", &mut row.peer_step_ms)] {
                let mut asked = || peer.run(what);
                (0..WARM).try_for_each(|_| asked().map(|_| ()))?;
                let times = (0..self.args.runs).map(|_| asked());
                ms.push(median(times.collect::<Result<_, _>>()?));
            }
        }
        Ok(row)
    }

    /// A forward pass `[ms]`, and its commands.
    fn passes(&self, model: &Model, graph: &Connectivity) -> anyhow::Result<(f64, usize)> {
        let network = model.network();
        let (extent, [nodes, edges]) = drawn(network, graph);
        let both = (network, model.weights());
        let mut inference = Inference::new(self.device, both, graph, extent, self.precision)?;
        inference.put(Input {
            nodes: &nodes,
            edges: &edges,
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
        Ok((median(times.split_off(WARM)), inference.commands()))
    }

    /// A step of learning `[ms]`.
    fn steps(&self, spec: &ModelSpec, graph: &Connectivity) -> anyhow::Result<f64> {
        let network = Network::new(spec)?;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let (extent, [nodes, edges]) = drawn(&network, graph);
        let both = (&network, &*weights);
        let mut learning = Learning::new(self.device, both, graph, extent, self.precision)?;
        let input = Input {
            nodes: &nodes,
            edges: &edges,
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
        Ok(median(times.split_off(WARM)))
    }

    /// A frame of a rollout `[ms]`.
    fn frames(&self, model: Model, graph: &ClothGraph, cloths: usize) -> anyhow::Result<f64> {
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
        Ok(median(times.split_off(WARM)))
    }
}

/// Drawn features for a network on a graph; one frame where it streams, which goes on from states.
fn drawn(network: &Network, graph: &Connectivity) -> (Extent, [Vec<f32>; 2]) {
    let spec = network.spec();
    let (extent, [of_nodes, of_edges]) = if network.streams() {
        (Extent::Newest, [1, 1])
    } else {
        (Extent::Whole, [spec.node_window(), spec.edge_window()])
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

fn heading(device: &dyn Device, limits: &Limits, args: &GpuArgs) -> String {
    let [full, tensor, half] = limits.products.map(|flop| 1e-12 * flop);
    format!(
        "{}, precision {}, medians of {} runs. Measured limits: products {full:.1} TFLOP/s full, {tensor:.1} tensor, \
         {half:.1} half; copies {:.2} TB/s read and written.\npass: the forward pass on features that lie ready; frame: \
         handles up, features, network, integration, positions down; step: forward, mean square error, backward, Adam on features \
         that lie ready; share: the pass, of the products' limit.\n",
        device.name(),
        args.machine.precision.name(),
        args.runs,
        1e-12 * limits.bandwidth,
    )
}

/// A table that may stand in a Markdown page.
fn table(rows: &[Row], args: &GpuArgs) -> String {
    let mut heads = vec![
        "variant", "cloths", "vertices", "arcs", "GFLOP", "commands", "pass, ms",
    ];
    heads.extend(["share", "frame, ms", "step, ms", "samples/s"]);
    let peers: Vec<[String; 2]> = args
        .against
        .iter()
        .map(|peer| ["pass", "step"].map(|what| format!("{peer}: {what}, ms")))
        .collect();
    heads.extend(peers.iter().flatten().map(String::as_str));
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let owned = |cells: &[&str]| {
        cells
            .iter()
            .map(|&cell| cell.to_owned())
            .collect::<Vec<_>>()
    };
    let mut text = line(&owned(&heads));
    text += &line(&vec!["---".to_owned(); heads.len()]);
    let or_dash = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.3}"));
    for row in rows {
        let mut cells = vec![row.variant.to_owned()];
        cells.extend([row.cloths, row.vertices, row.arcs].map(|count| count.to_string()));
        cells.push(format!("{:.1}", row.gflop));
        cells.push(row.commands.to_string());
        cells.push(or_dash(row.pass_ms));
        let share = row.share_of_products;
        cells.push(share.map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share)));
        cells.push(or_dash(row.frame_ms));
        cells.push(or_dash(row.step_ms));
        let samples = row.step_ms.map(|ms| 1e3 * row.cloths as f64 / ms);
        cells.push(samples.map_or("-".to_owned(), |samples| format!("{samples:.0}")));
        let peers = row.peer_ms.iter().zip(&row.peer_step_ms);
        cells.extend(peers.flat_map(|(&pass, &step)| [pass, step].map(|ms| or_dash(Some(ms)))));
        text += &line(&cells);
    }
    for row in rows.iter().filter(|row| !row.remarks.is_empty()) {
        text += &format!(
            "{}, {} × {}: {}\n",
            row.variant,
            row.cloths,
            row.vertices,
            row.remarks.join("; ")
        );
    }
    text
}
