//! `selvedge bench conformance`: what a GPU computes, held against the processor's engine.
//!
//! Bounds: a forward pass of normalised numbers 1e-5, in parts of the largest where that is above
//! 1; a rollout 2e-5 m after so many frames of small accelerations, which the integration doubles;
//! gradients and trainings as `learning` says, bounds of edges as `limits` does. Other precisions
//! than full are told without bounds. What fails is a check that does not hold, and the rest goes
//! on.

mod learning;
mod limits;

use std::sync::Arc;

use anyhow::{bail, ensure};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::{HandleTargets, Stepper};
use selvedge_gpu::bench::NetworkCase;
use selvedge_gpu::bench::inference::Inference;
use selvedge_gpu::device::{Device, Precision};
use selvedge_gpu::rollout::stepper::GpuStepper;
use selvedge_lab::machine::{self, DeviceName};
use selvedge_lab::models::NamedModel;
use selvedge_model::{
    ClothGraph, Connectivity, Extent, Input, LearnedStepper, Model, Pass, Workspace,
};
use serde::Serialize;
use serde_json::json;

use super::cloths::hanging;
use super::gpu::model;
use super::variants::named;
use crate::cli::ConformanceArgs;
use crate::output::{Answer, End, Table};
use crate::{failure, interrupt};

/// Most that a normalised acceleration may be off, in parts of the largest of the pass where that
/// is above 1.
const FORWARD: f64 = 1e-5;

/// Most that a vertex may be off after a rollout `[m]`.
const ROLLOUT: f64 = 2e-5;

/// Something that was compared.
#[derive(Serialize)]
struct Check {
    /// The name of the model.
    model: String,
    /// The quantity.
    what: String,
    /// The difference; none where the comparison failed.
    off: Option<f64>,
    /// The largest difference that holds; none where there is no bound.
    bound: Option<f64>,
    /// The reason where the comparison failed.
    failure: Option<String>,
}

impl Check {
    fn holds(&self) -> bool {
        match (self.off, self.bound) {
            (None, _) => false,
            // Not where it is no number.
            (Some(off), Some(bound)) => off <= bound,
            (Some(off), None) => off.is_finite(),
        }
    }
}

/// A bound of a difference.
#[derive(Clone, Copy)]
enum Bound {
    /// As rounding in full precision goes; other precisions have no bound.
    Rounding(f64),
    /// Whatever the precision.
    Always(f64),
}

/// All that was compared.
struct Checks {
    precision: Precision,
    all: Vec<Check>,
}

impl Checks {
    /// Adds what was found, or why nothing was.
    fn add(&mut self, model: &str, what: &str, off: anyhow::Result<f64>, bound: Bound) {
        let (off, failure) = match off {
            Ok(off) => (Some(off), None),
            Err(error) => (None, Some(failure::chain(&error))),
        };
        let bound = match bound {
            Bound::Rounding(bound) => (self.precision == Precision::Full).then_some(bound),
            Bound::Always(bound) => Some(bound),
        };
        self.all.push(Check {
            model: model.to_owned(),
            what: what.to_owned(),
            off,
            bound,
            failure,
        });
    }

    fn wrong(&self) -> usize {
        self.all.iter().filter(|check| !check.holds()).count()
    }

    /// A table, then what failed.
    fn text(&self) -> String {
        let mut table = Table::new(["model", "what", "off", "bound", ""]);
        let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.1e}"));
        let mut failures = String::new();
        for check in &self.all {
            let (model, what) = (&check.model, &check.what);
            let [off, bound] = [check.off, check.bound].map(number);
            let holds = match &check.failure {
                Some(failure) => {
                    failures += &format!("{model}, {what}: {failure}\n");
                    "FAILED"
                }
                None if !check.holds() => "OFF",
                None if check.bound.is_none() => "",
                None => "ok",
            };
            table.row([model.clone(), what.clone(), off, bound, holds.to_owned()]);
        }
        format!("{table}\n{failures}")
    }
}

/// Compares everything.
///
/// # Errors
/// A device that is not there. What is off, or fails, is told with the rest.
pub(super) fn run(args: &ConformanceArgs) -> anyhow::Result<Answer> {
    ensure!(
        args.machine.device != DeviceName::Cpu,
        "cpu is what a GPU is held against: take --device cuda"
    );
    let device = machine::open_device(args.machine.device)?;
    let precision = machine::precision_of(args.machine.precision());
    let conformance = Conformance {
        device: &*device,
        precision,
        frames: usize::from(args.frames),
    };
    let mut checks = Checks {
        precision,
        all: Vec::new(),
    };
    for variant in named(&args.variant)? {
        if interrupt::requested() {
            break;
        }
        let graph = hanging(variant.vertices)?;
        let model = Arc::new(model(&variant)?);
        conformance.check(variant.name, &model, &graph, &mut checks);
        limits::check(&conformance, variant.name, &model, &graph, &mut checks);
    }
    if !interrupt::requested() {
        let shipped = NamedModel::open(Some("small".as_ref()))?;
        let graph = hanging(289)?;
        // A network to measure may be called the same.
        let name = format!("{}, shipped", shipped.name);
        let model = Arc::new(limits::limited(&shipped.model, None)?);
        conformance.check(&name, &model, &graph, &mut checks);
    }
    learning::check(&*device, args, &mut checks)?;
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    let report = json!({
        "device": device.name(), "precision": args.machine.precision().name(), "checks": checks.all,
    });
    let name = format!(
        "{}, precision {}",
        device.name(),
        args.machine.precision().name()
    );
    let answer = Answer::new(format!("{name}\n{}", checks.text()), &report)?.ended(end);
    Ok(match checks.wrong() {
        0 => answer,
        wrong => answer.failing(format!(
            "{name}: {wrong} of {} checks do not hold",
            checks.all.len()
        )),
    })
}

