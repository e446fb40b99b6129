//! Trainings on a GPU against the processor's: gradients, losses of many steps, checkpoints that go
//! from one to the other.

use std::sync::Arc;

use selvedge_model::{EdgeFeature, Encoder, ModelSpec};
use selvedge_train::{
    EngineMaker, OnProcessor, TrainConfig, Trainer, TruthProbability, UnrollFrames,
};

use super::OnGpu;
use super::conformance_tests::{TrainingCheck, training};
use super::test_swinging::{Swinging, config, two_cloths};
use crate::gpu::Gpu;
use crate::test_graphs::gpu;

/// All columns.
fn everything(encoder: Encoder) -> ModelSpec {
    let mut spec = ModelSpec::physical(encoder, 8, 2);
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

fn check(gpu: &Arc<Gpu>, data: &Swinging, cfg: &TrainConfig, steps: usize) -> TrainingCheck {
    let on_gpu = OnGpu {
        gpu: Arc::clone(gpu),
    };
    let mut make = |engine: &dyn EngineMaker| Trainer::new(cfg.clone(), &data.dataset, engine);
    let checked = training(&on_gpu, &mut make, steps);
    checked.expect("both trainings")
}

#[test]
fn a_step_has_the_loss_and_the_gradient_of_the_processor() {
    let Some(gpu) = gpu() else { return };
    let data = two_cloths();
    for encoder in encoders() {
        for frames in [1, 3] {
            let found = check(&gpu, &data, &busy(everything(encoder), frames), 1);
            let what = format!("{encoder:?}, {frames} frames: {found:?}");
            // The losses are f64, of predictions that are off by 1e-6.
            assert!(found.first_loss < 1e-4, "{what}");
            assert!(found.gradient < 1e-4, "{what}");
        }
    }
}

#[test]
fn the_baseline_has_the_gradient_of_the_processor_too() {
    let Some(gpu) = gpu() else { return };
    let data = two_cloths();
    for frames in [1, 2] {
        let cfg = busy(ModelSpec::mesh_graph_nets(8, 2), frames);
        let found = check(&gpu, &data, &cfg, 1);
        assert!(found.gradient < 1e-4, "{frames} frames: {found:?}");
    }
}

#[test]
fn two_hundred_steps_from_one_seed_have_the_losses_of_the_processor() {
    let Some(gpu) = gpu() else { return };
    let data = two_cloths();
    for (encoder, frames) in [(Encoder::Gru { window: 3 }, 1), (Encoder::MLP, 2)] {
        let mut cfg = busy(everything(encoder), frames);
        cfg.scheduled_sampling.truth = TruthProbability::Always {};
        let found = check(&gpu, &data, &cfg, 200);
        eprintln!("{encoder:?}, {frames} frames, 200 steps: {found:?}");
        // Another draw or another term would be off by the whole at once.
        assert!(found.losses < 0.01, "{encoder:?}: {found:?}");
        assert!(found.weights < 0.01, "{encoder:?}: {found:?}");
    }
}

#[test]
fn steps_from_own_predictions_have_the_losses_of_the_processor() {
    let Some(gpu) = gpu() else { return };
    let data = two_cloths();
    let cfg = busy(everything(Encoder::Gru { window: 3 }), 1);
    // The states of a young network run away, and rounding grows with them: by 1e-5 in 80 steps.
    let found = check(&gpu, &data, &cfg, 40);
    assert!(found.losses < 1e-4, "{found:?}");
}

#[test]
fn a_checkpoint_goes_on_from_one_engine_on_the_other() {
    let Some(gpu) = gpu() else { return };
    let data = two_cloths();
    let cfg = busy(everything(Encoder::Gru { window: 3 }), 1);
    let checkpoint = data.folder.path().join("checkpoint");
    let take = |trainer: &mut Trainer| {
        (0..6)
            .map(|_| trainer.step().expect("a step").terms.total)
            .sum::<f64>()
    };
    let cpu = OnProcessor::default();
    let on_gpu = OnGpu { gpu };
    let engines: [&dyn EngineMaker; 2] = [&cpu, &on_gpu];
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
