//! The frames of a training step: one loop for every engine ([`run_slots`]).
//!
//! Each slot shows a sample, the engine takes it through the network and judges the prediction, and
//! the slot moves on with its prediction to the next frame. Then the losses of its frames are
//! weighed and the engine goes back through all of them.
//!
//! Frame k of a rollout, from 1, is judged by its [`RolloutTarget`]. A constant error of the acceleration moves the k-th
//! positions by k²/2 of it, so the loss of frame k counts 1/k² in a weighted mean
//! `[eq:unrolled-loss]`.

use std::sync::Arc;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use selvedge_model::ClothGraph;

use super::Setup;
use crate::losses::LossTerms;
use crate::rollout_target::RolloutTarget;
use crate::slot::{ShownSample, Slot, rng_of};

/// States in a row that the expert cannot go on from before one is shown with its recorded target.
const MOST_REFUSALS: usize = 10;

/// The passes of an engine through the network, frame by frame.
pub trait FramePasses {
    /// A failure of the machine that computes.
    type Error;

    /// Takes what the slots show in frame `frame`, from 0, through the network, and hands
    /// prediction and loss terms to each slot ([`SlotRun::receive`]). Slots that are not going may
    /// be left out.
    fn forward(&mut self, frame: usize, slots: &mut [SlotRun<'_>]) -> Result<(), Self::Error>;

    /// Computes the gradient of the sum of all frames' losses, each times its weight. `weights` has
    /// a row per slot with a weight for each of its frames.
    fn backward(&mut self, weights: &[Vec<f64>]) -> Result<(), Self::Error>;
}

/// Takes `slots` through the frames of a step and back. Returns the mean terms of each slot's
/// frames; none from when the step is given up.
pub fn run_slots<P: FramePasses>(
    passes: &mut P,
    slots: &mut [SlotRun<'_>],
) -> Result<Vec<LossTerms>, P::Error> {
    let frames = slots.first().map_or(0, |slot| slot.frames);
    let is_given_up = |slots: &[SlotRun<'_>]| slots.iter().any(|slot| slot.setup.stop.is_wanted());
    for frame in 0..frames {
        if is_given_up(slots) {
            return Ok(Vec::new());
        }
        each_going(slots, SlotRun::show);
        passes.forward(frame, slots)?;
        if frame + 1 == frames {
            break;
        }
        each_going(slots, SlotRun::go_on);
        if !slots.iter().any(SlotRun::is_going) {
            break;
        }
    }
    let (means, weights): (Vec<LossTerms>, Vec<Vec<f64>>) =
        slots.iter().map(SlotRun::weigh).unzip();
    if is_given_up(slots) {
        return Ok(Vec::new());
    }
    passes.backward(&weights)?;
    // The last move is made, and the expert is asked, while a device goes back.
    each_going(slots, SlotRun::go_on);
    slots.par_iter_mut().for_each(SlotRun::ask_ahead);
    Ok(means)
}

fn each_going<'a>(slots: &mut [SlotRun<'a>], act: fn(&mut SlotRun<'a>)) {
    slots
        .par_iter_mut()
        .filter(|slot| slot.is_going)
        .for_each(act);
}

/// A slot on its way through the frames of a step.
pub struct SlotRun<'a> {
    setup: Setup<'a>,
    step: u64,
    frames: usize,
    slot: &'a mut Slot,
    rng: ChaCha8Rng,
    /// The random numbers of the next step.
    next_rng: ChaCha8Rng,
    sample: ShownSample,
    target: Option<RolloutTarget>,
    /// The latest prediction, normalised, `[vertices, 3]`.
    output: Vec<f32>,
    /// Terms of each frame so far.
    terms: Vec<LossTerms>,
    is_going: bool,
}

impl<'a> SlotRun<'a> {
    /// Slot `number` of a batch in step `step`, from 0, before the first of up to `frames` frames.
    pub(crate) fn new(
        setup: Setup<'a>,
        (step, frames): (u64, usize),
        number: usize,
        slot: &'a mut Slot,
    ) -> Self {
        let (seed, count) = (setup.cfg.seed, setup.cfg.batch.samples);
        let rng = |step| rng_of(seed, step, number, count);
        Self {
            setup,
            step,
            frames,
            slot,
            rng: rng(step),
            next_rng: rng(step + 1),
            sample: ShownSample::default(),
            target: None,
            output: Vec::new(),
            terms: Vec::with_capacity(frames),
            is_going: true,
        }
    }

    /// Frames that it goes through, unless it ends before.
    pub(super) fn frames(&self) -> usize {
        self.frames
    }

    /// The sample that is shown now, or was shown last.
    pub fn sample(&self) -> &ShownSample {
        &self.sample
    }

    /// The cloth of the sample.
    pub fn graph(&self) -> &'a Arc<ClothGraph> {
        &self.setup.set.motion(self.sample.trajectory).graph
    }

    /// True while the slot shows samples in this step.
    pub fn is_going(&self) -> bool {
        self.is_going
    }

    /// Takes the prediction for the sample (normalised, `[vertices, 3]`) and the terms of its loss.
    /// A slot that is not going ignores them.
    pub fn receive(&mut self, output: &[f32], terms: LossTerms) {
        if self.is_going {
            self.output.clear();
            self.output.extend_from_slice(output);
            self.terms.push(terms);
        }
    }

    /// Prepares the sample of the next frame.
    fn show(&mut self) {
        self.show_sample();
        if self.terms.is_empty() {
            self.target = self.first_target();
        }
        if let Some(target) = &mut self.target {
            target.show_next(self.setup.set, self.slot, &mut self.sample);
        }
    }

    fn show_sample(&mut self) {
        let (cfg, set) = (self.setup.cfg, self.setup.set);
        self.slot.show(cfg, set, &mut self.rng, &mut self.sample);
    }

    /// The targets from the sample on that is shown; none where the slot shows its own, that of a
    /// single prediction. A state that the expert cannot go on from gives way to a sample of ground
    /// truth.
    fn first_target(&mut self) -> Option<RolloutTarget> {
        let (cfg, set) = (self.setup.cfg, self.setup.set);
        if self.setup.expert.is_some() {
            for _ in 0..MOST_REFUSALS {
                if !self.slot.is_off(cfg) {
                    break;
                }
                let wanted = self.frames_to_label();
                let ahead = self.slot.labels.take();
                let ahead = ahead.filter(|labels| labels.len() == wanted);
                if let Some(labels) = ahead.or_else(|| self.ask()) {
                    return Some(RolloutTarget::labels(labels));
                }
                self.slot.start_afresh();
                self.show_sample();
            }
        }
        let yaw = self.sample.yaw;
        (self.frames > 1).then(|| RolloutTarget::recorded(cfg, set, self.slot, yaw))
    }

    /// Asks the expert about the sample that the next step shows, so that it need not wait for the
    /// answer. That step draws the same sample again, from the same random numbers.
    fn ask_ahead(&mut self) {
        std::mem::swap(&mut self.rng, &mut self.next_rng);
        if self.setup.expert.is_some() {
            self.show_sample();
            if self.slot.is_off(self.setup.cfg) {
                self.slot.labels = self.ask();
            }
            if self.slot.run == 0 {
                self.slot.history.clear();
            }
        }
    }

    /// What the expert makes of the sample that is shown.
    fn ask(&self) -> Option<Vec<Vec<DVec3>>> {
        let state = self.slot.expert_state(self.setup.set);
        self.setup.expert?.label(state, self.frames_to_label())
    }

    fn frames_to_label(&self) -> usize {
        self.frames
            .min(self.slot.section.end - 1 - self.slot.current)
    }

    /// Moves the slot on after a prediction.
    fn go_on(&mut self) {
        let (cfg, set, step) = (self.setup.cfg, self.setup.set, self.step);
        let normalizer = &self.setup.normalizers.acceleration;
        normalizer.denormalize(&mut self.output);
        let (sample, acceleration) = (&self.sample, &self.output[..]);
        let label = self.target.as_ref().and_then(RolloutTarget::label);
        if self.frames == 1 {
            if self.slot.returns_to_truth(cfg, step, &mut self.rng) {
                self.slot.start_afresh();
            } else {
                self.slot.follow(cfg, set, sample, acceleration, label);
            }
            self.is_going = false;
            return;
        }
        let went_on = self.slot.follow(cfg, set, sample, acceleration, label);
        self.is_going = went_on && self.terms.len() < self.frames;
        if !self.is_going && self.slot.returns_to_truth(cfg, step, &mut self.rng) {
            self.slot.start_afresh();
        }
    }

    /// The mean of the terms of the frames, and the weight of each frame in the mean over the
    /// batch; a mean above the cap of the configuration counts as the cap.
    fn weigh(&self) -> (LossTerms, Vec<f64>) {
        let cfg = self.setup.cfg;
        let frames = self.terms.iter().enumerate();
        let terms: Vec<(f64, LossTerms)> = frames
            .map(|(frame, terms)| ((frame as f64 + 1.0).powi(-2), *terms))
            .collect();
        let mean = LossTerms::weighted_mean(&terms);
        let cap = cfg.loss_cap.filter(|&cap| mean.total > cap);
        let weight = cap.map_or(1.0, |cap| cap / mean.total);
        let sum: f64 = terms.iter().map(|(weight, _)| weight).sum();
        let share = 1.0 / cfg.batch.samples as f64;
        let weights = terms.iter().map(|(w, _)| w * weight / sum * share);
        (mean, weights.collect())
    }
}