struct Conformance<'a> {
    device: &'a dyn Device,
    precision: Precision,
    frames: usize,
}

impl Conformance<'_> {
    fn check(&self, name: &str, model: &Arc<Model>, graph: &ClothGraph, checks: &mut Checks) {
        let (off, differing) = match self.forward(model, graph) {
            Ok((off, differing)) => (Ok(off), Ok(differing as f64)),
            Err(error) => (Err(error), Err(anyhow::anyhow!("there is no forward pass"))),
        };
        checks.add(name, "forward pass", off, Bound::Rounding(FORWARD));
        let what = "plain, recorded, replayed: numbers that differ";
        checks.add(name, what, differing, Bound::Always(0.0));
        if interrupt::requested() {
            return;
        }
        let what = format!("rollout of {} frames, m", self.frames);
        let off = self.rollout(model, graph);
        checks.add(name, &what, off, Bound::Rounding(ROLLOUT));
    }

    /// Compares normalised accelerations for drawn features. Returns their distance, as [`FORWARD`]
    /// has it, and the count of numbers that differ between plain, recorded and replayed runs.
    fn forward(&self, model: &Model, graph: &ClothGraph) -> anyhow::Result<(f64, usize)> {
        let (network, spec) = (model.network(), model.spec());
        let arcs = Connectivity::of(graph.topology());
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut numbers = |count: usize| -> Vec<f32> {
            (0..count)
                .map(|_| 3.0 * rng.random::<f32>() - 1.5)
                .collect()
        };
        let nodes = numbers(spec.window() * arcs.vertex_count() * spec.node_width());
        let edges = numbers(spec.window() * arcs.arc_count() * spec.edge_width());
        let input = Input {
            nodes: &nodes,
            arcs: &edges,
        };
        let mut workspace = Workspace::new();
        let pass = Pass::Inference;
        let expected = network.forward(model.weights(), &arcs, input, pass, &mut workspace);
        let case = NetworkCase {
            network,
            weights: model.weights(),
            graph: &arcs,
            extent: Extent::Whole,
        };
        let mut inference = Inference::new(self.device, case, self.precision)?;
        inference.put(input)?;
        // By plain calls, while it is recorded, and from the recording.
        let mut found = Vec::new();
        for _ in 0..3 {
            inference.run()?;
            found.push(inference.output()?);
        }
        if let Some(reason) = inference.unrecorded() {
            bail!("it cannot be replayed from a recording: {reason}");
        }
        let largest = expected.iter().fold(1.0_f32, |most, x| most.max(x.abs()));
        let apart = |(x, y): (&f32, &f32)| f64::from((x - y).abs() / largest);
        let off = worst(0.0, found[0].iter().zip(expected).map(apart));
        let plain = &found[0];
        let differing = found[1..].iter().flat_map(|other| plain.iter().zip(other));
        let differing = differing.filter(|(x, y)| x.to_bits() != y.to_bits());
        Ok((off, differing.count()))
    }

    /// The largest distance of vertices after some frames, the handles on a swing `[m]`.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn checks(precision: Precision) -> Checks {
        let mut checks = Checks {
            precision,
            all: Vec::new(),
        };
        for (what, off) in [("near", 1e-6), ("far", 1e-3), ("none", f64::NAN)] {
            checks.add("mlp", what, Ok(off), Bound::Rounding(1e-5));
        }
        let failed = || Err(anyhow::anyhow!("no memory").context("a pass"));
        checks.add("mlp", "failing", failed(), Bound::Rounding(1e-5));
        checks.add("mlp", "differing", Ok(2.0), Bound::Always(0.0));
        checks
    }

    #[test]
    fn what_is_off_and_what_fails_does_not_hold_and_is_told_with_the_rest() {
        let found = checks(Precision::Full);
        let held = found.all.iter().map(Check::holds);
        assert_eq!(held.collect::<Vec<_>>(), [true, false, false, false, false]);
        assert_eq!(found.wrong(), 4);
        let text = found.text();
        let ends: Vec<&str> = text.lines().skip(2).collect();
        assert!(ends[0].ends_with("ok") && ends[1].ends_with("OFF") && ends[2].ends_with("OFF"));
        assert!(
            ends[3].ends_with("FAILED") && ends[4].ends_with("OFF"),
            "{text}"
        );
        assert!(text.contains("mlp, failing: a pass: no memory"), "{text}");
    }

    #[test]
    fn other_precisions_have_no_bounds_of_rounding() {
        let found = checks(Precision::Half);
        let held = found.all.iter().map(Check::holds);
        assert_eq!(held.collect::<Vec<_>>(), [true, true, false, false, false]);
    }
}
