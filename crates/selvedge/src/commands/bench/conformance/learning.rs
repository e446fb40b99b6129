//! The learning half of `selvedge bench conformance`: gradients of networks, and trainings from one
//! seed.
//!
//! Bounds, in parts of the processor's numbers: 1e-4 for a gradient, of the network alone by each
//! of its arrays of weights, and of the first step of a training as a whole, features, losses and
//! rollout and all; 2e-2 for the loss of each of a hundred steps, which go apart as any two
//! roundings do.

use std::path::Path;

use anyhow::{Context, anyhow, bail};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_data::{
    Dataset, DatasetPlan, DatasetWriter, Provenance, SectionRule, Split, Trajectory,
};
use selvedge_gpu::bench::NetworkCase;
use selvedge_gpu::bench::conformance::training;
use selvedge_gpu::bench::learning::Learning;
use selvedge_gpu::device::{Device, Precision};
use selvedge_model::{
    ClothGraph, Connectivity, Encoder, Extent, Gradients, Input, Integration, ModelSpec, Network,
    NodeFeature, Pass, Workspace,
};
use selvedge_train::{EngineMaker, TrainConfig, Trainer, TruthProbability, UnrollFrames};
use serde_json::json;

use super::super::cloths::hanging;
use super::super::variants::named;
use super::{Bound, Checks, worst};
use crate::cli::ConformanceArgs;
use crate::interrupt;

/// Most that a gradient may be off, in parts of its length.
const GRADIENT: f64 = 1e-4;

/// Most that a loss may be off, in parts of it.
const LOSS: f64 = 0.02;

/// Vertices of the cloths that are learned from.
const VERTICES: [usize; 2] = [100, 81];

/// Frames of each trajectory.
const FRAMES: usize = 60;

/// Compares gradients and trainings, until an end is asked for.
pub(super) fn check(
    device: &dyn Device,
    args: &ConformanceArgs,
    checks: &mut Checks,
) -> anyhow::Result<()> {
    let precision = checks.precision;
    for variant in named(&args.variant)? {
        if interrupt::requested() {
            return Ok(());
        }
        let graph = Connectivity::of(hanging(variant.vertices)?.topology());
        let off = gradients(device, precision, &variant.spec, &graph);
        checks.add(variant.name, "gradient", off, Bound::Rounding(GRADIENT));
    }
    let folder = tempfile::tempdir().context("a folder for data")?;
    let data = data(folder.path())?;
    for (name, cfg) in trainings()? {
        if interrupt::requested() {
            return Ok(());
        }
        let mut make = |engine: &dyn EngineMaker| Trainer::new(cfg.clone(), &data, engine);
        let steps = usize::from(args.steps);
        let (gradient, losses) = match training(device, precision, &mut make, steps) {
            Ok(found) => (Ok(found.gradient), Ok(found.losses)),
            Err(error) => (Err(error.into()), Err(anyhow!("there is no training"))),
        };
        let bound = Bound::Rounding(GRADIENT);
        checks.add(&name, "gradient of a training", gradient, bound);
        let what = format!("losses of {steps} steps");
        checks.add(&name, &what, losses, Bound::Rounding(LOSS));
    }
    Ok(())
}

/// The error of the gradient of the mean square error for drawn numbers: the worst of all arrays of
/// weights.
fn gradients(
    device: &dyn Device,
    precision: Precision,
    spec: &ModelSpec,
    graph: &Connectivity,
) -> anyhow::Result<f64> {
    let network = Network::new(spec)?;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let weights = network.initialise(&mut || rng.random::<f64>());
    let mut numbers = |count: usize| -> Vec<f32> {
        (0..count)
            .map(|_| 3.0 * rng.random::<f32>() - 1.5)
            .collect()
    };
    let nodes = numbers(spec.window() * graph.vertex_count() * spec.node_width());
    let edges = numbers(spec.window() * graph.arc_count() * spec.edge_width());
    let target = numbers(3 * graph.vertex_count());
    let input = Input {
        nodes: &nodes,
        arcs: &edges,
    };
    let case = NetworkCase {
        network: &network,
        weights: &weights,
        graph,
        extent: Extent::Whole,
    };
    let mut learning = Learning::new(device, case, precision)?;
    learning.put(input, &target)?;
    // By plain calls, while it is recorded, and from the recording.
    for _ in 0..3 {
        learning.step(0.0)?;
    }
    if let Some(reason) = learning.unrecorded() {
        bail!("it cannot be replayed from a recording: {reason}");
    }
    let found = learning.gradient()?;
    let mut workspace = Workspace::new();
    let pass = Pass::Training(None);
    let out = network.forward(&weights, graph, input, pass, &mut workspace);
    let share = 2.0 / out.len() as f32;
    let pairs = out.iter().zip(&target);
    let by_output: Vec<f32> = pairs.map(|(x, y)| share * (x - y)).collect();
    let mut expected = vec![0.0; weights.len()];
    let gradients = Gradients::new(&by_output, &mut expected);
    network.backward(&weights, graph, input, gradients, &mut workspace);
    Ok(worst_array(&network, &found, &expected))
}

