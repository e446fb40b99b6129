//! Rollouts on a GPU against those of the processor.

use crate::conformance::{HandlesEnd, check_correctable};
use glam::{DVec3, Vec3};
use selvedge_cloth::{Correctable, HandleTargets, StepError, Stepper};
use selvedge_model::{Encoder, LearnedStepper, ModelSpec, RolloutError, Yaw};

use super::*;
use crate::test_graphs::{cloth, full_specs, gpu, model, shaken};

/// Positions of the handles of a cloth in a frame: on a swing.
fn targets(graph: &ClothGraph, frame: usize) -> Vec<Vec3> {
    let turn = Yaw::from_angle(0.02 * frame as f64);
    let rest = graph.handles().select(graph.cloth().rest_positions());
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

type GpuStepper = LearnedStepper<OnGpu>;

fn started(
    gpu: &Arc<Gpu>,
    model: &Arc<Model>,
    graph: ClothGraph,
    start: &[&[Vec3]],
) -> Result<GpuStepper, RolloutError> {
    let network = OnGpu::new(gpu, model, graph.connectivity()).expect("room");
    LearnedStepper::on(network, Arc::clone(model), graph, start)
}

fn on_gpu(gpu: &Arc<Gpu>, model: &Arc<Model>, graph: ClothGraph, start: &[&[Vec3]]) -> GpuStepper {
    started(gpu, model, graph, start).expect("a stepper")
}

#[test]
fn a_rollout_is_that_of_the_processor() {
    let Some(gpu) = gpu() else { return };
    for spec in full_specs() {
        let graph = cloth(5, 3);
        let model = Arc::new(model(&spec, 1e-3, 7));
        let start = shaken(graph.cloth().rest_positions(), 0.005, 9);
        let start: [&[Vec3]; 2] = [graph.cloth().rest_positions(), &start];
        let mut cpu =
            LearnedStepper::new(Arc::clone(&model), graph.clone(), &start).expect("a start");
        let mut device = on_gpu(&gpu, &model, graph.clone(), &start);
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
            farthest(device.positions(), graph.cloth().rest_positions()) > 0.03,
            "it moves"
        );
    }
}

#[test]
fn a_stepper_on_a_gpu_conforms() {
    let Some(gpu) = gpu() else { return };
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let spec = ModelSpec::physical(encoder, 12, 1);
        let (graph, model) = (cloth(4, 1), Arc::new(model(&spec, 1e-3, 7)));
        let make = || {
            on_gpu(
                &gpu,
                &model,
                graph.clone(),
                &[graph.cloth().rest_positions()],
            )
        };
        check_correctable(make, HandlesEnd::AtTargets);
    }
}

#[test]
fn a_frame_that_is_not_finite_is_not_taken() {
    let Some(gpu) = gpu() else { return };
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 12, 1);
    let (graph, model) = (cloth(4, 1), Arc::new(model(&spec, 1e-3, 7)));
    let mut stepper = on_gpu(
        &gpu,
        &model,
        graph.clone(),
        &[graph.cloth().rest_positions()],
    );
    let mut other = on_gpu(
        &gpu,
        &model,
        graph.clone(),
        &[graph.cloth().rest_positions()],
    );
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
fn frames_of_somebody_else_are_gone_on_from_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let spec = ModelSpec::physical(encoder, 12, 1);
        let (graph, model) = (cloth(5, 1), Arc::new(model(&spec, 1e-3, 7)));
        let start: [&[Vec3]; 1] = [graph.cloth().rest_positions()];
        let mut cpu =
            LearnedStepper::new(Arc::clone(&model), graph.clone(), &start).expect("a start");
        let mut device = on_gpu(&gpu, &model, graph.clone(), &start);
        for frame in 1..=9 {
            let mut both: [&mut dyn Correctable; 2] = [&mut cpu, &mut device];
            for stepper in &mut both {
                let other = shaken(graph.cloth().rest_positions(), 0.002, frame as u64);
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

#[test]
fn a_handle_that_lets_go_is_free_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 12, 1);
    let (graph, model) = (cloth(5, 1), Arc::new(model(&spec, 1e-3, 7)));
    let start: [&[Vec3]; 1] = [graph.cloth().rest_positions()];
    let mut cpu = LearnedStepper::new(Arc::clone(&model), graph.clone(), &start).expect("a start");
    let mut device = on_gpu(&gpu, &model, graph.clone(), &start);
    let released = graph.handles().vertices()[1].index();
    for frame in 1..=6 {
        let mut targets = handle_targets(&graph, frame);
        if frame > 3 {
            targets = targets.releasing(vec![false, true]).expect("targets");
        }
        cpu.step(&targets).expect("a frame");
        device.step(&targets).expect("a frame");
        let target = targets.end()[1].as_vec3();
        assert_eq!(device.positions()[released] == target, frame <= 3);
        let off = farthest(cpu.positions(), device.positions());
        assert!(off < 2e-5, "frame {frame}: {off} m");
    }
}

#[test]
fn a_hundred_frames_stay_within_a_tenth_of_a_millimetre() {
    let Some(gpu) = gpu() else { return };
    let spec = ModelSpec::physical(Encoder::MLP, 16, 2);
    let (graph, model) = (cloth(5, 3), Arc::new(model(&spec, 1e-5, 7)));
    let start: [&[Vec3]; 1] = [graph.cloth().rest_positions()];
    let mut cpu = LearnedStepper::new(Arc::clone(&model), graph.clone(), &start).expect("a start");
    let mut device = on_gpu(&gpu, &model, graph.clone(), &start);
    for frame in 1..=100 {
        let targets = handle_targets(&graph, frame);
        cpu.step(&targets).expect("a frame");
        device.step(&targets).expect("a frame");
    }
    let off = farthest(cpu.positions(), device.positions());
    eprintln!("after 100 frames: {off:.1e} m off");
    assert!(off < 1e-4, "{off} m");
}

#[test]
fn a_start_that_does_not_fit_is_an_error() {
    let Some(gpu) = gpu() else { return };
    let spec = ModelSpec::physical(Encoder::MLP, 8, 1);
    let (graph, model) = (cloth(4, 1), Arc::new(model(&spec, 1e-3, 7)));
    let fitting = graph.cloth().rest_positions().to_vec();
    let refused = started(&gpu, &model, graph, &[&fitting[1..]]);
    let (expected, found) = (16, 15);
    assert_eq!(refused.err(), Some(RolloutError::Count { expected, found }));
}

/// The energy of such a velocity is beyond the largest number of 32 bits, while the positions of
/// the next frame are not. A ReLU would make 0 of what follows from it, on some devices.
#[test]
fn an_input_that_is_no_number_is_an_error_of_the_frame() {
    let Some(gpu) = gpu() else { return };
    let spec = ModelSpec::physical(Encoder::MLP, 12, 1);
    let (graph, model) = (cloth(4, 1), Arc::new(model(&spec, 1e-3, 7)));
    let rest = graph.cloth().rest_positions().to_vec();
    let free = graph.handle_mask().iter().position(|held| !held);
    let mut fast = rest.clone();
    fast[free.expect("a free vertex")].x += 1e20;
    let targets = handle_targets(&graph, 1);
    let mut stepper = on_gpu(&gpu, &model, graph.clone(), &[&rest, &fast]);
    let error = stepper.step(&targets).expect_err("no number");
    assert!(
        matches!(error, StepError::NonFinite { frame: 1, .. }),
        "{error}"
    );
    assert_eq!((stepper.frame(), stepper.positions()), (0, &fast[..]));
}
