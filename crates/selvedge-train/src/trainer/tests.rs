//! A training learns, repeats itself to the last bit, and keeps its weights where it fails.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use glam::Vec3;
use selvedge_cloth::{HandleTargets, Stepper};
use selvedge_data::SectionRule;
use selvedge_model::{Encoder, LearnedStepper};

use super::*;
use crate::schedule::LearningRate;
use crate::test_data::{
    ENGINE, Swinging, busy, config, saved, stepped, swinging, through, truth, two_cloths,
    with_threads,
};

fn encoders() -> [Encoder; 2] {
    [Encoder::MLP, Encoder::Gru { window: 3 }]
}

/// The bytes of checkpoint and model after `steps` steps.
fn bytes(cfg: TrainConfig, data: &Swinging, steps: usize) -> [Vec<u8>; 2] {
    written(&stepped(cfg, &data.dataset, steps), data)
}

/// The bytes of checkpoint and model.
fn written(trainer: &Trainer, data: &Swinging) -> [Vec<u8>; 2] {
    let (_, checkpoint) = saved(trainer, data, "checkpoint");
    let model = trainer.model("a note".to_owned()).expect("a model");
    [checkpoint, model.to_bytes().expect("bytes")]
}

#[test]
fn the_loss_of_one_sample_goes_down() {
    // Three frames are one sample.
    let data = swinging(&[("a", 9, 3)], SectionRule::Whole);
    for encoder in encoders() {
        let mut cfg = config(encoder);
        cfg.learning_rate = LearningRate::Constant { rate: 1e-2 };
        cfg.batch.samples = 1;
        let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
        assert_eq!(trainer.sample_count(), 1);
        let mut step = || trainer.step().expect("a step").terms.total;
        let first = step();
        let last = (0..150).map(|_| step()).last().expect("steps");
        assert!(last < 0.1 * first, "{encoder:?}: {first} to {last}");
    }
}

#[test]
fn threads_change_no_bit_and_seeds_do() {
    let data = two_cloths();
    for encoder in encoders() {
        let run = |cfg: TrainConfig, threads| with_threads(threads, || bytes(cfg, &data, 8));
        let one = run(busy(encoder), 1);
        assert_eq!(one, run(busy(encoder), 2), "{encoder:?}");
        let other = TrainConfig {
            seed: 4,
            ..busy(encoder)
        };
        assert_ne!(one, run(other, 1));
        // Without slots in runs this would say less than it seems to.
        let slots = stepped(busy(encoder), &data.dataset, 8).state.slots;
        assert!(slots.iter().any(|slot| slot.run > 0), "{encoder:?}");
    }
}

#[test]
fn a_step_that_is_given_up_leaves_the_training_as_it_was() {
    let data = two_cloths();
    for (encoder, frames) in [(Encoder::MLP, 1), (Encoder::Gru { window: 3 }, 3)] {
        let cfg = || through(frames, busy(encoder));
        let mut trainer = Trainer::new(cfg(), &data.dataset, &ENGINE).expect("a training");
        let mut given_up = 0;
        for _ in 0..8 {
            for wait in [0, 50, 200, 1000].map(Duration::from_micros) {
                let before = trainer.steps_done();
                let flag = Arc::new(AtomicBool::new(wait.is_zero()));
                trainer.stop_by(Arc::clone(&flag).into());
                let slots = trainer.state.slots.clone();
                let stepped = thread::scope(|scope| {
                    scope.spawn(|| {
                        thread::sleep(wait);
                        flag.store(true, Ordering::Relaxed);
                    });
                    trainer.step()
                });
                if let Err(error) = stepped {
                    let step = before + 1;
                    assert!(matches!(error, TrainError::Stopped { step: s } if s == step));
                    assert_eq!(trainer.state.slots, slots);
                    // Not a copy of their positions, but the very same.
                    let pairs = trainer.state.slots.iter().zip(&slots);
                    let frames = pairs.flat_map(|(a, b)| a.history.iter().zip(&b.history));
                    assert!(frames.into_iter().all(|(a, b)| Arc::ptr_eq(a, b)));
                    given_up += 1;
                }
            }
            trainer.stop_by(Stop::default());
            if trainer.steps_done() >= 8 {
                break;
            }
            trainer.step().expect("a step");
        }
        assert!(given_up > 0);
        let steps = usize::try_from(trainer.steps_done()).expect("few");
        let found = written(&trainer, &data);
        assert!(found == bytes(cfg(), &data, steps), "{encoder:?}");
    }
}

#[test]
fn the_model_is_made_of_the_mean_of_the_weights() {
    let data = two_cloths();
    let mut cfg = config(Encoder::MLP);
    cfg.weight_average = Some(0.3);
    let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
    let mut mean: Vec<f64> = trainer
        .learned
        .weights
        .iter()
        .map(|&w| f64::from(w))
        .collect();
    // (1 + n)/(10 + n) of it is left after n steps: 2/11, 3/12, and from the third on less than
    // 4/13.
    for left in [2.0 / 11.0, 3.0 / 12.0, 0.3, 0.3] {
        trainer.step().expect("a step");
        for (mean, &weight) in mean.iter_mut().zip(&trainer.learned.weights) {
            *mean = left * *mean + (1.0 - left) * f64::from(weight);
        }
    }
    let model = trainer.model(String::new()).expect("a model");
    assert_ne!(model.weights(), trainer.learned.weights);
    for (&found, expected) in model.weights().iter().zip(mean) {
        assert!((f64::from(found) - expected).abs() < 1e-6 * expected.abs().max(0.1));
    }
}

