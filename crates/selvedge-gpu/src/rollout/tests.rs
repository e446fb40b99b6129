//! Rollouts on a device against those of the CPU engine.

use glam::DVec3;
use selvedge_cloth::conformance::{HandlesEnd, check_correctable};
use selvedge_cloth::{Correctable, HandleTargets, StepError, Stepper};
use selvedge_model::{Encoder, LearnedStepper, ModelSpec};

use super::*;
use crate::rollout::stepper::GpuStepper;
use crate::schedule::Trace;
use crate::test_graphs::{cloth, device, full_specs, model, shaken, side_by_side};

/// Positions of the handles of a cloth in a frame: on a swing.
fn targets(graph: &ClothGraph, frame: usize) -> Vec<Vec3> {
    let turn = Yaw::from_angle(0.02 * frame as f64);
    let rest = graph.handles().select(graph.rest_positions());
    let there = |p: &Vec3| turn.to_world(*p) + 0.003 * frame as f32 * Vec3::new(1.0, 0.2, -0.5);
    rest.iter().map(there).collect()
}

fn handle_targets(graph: &ClothGraph, frame: usize) -> HandleTargets {
    let positions: Vec<DVec3> = targets(graph, frame).iter().map(|p| p.as_dvec3()).collect();
    HandleTargets::at_frame_end(positions).expect("targets")
}

fn farthest(a: &[Vec3], b: &[Vec3]) -> f32 {
    let pairs = a.iter().zip(b);
    pairs.map(|(p, q)| p.distance(*q)).fold(0.0, f32::max)
}

fn gpu(model: &Arc<Model>, graph: ClothGraph, start: &[&[Vec3]]) -> GpuStepper {
    let model = Arc::clone(model);
    let stepper = GpuStepper::new(device(), model, graph, start, Precision::Full);
    stepper.expect("a stepper")
}

#[test]
fn schedules_of_every_spec_read_what_was_written() {
    let graphs = [cloth(5, 1), cloth(4, 2)];
    for spec in full_specs() {
        let network = selvedge_model::Network::new(&spec).expect("a spec");
        let plan = RolloutPlan::new(&network, UnionSizes::of(&[&graphs[0], &graphs[1]]));
        let mut trace = Trace::new(&plan.plan, plan.program.sizes());
        plan.given()
            .into_iter()
            .for_each(|region| trace.give(region));
        for schedule in [&plan.pack, &plan.frame, &plan.frame] {
            trace.follow(schedule).expect("a schedule");
        }
    }
}

#[test]
fn a_rollout_is_that_of_the_cpu() {
    for spec in full_specs() {
        let graph = cloth(5, 3);
        let model = Arc::new(model(&spec, 1e-3, 7));
        let start = shaken(graph.rest_positions(), 0.005, 9);
        let start: [&[Vec3]; 2] = [graph.rest_positions(), &start];
        let mut cpu =
            LearnedStepper::new(Arc::clone(&model), graph.clone(), &start).expect("a start");
        let mut device = gpu(&model, graph.clone(), &start);
        for frame in 1..=12 {
            let targets = handle_targets(&graph, frame);
            cpu.step(&targets).expect("a frame");
            device.step(&targets).expect("a frame");
            let off = farthest(cpu.positions(), device.positions());
            // 1e-7 m of rounding per frame, doubled by the integration from frame to frame and fed
            // back.
            assert!(off < 2e-5, "frame {frame}: {off} m with {:?}", spec.encoder);
        }
        assert_eq!(device.frame(), 12);
        assert!(
            farthest(device.positions(), graph.rest_positions()) > 0.03,
            "it moves"
        );
    }
}

#[test]
fn several_cloths_move_as_each_alone() {
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 12, 2);
    let model = Arc::new(model(&spec, 1e-3, 7));
    let graphs = [cloth(4, 1), cloth(6, 2), cloth(5, 3)];
    let device = device();
    let starts: Vec<Vec<Vec3>> = graphs
        .iter()
        .map(|graph| shaken(graph.rest_positions(), 0.003, 4))
        .collect();
    let starts: Vec<[&[Vec3]; 1]> = starts.iter().map(|start| [&**start]).collect();
    let openings = graphs.iter().zip(&starts).map(|(graph, start)| Opening {
        graph: graph.clone(),
        start,
    });
    let precision = Precision::Full;
    let mut all =
        Rollout::new(device, Arc::clone(&model), openings.collect(), precision).expect("cloths");
    let mut alone: Vec<GpuStepper> = graphs
        .iter()
        .zip(&starts)
        .map(|(graph, start)| gpu(&model, graph.clone(), start))
        .collect();
    for frame in 1..=6 {
        let goals: Vec<Vec<Vec3>> = graphs.iter().map(|graph| targets(graph, frame)).collect();
        let goals: Vec<&[Vec3]> = goals.iter().map(|goal| &**goal).collect();
        all.step(&goals).expect("a frame");
        for (number, stepper) in alone.iter_mut().enumerate() {
            stepper
                .step(&handle_targets(&graphs[number], frame))
                .expect("a frame");
            let off = farthest(all.positions(number), stepper.positions());
            // To the last bit; on a card as far as from the CPU.
            assert!(off <= side_by_side(2e-5), "frame {frame}: {off} m");
        }
    }
}

