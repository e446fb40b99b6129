//! `selvedge bench conformance`: what a GPU computes, held against the processor's engine.
//!
//! Bounds: a forward pass of normalised numbers 1e-5, in parts of the largest where that is above 1; a rollout 2e-5 m after so many frames of small
//! accelerations, which the integration doubles; gradients and trainings as `learning` says.

mod learning;

use std::sync::Arc;

use anyhow::{Context, bail, ensure};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::{HandleTargets, Stepper};
use selvedge_gpu::device::{Device, Precision};
use selvedge_gpu::inference::Inference;
use selvedge_gpu::stepper::GpuStepper;
use selvedge_model::{
    ClothGraph, Connectivity, Extent, Input, LearnedStepper, Model, Pass, Workspace,
};
use serde::Serialize;
use serde_json::json;

use super::cloths::hanging;
use super::gpu::model;
use super::variants::named;
use crate::cli::{ConformanceArgs, DeviceName};
use crate::output::{Answer, End, Table};
use crate::{interrupt, learned, machine};

/// Most that a normalised acceleration may be off, in parts of the largest of the pass where that is above 1.
const FORWARD: f64 = 1e-5;

/// Most that a vertex may be off after a rollout `[m]`.
const ROLLOUT: f64 = 2e-5;

/// Something that was compared.
#[derive(Serialize)]
pub(super) struct Check {
    /// Whose.
    pub(super) model: String,
    /// What.
    pub(super) what: String,
    /// How far it is off.
    pub(super) off: f64,
    /// How far it may be.
    pub(super) bound: f64,
}

/// Compares everything.
///
/// # Errors
/// A device that is not there, or fails, or is off.
pub(super) fn run(args: &ConformanceArgs) -> anyhow::Result<Answer> {
    ensure!(
        args.machine.device != DeviceName::Cpu,
        "cpu is what a GPU is held against: take --device cuda"
    );
    let device = machine::device(args.machine.device)?;
    let conformance = Conformance {
        device: &*device,
        precision: machine::precision(args.machine.precision),
        frames: usize::from(args.frames),
    };
    let mut checks = Vec::new();
    for variant in named(&args.variant)? {
        if interrupt::requested() {
            break;
        }
        let graph = hanging(variant.vertices)?;
        let model = Arc::new(model(&variant)?);
        conformance.check(variant.name, &model, &graph, &mut checks)?;
    }
    if !interrupt::requested() {
        let shipped = learned::open(None)?;
        let graph = hanging(289)?;
        // A network to measure may be called the same.
        let name = format!("{}, shipped", shipped.name);
        conformance.check(&name, &shipped.model, &graph, &mut checks)?;
    }
    learning::check(&*device, conformance.precision, args, &mut checks)?;
    let mut table = Table::new(["model", "what", "off", "bound", ""]);
    for check in &checks {
        let [off, bound] = [check.off, check.bound].map(|x| format!("{x:.1e}"));
        let holds = if check.holds() { "ok" } else { "OFF" };
        table.row([
            check.model.clone(),
            check.what.clone(),
            off,
            bound,
            holds.to_owned(),
        ]);
    }
    let wrong = checks.iter().filter(|check| !check.holds()).count();
    if wrong > 0 {
        bail!(
            "{} computes something else than the processor:\n{table}",
            device.name()
        );
    }
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    let report = json!({ "device": device.name(), "checks": checks });
    Ok(Answer::new(format!("{}\n{table}", device.name()), &report)?.ended(end))
}

impl Check {
    /// Not where it is no number.
    fn holds(&self) -> bool {
        self.off <= self.bound
    }
}

struct Conformance<'a> {
    device: &'a dyn Device,
    precision: Precision,
    frames: usize,
}

impl Conformance<'_> {
    fn check(
        &self,
        name: &str,
        model: &Arc<Model>,
        graph: &ClothGraph,
        checks: &mut Vec<Check>,
    ) -> anyhow::Result<()> {
        let mut add = |what: String, off: f64, bound: f64| {
            checks.push(Check {
                model: name.to_owned(),
                what,
                off,
                bound,
            });
        };
        let context = || format!("{name} on {}", self.device.name());
        let off = self.forward(model, graph).with_context(context)?;
        add("forward pass".to_owned(), off, FORWARD);
        if interrupt::requested() {
            return Ok(());
        }
        let off = self.rollout(model, graph).with_context(context)?;
        add(
            format!("rollout of {} frames, m", self.frames),
            off,
            ROLLOUT,
        );
        Ok(())
    }

    /// How far normalised accelerations for drawn features are apart, as [`FORWARD`] has it.
    fn forward(&self, model: &Model, graph: &ClothGraph) -> anyhow::Result<f64> {
        let (network, spec) = (model.network(), model.spec());
        let arcs = Connectivity::of(graph.topology());
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut numbers = |count: usize| -> Vec<f32> {
            (0..count)
                .map(|_| 3.0 * rng.random::<f32>() - 1.5)
                .collect()
        };
        let nodes = numbers(spec.node_window() * arcs.vertex_count() * spec.node_width());
        let edges = numbers(spec.edge_window() * arcs.arc_count() * spec.edge_width());
        let input = Input {
            nodes: &nodes,
            edges: &edges,
        };
        let mut workspace = Workspace::new();
        let pass = Pass::Inference;
        let expected = network.forward(model.weights(), &arcs, input, pass, &mut workspace);
        let both = (network, model.weights());
        let mut inference =
            Inference::new(self.device, both, &arcs, Extent::Whole, self.precision)?;
        inference.put(input)?;
        let largest = expected.iter().fold(1.0_f32, |most, x| most.max(x.abs()));
        let mut off = 0.0;
        // By plain calls, while it is recorded, and from the recording.
        for _ in 0..3 {
            inference.run()?;
            let found = inference.output()?;
            ensure!(
                found.len() == expected.len(),
                "an output of {} numbers",
                found.len()
            );
            off = worst(
                off,
                found
                    .iter()
                    .zip(expected)
                    .map(|(x, y)| f64::from((x - y).abs() / largest)),
            );
        }
        Ok(off)
    }

    /// How far vertices are apart after some frames, the handles on a swing `[m]`.
    fn rollout(&self, model: &Arc<Model>, graph: &ClothGraph) -> anyhow::Result<f64> {
        let start: [&[Vec3]; 1] = [graph.rest_positions()];
        let mut cpu = LearnedStepper::new(Arc::clone(model), graph.clone(), &start)?;
        let (device, same) = (self.device, Arc::clone(model));
        let mut gpu = GpuStepper::new(device, same, graph.clone(), &start, self.precision)?;
        let held = graph.handles().select(graph.rest_positions());
        for frame in 1..=self.frames {
            let moved = 0.002 * frame as f64 * DVec3::new(1.0, 0.3, 0.0);
            let targets = held.iter().map(|p| p.as_dvec3() + moved).collect();
            let targets = HandleTargets::at_frame_end(targets)?;
            cpu.step(&targets)?;
            gpu.step(&targets)?;
        }
        let pairs = cpu.positions().iter().zip(gpu.positions());
        Ok(worst(0.0, pairs.map(|(p, q)| f64::from(p.distance(*q)))))
    }
}

/// The largest; not a number where one is none.
fn worst(first: f64, all: impl Iterator<Item = f64>) -> f64 {
    all.fold(first, |a, b| {
        if b.is_nan() || a.is_nan() {
            f64::NAN
        } else {
            a.max(b)
        }
    })
}