#[test]
fn a_step_that_is_not_finite_leaves_the_weights() {
    let data = two_cloths();
    let mut cfg = config(Encoder::MLP);
    cfg.learning_rate = LearningRate::Constant { rate: 1e30 };
    let mut trainer = stepped(cfg, &data.dataset, 1);
    let weights = trainer.learned.weights.clone();
    let adam = trainer.learned.adam.clone();
    for _ in 0..2 {
        let error = trainer.step().expect_err("weights of 1e30");
        assert!(matches!(error, TrainError::NotFinite { step: 2 }));
        assert!(error.to_string().contains("lower learning_rate"));
        assert_eq!(trainer.learned.weights, weights);
        assert_eq!(trainer.learned.adam, adam);
        assert_eq!(trainer.steps_done(), 1);
    }
}

#[test]
fn a_clipped_gradient_has_the_length_of_the_limit() {
    let data = two_cloths();
    let run = |limit: Option<f64>| {
        let mut cfg = config(Encoder::MLP);
        cfg.gradient_clip = limit;
        let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
        let report = trainer.step().expect("a step");
        let gradient = trainer.gradient().expect("a gradient");
        let squares = gradient.iter().map(|&g| f64::from(g) * f64::from(g));
        (report.gradient_norm, squares.sum::<f64>().sqrt())
    };
    let (norm, length) = run(None);
    assert_eq!(norm, length);
    let (reported, length) = run(Some(0.25 * norm));
    assert_eq!(reported, norm, "the norm before clipping");
    // Each entry is rounded to f32.
    assert!((length - 0.25 * norm).abs() < 1e-6 * norm);
}

#[test]
fn statistics_come_from_the_samples_and_are_those_of_the_model() {
    let data = two_cloths();
    let cfg = config(Encoder::Gru { window: 3 });
    let trainer = Trainer::new(cfg.clone(), &data.dataset, &ENGINE).expect("a training");
    let [nodes, edges] = &trainer.state.inputs;
    // 12 samples of 3 frames of 9 or of 12 vertices.
    let samples = (nodes.count() / 3.0 - 12.0 * 9.0) / 3.0;
    assert!(samples.fract() == 0.0 && (0.0..=12.0).contains(&samples));
    let model = trainer.model(String::new()).expect("a model");
    assert_eq!(model.normalizers().nodes, nodes.freeze());
    assert_eq!(model.normalizers().edges, edges.freeze());
    let targets = trainer.state.targets.freeze();
    assert_eq!(model.normalizers().acceleration, targets.acceleration);
    let again = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
    assert_eq!(again.state.inputs, trainer.state.inputs);
}

#[test]
fn whoever_waits_for_the_statistics_hears_of_each_sample_and_may_stop() {
    let data = two_cloths();
    let cfg = || config(Encoder::MLP);
    let observe = |last: usize| {
        let mut count = 0;
        let mut listen = || {
            count += 1;
            if count == last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let made = Trainer::begin(cfg(), &data.dataset, &ENGINE, None, &mut listen);
        (made.expect("good"), count)
    };
    let (observed, count) = observe(100);
    let observed = observed.expect("nobody stopped it");
    assert_eq!(count, 12);
    let plain = Trainer::new(cfg(), &data.dataset, &ENGINE).expect("a training");
    assert_eq!(observed.state.inputs, plain.state.inputs);
    assert_eq!(observed.learned.weights, plain.learned.weights);
    let (stopped, count) = observe(5);
    assert!(stopped.is_none() && count == 5);
}

#[test]
fn statistics_have_streams_of_their_own_within_all_bounds() {
    // The most samples per step and the most of statistics: no number wraps round.
    let data = two_cloths();
    let mut cfg = config(Encoder::MLP);
    cfg.statistics_samples = 1_000_000;
    cfg.batch.samples = 65_536;
    cfg.validate().expect("within its bounds");
    let mut stop = || ControlFlow::Break(());
    let stopped = Trainer::begin(cfg, &data.dataset, &ENGINE, None, &mut stop);
    assert!(stopped.expect("room").is_none());
}

#[test]
fn a_lane_in_a_run_goes_where_the_rollout_goes() {
    let data = swinging(&[("a", 9, 14)], SectionRule::Whole);
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let mut cfg = config(encoder);
        cfg.batch.samples = 1;
        cfg.scheduled_sampling.truth = truth(0.0);
        let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
        let mut compared = 0;
        for _ in 0..30 {
            let model = Arc::new(trainer.model(String::new()).expect("a model"));
            let before = trainer.state.slots[0].clone();
            trainer.step().expect("a step");
            let after = &trainer.state.slots[0];
            if before.run == 0 || after.run == 0 {
                continue;
            }
            let motion = trainer.set.motion(0);
            let start: Vec<&[Vec3]> = before.history.iter().map(|frame| &frame[..]).collect();
            let graph = (*motion.graph).clone();
            let mut stepper = LearnedStepper::new(model, graph, &start).expect("a start");
            let truth = motion.frame(before.current as i64 + 1);
            let handles = motion.graph.handles().select(truth);
            let handles = handles.iter().map(|p| p.as_dvec3()).collect();
            let targets = HandleTargets::at_frame_end(handles).expect("finite");
            stepper.step(&targets).expect("a step");
            assert_eq!(
                after.history.last().expect("a frame")[..],
                *stepper.positions()
            );
            compared += 1;
        }
        assert!(compared > 10, "{compared}");
    }
}