#[test]
fn a_stepper_on_a_device_conforms() {
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let spec = ModelSpec::physical(encoder, 12, 1);
        let (graph, model) = (cloth(4, 1), Arc::new(model(&spec, 1e-3, 7)));
        let make = || gpu(&model, graph.clone(), &[graph.rest_positions()]);
        assert_eq!(check_correctable(make, HandlesEnd::AtTargets), Ok(()));
    }
}

#[test]
fn a_frame_that_is_not_finite_is_not_taken() {
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 12, 1);
    let (graph, model) = (cloth(4, 1), Arc::new(model(&spec, 1e-3, 7)));
    let mut stepper = gpu(&model, graph.clone(), &[graph.rest_positions()]);
    let mut other = gpu(&model, graph.clone(), &[graph.rest_positions()]);
    for frame in 1..=3 {
        let targets = handle_targets(&graph, frame);
        stepper.step(&targets).expect("a frame");
        other.step(&targets).expect("a frame");
    }
    let before = stepper.positions().to_vec();
    let far = HandleTargets::at_frame_end(vec![DVec3::splat(1e300); 2]).expect("targets");
    let found = stepper.step(&far).expect_err("not finite");
    assert!(
        matches!(found, StepError::NonFinite { frame: 4, .. }),
        "{found}"
    );
    assert_eq!((stepper.positions(), stepper.frame()), (&*before, 3));
    let none = HandleTargets::at_frame_end(Vec::new()).expect("targets");
    assert!(matches!(
        stepper.step(&none),
        Err(StepError::Handles { frame: 4, .. })
    ));
    let lost = vec![Vec3::NAN; before.len()];
    assert!(stepper.replace_frame(&lost).is_err() && stepper.take_frame(&lost).is_err());
    for frame in 4..=6 {
        let targets = handle_targets(&graph, frame);
        stepper.step(&targets).expect("a frame");
        other.step(&targets).expect("a frame");
        assert_eq!(
            stepper.positions(),
            other.positions(),
            "it goes on as if nothing had been"
        );
    }
}

#[test]
fn frames_of_somebody_else_are_gone_on_from_as_on_the_cpu() {
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let spec = ModelSpec::physical(encoder, 12, 1);
        let (graph, model) = (cloth(5, 1), Arc::new(model(&spec, 1e-3, 7)));
        let start: [&[Vec3]; 1] = [graph.rest_positions()];
        let mut cpu =
            LearnedStepper::new(Arc::clone(&model), graph.clone(), &start).expect("a start");
        let mut device = gpu(&model, graph.clone(), &start);
        for frame in 1..=9 {
            let mut both: [&mut dyn Correctable; 2] = [&mut cpu, &mut device];
            for stepper in &mut both {
                let other = shaken(graph.rest_positions(), 0.002, frame as u64);
                match frame {
                    3 => stepper.take_frame(&other).expect("a frame"),
                    _ => stepper
                        .step(&handle_targets(&graph, frame))
                        .expect("a frame"),
                }
                if frame == 6 {
                    stepper.replace_frame(&other).expect("a frame");
                }
            }
            assert_eq!(cpu.frame(), device.frame());
            let off = farthest(cpu.positions(), device.positions());
            assert!(off < 2e-5, "frame {frame}: {off} m with {encoder:?}");
        }
    }
}

/// The host with little memory.
struct Small(usize);

impl Device for Small {
    fn name(&self) -> String {
        "a small one".to_owned()
    }

    fn free_bytes(&self) -> Result<usize, DeviceError> {
        Ok(self.0)
    }

    fn load(
        &self,
        _: &crate::kernels::Program,
        _: &crate::schedule::plan::Plan,
        _: Precision,
    ) -> Result<Box<dyn Loaded>, DeviceError> {
        Err(DeviceError::NoDevice)
    }
}

#[test]
fn too_little_memory_is_said_before_anything_is_allocated_with_what_would_fit() {
    let spec = ModelSpec::physical(Encoder::Gru { window: 5 }, 32, 2);
    let graph = cloth(12, 1);
    let network = selvedge_model::Network::new(&spec).expect("a spec");
    let whole = RolloutPlan::new(&network, UnionSizes::of(&[&graph]))
        .plan
        .bytes();
    let message = |free: usize| {
        let opening = Opening {
            graph: graph.clone(),
            start: &[graph.rest_positions()],
        };
        let model = Arc::new(model(&spec, 1e-3, 7));
        let rollout = Rollout::new(&Small(free), model, vec![opening], Precision::Full);
        rollout.err().expect("no memory").to_string()
    };
    assert!(message(whole).contains("no GPU"), "that much is enough");
    let found = message(whole * 3 / 4);
    assert!(found.starts_with("this rollout needs"), "{found}");
    let fits = found
        .split("about ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next());
    let fits: usize = fits
        .and_then(|number| number.parse().ok())
        .expect("a number");
    // The weights take some of it.
    assert!((72..144 * 3 / 4 + 1).contains(&fits), "{found}");
    assert!(
        message(1000).contains("not even"),
        "the weights alone are too much"
    );
}
