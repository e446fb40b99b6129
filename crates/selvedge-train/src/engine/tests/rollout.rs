//! The gradient through several frames against finite differences of their loss, features,
//! integration and all; and against the plain step where there is one frame.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_data::SectionRule;
use selvedge_model::{EdgeFeature, Encoder};

use crate::config::{Labels, TrainConfig};
use crate::schedule::UnrollFrames;
use crate::slot::{Expert, ExpertState};
use crate::test_data::{
    ENGINE, Swinging, busy, config, stepped, swinging, through, truth, two_cloths, with_threads,
};
use crate::trainer::{TrainError, Trainer};

fn unrolled(encoder: Encoder, frames: usize) -> TrainConfig {
    let mut cfg = through(frames, config(encoder));
    cfg.batch.samples = 2;
    cfg
}

/// Loss and mean gradient of the first step with `weights`, or with the first ones.
fn first_step(cfg: &TrainConfig, data: &Swinging, weights: Option<&[f32]>) -> (f64, Vec<f32>) {
    let mut trainer = Trainer::new(cfg.clone(), &data.dataset, &ENGINE).expect("a training");
    if let Some(weights) = weights {
        trainer.learned.weights.copy_from_slice(weights);
    }
    let report = trainer.step().expect("a step");
    (report.terms.total, trainer.gradient().expect("a gradient"))
}

/// The largest difference between the gradient and central differences of the loss along random
/// directions, in parts of the gradient's length.
fn worst_slope(cfg: &TrainConfig, data: &Swinging) -> f64 {
    let weights = stepped(cfg.clone(), &data.dataset, 0).learned.weights;
    let (_, gradient) = first_step(cfg, data, None);
    let length = |x: &[f32]| x.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    let steepest = length(&gradient);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let slopes = (0..4).map(|_| {
        // Half of it along the gradient, so that there is a slope to see.
        let random: Vec<f32> = weights
            .iter()
            .map(|_| 2.0 * rng.random::<f32>() - 1.0)
            .collect();
        let share = length(&random);
        let direction: Vec<f32> = gradient
            .iter()
            .zip(&random)
            .map(|(g, r)| (f64::from(*g) / steepest + f64::from(*r) / share) as f32)
            .collect();
        let step = 2e-3_f32;
        let at = |sign: f32| {
            let moved = weights.iter().zip(&direction);
            let moved: Vec<f32> = moved.map(|(w, d)| w + sign * step * d).collect();
            first_step(cfg, data, Some(&moved)).0
        };
        let expected = (at(1.0) - at(-1.0)) / (2.0 * f64::from(step));
        let pairs = gradient.iter().zip(&direction);
        let found: f64 = pairs.map(|(g, d)| f64::from(*g) * f64::from(*d)).sum();
        (found - expected).abs() / steepest
    });
    slopes.fold(0.0, f64::max)
}

#[test]
fn the_gradient_goes_through_every_frame() {
    let data = swinging(&[("a", 12, 20)], SectionRule::Whole);
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let mut cfg = unrolled(encoder, 4);
        cfg.model.edge_features.insert(EdgeFeature::MaterialVector);
        let worst = worst_slope(&cfg, &data);
        // f32 throughout: a loss good to 1e-6 over steps of 2e-3 gives 1e-3, and a kink of a
        // ReLU within a step as much. One frame's gradient alone is off by 0.2 and more.
        assert!(worst < 0.03, "{encoder:?}: {worst}");
        // The plain step of the paper, with all that plays a part in one.
        let worst = worst_slope(&busy(encoder), &data);
        assert!(worst < 0.03, "{encoder:?}, one frame: {worst}");
    }
}

#[test]
fn runs_go_on_over_steps_and_threads_do_not_show() {
    let data = two_cloths();
    let losses = |threads: usize| {
        let mut cfg = busy(Encoder::MLP);
        cfg.unroll = UnrollFrames::Growing {
            start: 0,
            end: 4,
            frames: 3,
        };
        cfg.losses.kinetic_energy = 0.0;
        with_threads(threads, || {
            let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
            let reports = (0..14).map(|_| trainer.step().expect("a step"));
            let frames_and_loss: Vec<(usize, u64)> = reports
                .map(|report| (report.frames, report.terms.total.to_bits()))
                .collect();
            let longest = trainer.state.slots.iter().map(|slot| slot.run).max();
            (frames_and_loss, longest, trainer.learned.weights.clone())
        })
    };
    let (one, two) = (losses(1), losses(2));
    assert_eq!(one, two);
    let frames: Vec<usize> = one.0.iter().map(|step| step.0).collect();
    assert_eq!(frames, [1, 1, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3]);
    assert!(one.1 > Some(3), "a run longer than one step: {:?}", one.1);
}

