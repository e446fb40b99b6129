//! Trainings on a device against the CPU's: plans that read what they wrote, gradients, losses of
//! many steps, checkpoints that go from one to the other.

mod conformance;
mod swinging;

use std::cell::Cell;

use selvedge_model::{EdgeFeature, Encoder, ModelSpec, Network, NodeFeature};
use selvedge_train::{
    Arithmetic, Engine, EngineError, EngineMaker, OnProcessor, Setup, TrainConfig, Trainer,
    TruthProbability, UnrollFrames,
};

use super::slot_arrays::{sizes_of, union_sizes};
use super::{OnDevice, TrainingPlan};

use crate::cloths::losses::SlotSizes;
use crate::device::Precision;
use crate::schedule::Trace;
use crate::test_graphs::device;
use conformance::{TrainingCheck, training};
use swinging::{Swinging, config, two_cloths};

/// All columns.
fn everything(encoder: Encoder) -> ModelSpec {
    let mut spec = ModelSpec::physical(encoder, 8, 2);
    spec.node_features.insert(NodeFeature::Acceleration);
    spec.edge_features.insert(EdgeFeature::MaterialVector);
    spec
}

fn encoders() -> [Encoder; 3] {
    [
        Encoder::MLP,
        Encoder::Gru { window: 3 },
        Encoder::Gru { window: 2 },
    ]
}

/// Noise, a mean of the weights, clipping, the model's own predictions, and dropout
/// where there is something to drop; through so many frames at a time.
fn busy(model: ModelSpec, frames: usize) -> TrainConfig {
    let mut cfg = config(model);
    cfg.noise.deviation = 0.003;
    cfg.weight_average = Some(0.9);
    cfg.gradient_clip = Some(1.0);
    cfg.loss_cap = Some(50.0);
    let encoder = cfg.model.encoder;
    if encoder.is_recurrent() {
        cfg.dropout = 0.2;
    }
    cfg.scheduled_sampling.truth = TruthProbability::Linear {
        start: 1,
        end: 3,
        probability: 0.3,
    };
    cfg.unroll = UnrollFrames::Constant { frames };
    if frames > 1 {
        cfg.losses.kinetic_energy = 0.0;
    }
    cfg
}

fn check(data: &Swinging, cfg: &TrainConfig, steps: usize) -> TrainingCheck {
    let device = device();
    let mut make = |engine: &dyn EngineMaker| Trainer::new(cfg.clone(), &data.dataset, engine);
    let checked = training(device, Precision::Full, &mut make, steps);
    checked.expect("both trainings")
}

#[test]
fn plans_read_what_they_wrote_whatever_the_encoder_and_the_frames() {
    let slot = SlotSizes {
        vertices: 13,
        arcs: 52,
        faces: 16,
    };
    for (encoder, frames) in encoders().into_iter().flat_map(|e| [(e, 1), (e, 3)]) {
        let cfg = busy(everything(encoder), frames);
        let network = Network::new(&cfg.model).expect("a spec");
        let plan = TrainingPlan::new(&cfg, &network, slot);
        for count in 1..=frames {
            let mut trace = Trace::new(&plan.plan, plan.program.sizes());
            plan.given()
                .into_iter()
                .for_each(|region| trace.give(region));
            let frames = &plan.frames[..count];
            let forth = frames.iter().map(|frame| &frame.forward);
            let back = frames.iter().rev().map(|frame| &frame.backward);
            let all = std::iter::once(&plan.pack).chain(forth);
            let all = all.chain([&plan.begin]).chain(back).chain([&plan.update]);
            for schedule in all {
                let followed = trace.follow(schedule);
                followed.unwrap_or_else(|error| panic!("{encoder:?}, {count} frames: {error}"));
            }
            assert!(trace.holds(plan.gradient) && trace.holds(plan.adam.norm));
        }
    }
}

#[test]
fn slots_hold_the_largest_cloth_and_one_vertex_more_where_cloths_differ() {
    let data = two_cloths();
    /// Makes nothing, but looks at the cloths.
    struct Look(Cell<SlotSizes>);
    impl EngineMaker for Look {
        fn arithmetic(&self) -> Arithmetic {
            Arithmetic::OnDevice
        }
        fn make(&self, setup: Setup<'_>) -> Result<Box<dyn Engine>, EngineError> {
            self.0.set(sizes_of(setup.graphs()));
            Err(EngineError("looked at".into()))
        }
    }
    let look = Look(Cell::new(SlotSizes::default()));
    let refused = Trainer::new(config(everything(Encoder::MLP)), &data.dataset, &look);
    let message = refused.err().map(|error| error.to_string());
    assert_eq!(message.as_deref(), Some("looked at"));
    let slot = look.0.get();
    assert_eq!(slot.vertices, 12 + 1);
    let union = union_sizes(3, slot);
    assert_eq!(
        [union.cloths, union.vertices, union.arcs],
        [3, 39, 3 * slot.arcs]
    );
}