/// The distance of two gradients in the array of weights where it is largest, in parts of the
/// second.
fn worst_array(network: &Network, found: &[f32], expected: &[f32]) -> f64 {
    let of_arrays = network.parameters().iter().map(|parameter| {
        let range = parameter.range.clone();
        let pairs = found[range.clone()].iter().zip(&expected[range]);
        let square = |x: f64| x * x;
        let (off, size) = pairs.fold((0.0, 0.0), |(off, size), (x, y)| {
            let [x, y] = [x, y].map(|x| f64::from(*x));
            (off + square(x - y), size + square(y))
        });
        (off / f64::max(size, f64::MIN_POSITIVE)).sqrt()
    });
    worst(0.0, of_arrays)
}

/// Small trainings in which everything plays a part that can: noise, clipping, a mean of the
/// weights, dropout, the model's own predictions, and several frames at a time.
fn trainings() -> anyhow::Result<Vec<(String, TrainConfig)>> {
    let encoders = [
        ("gru", Encoder::Gru { window: 5 }, 1),
        ("streaming-gru", Encoder::StreamingGru { window: 5 }, 3),
        ("mlp", Encoder::MLP, 3),
    ];
    let all = encoders.into_iter().map(|(name, encoder, frames)| {
        let mut cfg = TrainConfig::parse(CONFIG, Path::new("conformance"))?;
        cfg.model = ModelSpec::physical(encoder, 32, 3);
        if encoder != (Encoder::Gru { window: 5 }) {
            cfg.model.node_features.extend([
                NodeFeature::Acceleration,
                NodeFeature::ExpectedMove,
                NodeFeature::RestOffset,
            ]);
            cfg.model.integration = Integration::Carried {
                damping: 0.05,
                stiffness: 0.01,
            };
        }
        if encoder != Encoder::MLP {
            cfg.dropout = 0.1;
        }
        if frames > 1 {
            cfg.losses.kinetic_energy = 0.0;
        }
        cfg.unroll = UnrollFrames::Constant { frames };
        cfg.scheduled_sampling.truth = TruthProbability::Linear {
            start: 1,
            end: 10,
            probability: 0.3,
        };
        Ok((format!("{name}, {frames} at a time"), cfg))
    });
    all.collect()
}

/// All but the network.
const CONFIG: &str = r#"
name = "conformance"
seed = 5
steps = 100000
statistics_samples = 50
log_every = 10
gradient_clip = 1.0
loss_cap = 100.0
weight_average = 0.99

[model]
node_features = ["velocity", "node-type"]
edge_features = ["vector"]
encoder = { kind = "mlp" }
latent = 4
blocks = 1

[learning_rate]
kind = "constant"
rate = 1e-4

[batch]
samples = 4

[noise]
deviation = 0.003
"#;

/// Cloths of two sizes that swing by a formula.
fn data(folder: &Path) -> anyhow::Result<Dataset> {
    let names = ["a", "b"];
    let plan = DatasetPlan {
        name: "conformance".to_owned(),
        config: json!(null),
        train: names.map(str::to_owned).into(),
        test: Vec::new(),
        sections: SectionRule::Whole,
    };
    let mut writer = DatasetWriter::open(folder, plan)?;
    for (number, name) in names.into_iter().enumerate() {
        let trajectory = trajectory(&hanging(VERTICES[number])?, number)?;
        writer.add(Split::Train, name, &trajectory)?;
    }
    Ok(writer.finish()?)
}

fn trajectory(graph: &ClothGraph, number: usize) -> anyhow::Result<Trajectory> {
    let cloth = graph.cloth().clone();
    let air = json!({ "air_density": 1.2, "air_drag": 0.3, "wind": [0.5, 0.1, -0.4] });
    let provenance = Provenance {
        frame_rate: graph.frame_rate(),
        scene: json!({ "setting": { "environment": air } }),
        made_by: "a formula".to_owned(),
    };
    let rest = graph.rest_positions();
    let positions =
        (0..FRAMES).flat_map(|frame| rest.iter().map(move |p| swung(*p, frame, number)));
    Trajectory::new(cloth, positions.collect(), provenance).context("a trajectory")
}

/// A swing whose lower parts lag behind, with ripples and a slow turn of the whole.
fn swung(p: Vec3, frame: usize, number: usize) -> Vec3 {
    let p = p.as_dvec3();
    let (time, depth) = (0.11 * frame as f64 + number as f64, 1.0 - p.y);
    let lag = time - 0.8 * depth;
    let ripple = 0.04 * depth * (6.0 * p.z + 1.3 * time).sin();
    let lift = 0.05 * lag.cos() * (1.0 + depth);
    let moved = p + DVec3::new(0.2 * lag.sin() + ripple, lift, 0.1 * (0.7 * lag).sin());
    let (sin, cos) = (0.3 * (0.5 * time).sin()).sin_cos();
    let (x, z) = (cos * moved.x + sin * moved.z, cos * moved.z - sin * moved.x);
    DVec3::new(x, moved.y, z).as_vec3()
}