/// An expert by whom a cloth is next where it was recorded in frame 3 of four, the next one, or
/// another of them; or who refuses.
struct ByRecord {
    refuses: bool,
    frame: usize,
    asked: Arc<AtomicUsize>,
}

impl Expert for ByRecord {
    fn label(&self, state: ExpertState<'_>, frames: usize) -> Option<Vec<Vec<DVec3>>> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let next: Vec<DVec3> = state.recorded[self.frame]
            .iter()
            .map(|p| p.as_dvec3())
            .collect();
        (!self.refuses).then(|| vec![next; frames])
    }
}

/// Questions that the expert heard in twelve steps that begin off the recorded motion, and the
/// longest run of own states.
fn with_expert(expert: Option<ByRecord>) -> Result<(usize, u32), TrainError> {
    let data = two_cloths();
    let mut cfg = unrolled(Encoder::MLP, 3);
    cfg.noise.deviation = 0.0;
    cfg.scheduled_sampling.labels = Labels::Expert;
    cfg.scheduled_sampling.truth = truth(0.0);
    let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
    let asked = expert.as_ref().map(|expert| Arc::clone(&expert.asked));
    if let Some(expert) = expert {
        trainer.ask(Box::new(expert));
    }
    let mut longest = 0;
    for _ in 0..12 {
        trainer.step()?;
        let runs = trainer.state.slots.iter().map(|slot| slot.run);
        longest = longest.max(runs.max().unwrap_or(0));
    }
    Ok((
        asked.map_or(0, |asked| asked.load(Ordering::Relaxed)),
        longest,
    ))
}

fn expert(refuses: bool) -> ByRecord {
    ByRecord {
        refuses,
        frame: 3,
        asked: Arc::default(),
    }
}

#[test]
fn own_states_are_labelled_by_the_expert() {
    let (asked, longest) = with_expert(Some(expert(false))).expect("twelve steps");
    assert!(asked > 8 && longest > 3, "{asked} {longest}");
    // What the expert cannot go on from gives way to the truth: no run is longer than a step.
    let (asked, longest) = with_expert(Some(expert(true))).expect("twelve steps");
    assert!(asked > 8 && longest == 3, "{asked} {longest}");
    let message = with_expert(None).expect_err("no expert").to_string();
    assert!(message.contains("scheduled_sampling.labels"), "{message}");
}

/// Noise that the target takes back at once asks for the recorded frame, as this expert does.
#[test]
fn a_label_is_the_target() {
    let data = swinging(&[("a", 12, 20)], SectionRule::Whole);
    let mut cfg = config(Encoder::MLP);
    cfg.noise.deviation = 1e-3;
    cfg.noise.correction = 1.0;
    let loss = |labels: Labels, frame: usize| {
        let mut cfg = cfg.clone();
        cfg.scheduled_sampling.labels = labels;
        let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
        trainer.ask(Box::new(ByRecord {
            frame,
            ..expert(false)
        }));
        trainer.step().expect("a step").terms.total
    };
    let recorded = loss(Labels::Recorded, 3);
    let [next, present] = [3, 2].map(|frame| loss(Labels::Expert, frame) / recorded);
    assert!((next - 1.0).abs() < 1e-6, "{next}");
    assert!((present - 1.0).abs() > 0.1, "{present}");
}

/// A resumed training asks again what the one before it had asked ahead.
#[test]
fn labels_asked_ahead_are_those_of_the_step() {
    let data = two_cloths();
    let mut cfg = unrolled(Encoder::MLP, 3);
    cfg.noise.deviation = 1e-3;
    cfg.scheduled_sampling.labels = Labels::Expert;
    cfg.scheduled_sampling.truth = truth(0.5);
    let losses = |forgets: bool| -> (Vec<u64>, usize) {
        let mut trainer = Trainer::new(cfg.clone(), &data.dataset, &ENGINE).expect("a training");
        let expert = expert(false);
        let asked = Arc::clone(&expert.asked);
        trainer.ask(Box::new(expert));
        let losses = (0..12).map(|_| {
            if forgets {
                trainer
                    .state
                    .slots
                    .iter_mut()
                    .for_each(|slot| slot.labels = None);
            }
            let loss = trainer.step().expect("a step").terms.total.to_bits();
            let fresh = trainer.state.slots.iter().filter(|slot| slot.run == 0);
            assert!(fresh.into_iter().all(|slot| slot.history.is_empty()));
            loss
        });
        (losses.collect(), asked.load(Ordering::Relaxed))
    };
    let ((kept, few), (forgotten, many)) = (losses(false), losses(true));
    assert_eq!(kept, forgotten);
    assert!(many > few + 8, "{few} {many}");
}