#[test]
fn a_step_has_the_loss_and_the_gradient_of_the_cpu() {
    let data = two_cloths();
    for encoder in encoders() {
        for frames in [1, 3] {
            let found = check(&data, &busy(everything(encoder), frames), 1);
            let what = format!("{encoder:?}, {frames} frames: {found:?}");
            // The losses are f64, of predictions that are off by 1e-6.
            assert!(found.first_loss < 1e-4, "{what}");
            assert!(found.gradient < 1e-4, "{what}");
        }
    }
}

#[test]
fn the_baseline_has_the_gradient_of_the_cpu_too() {
    let data = two_cloths();
    for frames in [1, 2] {
        let cfg = busy(ModelSpec::mesh_graph_nets(8, 2), frames);
        let found = check(&data, &cfg, 1);
        assert!(found.gradient < 1e-4, "{frames} frames: {found:?}");
    }
}

#[test]
fn a_hundred_steps_from_one_seed_have_the_losses_of_the_cpu() {
    let data = two_cloths();
    for (encoder, frames) in [(Encoder::Gru { window: 3 }, 1), (Encoder::MLP, 2)] {
        let cfg = busy(everything(encoder), frames);
        let found = check(&data, &cfg, 100);
        // Rounding grows with every step that is taken and every prediction that is gone on from;
        // another draw or another term would be off by the whole at once.
        assert!(found.losses < 0.02, "{encoder:?}: {found:?}");
        assert!(found.weights < 0.02, "{encoder:?}: {found:?}");
    }
}

#[test]
fn a_checkpoint_goes_on_from_one_device_on_the_other() {
    let data = two_cloths();
    let device = device();
    let cfg = busy(everything(Encoder::Gru { window: 3 }), 1);
    let checkpoint = data.folder.path().join("checkpoint");
    let take = |trainer: &mut Trainer| {
        (0..6)
            .map(|_| trainer.step().expect("a step").terms.total)
            .sum::<f64>()
    };
    let cpu = OnProcessor::default();
    let on_device = OnDevice {
        device,
        precision: Precision::Full,
    };
    let engines: [&dyn EngineMaker; 2] = [&cpu, &on_device];
    let fresh = |engine: &dyn EngineMaker| {
        Trainer::new(cfg.clone(), &data.dataset, engine).expect("a training")
    };
    let mut whole = fresh(&cpu);
    take(&mut whole);
    let expected = take(&mut whole);
    for first in [0, 1] {
        let mut trainer = fresh(engines[first]);
        take(&mut trainer);
        trainer.collect().expect("weights");
        trainer.save(&checkpoint).expect("room");
        let other = engines[1 - first];
        let resumed = Trainer::resume(cfg.clone(), &data.dataset, &checkpoint, other);
        let mut resumed = resumed.expect("a checkpoint");
        let found = take(&mut resumed);
        assert!(
            (found - expected).abs() < 1e-3 * expected,
            "{first}: {found}, {expected}"
        );
        resumed.collect().expect("weights");
        let [found, expected] = [&resumed, &whole].map(Trainer::learned);
        assert_eq!(found.adam.steps(), 12);
        for (found, expected) in [
            (&found.weights[..], &expected.weights[..]),
            (found.adam.first_moment(), expected.adam.first_moment()),
            (
                found.averaged.as_deref().unwrap_or(&[]),
                expected.averaged.as_deref().unwrap_or(&[]),
            ),
        ] {
            let largest = expected.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
            let pairs = found.iter().zip(expected);
            let off = pairs.fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
            assert!(off < 1e-3 * largest, "{first}: {off} of {largest}");
        }
    }
}

#[test]
fn too_little_memory_says_how_many_samples_fit() {
    struct Small(usize);
    impl crate::device::Device for Small {
        fn name(&self) -> String {
            "a small device".to_owned()
        }
        fn free_bytes(&self) -> Result<usize, crate::device::DeviceError> {
            Ok(self.0)
        }
        fn load(
            &self,
            _: &crate::kernels::Program,
            _: &crate::schedule::plan::Plan,
            _: Precision,
        ) -> Result<Box<dyn crate::device::Loaded>, crate::device::DeviceError> {
            unreachable!("there is no room")
        }
    }
    let data = two_cloths();
    let mut cfg = config(everything(Encoder::MLP));
    cfg.batch.samples = 40;
    let refusal = |bytes: usize| {
        let engine = OnDevice {
            device: &Small(bytes),
            precision: Precision::Full,
        };
        let refused = Trainer::new(cfg.clone(), &data.dataset, &engine);
        refused.err().expect("no room").to_string()
    };
    let message = refusal(1_000_000);
    assert!(
        message.contains("this training needs") && message.contains("fits"),
        "{message}"
    );
    let message = refusal(1000);
    assert!(
        message.contains("not even batch.samples = 1 fits"),
        "{message}"
    );
}
