//! Who does the arithmetic of a training step: takes what the slots show through the network and back,
//! and the weights after the gradient.
//!
//! The slots and all that is drawn by chance stay with the trainer, so that a step is the same whoever
//! computes it, but for rounding. `shards` is the one on this machine's processor.

pub(crate) mod cpu;
pub(crate) mod micro_batch;
pub(crate) mod unroll;

use std::error::Error;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use selvedge_model::{ClothGraph, Connectivity, Network, Normalizers};
use thiserror::Error;

use crate::config::TrainConfig;
use crate::losses::{LossStatistics, LossTerms};
use crate::optimizer::Adam;
use crate::rollout_target::RolloutTarget;
use crate::slot::{ShownSample, Slot, rng_of};
use crate::training_set::TrainingSet;

/// What a training has learned so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// The weights, as [`Network::parameters`] lays them out.
    pub weights: Vec<f32>,
    /// Their running mean, where the configuration wants one.
    pub averaged: Option<Vec<f32>>,
    /// The optimiser.
    pub adam: Adam,
}

impl Learned {
    /// The part of the way to the weights that their running mean goes after so many steps of the
    /// optimiser; `part` is `weight_average`.
    #[must_use]
    pub fn averaging(steps: u64, part: f64) -> f32 {
        let steps = steps as f64;
        1.0 - part.min((1.0 + steps) / (10.0 + steps)) as f32
    }
}

/// Something that learns.
pub trait Engine: Send {
    /// Takes every slot of the batch through its frames and keeps the gradient of the mean of the slots'
    /// losses; gives the terms of each slot.
    ///
    /// # Errors
    /// When the machine that computes fails.
    fn learn(&mut self, batch: Batch<'_>) -> Result<Vec<LossTerms>, EngineError>;

    /// Takes the weights a step of the optimiser against that gradient; gives its norm before clipping.
    /// Where that is not finite nothing changes.
    ///
    /// # Errors
    /// As [`Self::learn`].
    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError>;

    /// The gradient that the latest step took, after clipping.
    ///
    /// # Errors
    /// As [`Self::learn`].
    fn gradient(&mut self) -> Result<Vec<f32>, EngineError>;

    /// Brings `learned` up to what the engine has.
    ///
    /// # Errors
    /// As [`Self::learn`].
    fn collect(&mut self, learned: &mut Learned) -> Result<(), EngineError>;
}

/// An engine that cannot go on.
#[derive(Debug, Error)]
#[error(transparent)]
pub struct EngineError(pub Box<dyn Error + Send + Sync>);

/// The engine of a training whose device is still to be put in: it refuses to learn.
pub(crate) struct Nobody;

impl Nobody {
    fn refusal<T>() -> Result<T, EngineError> {
        Err(EngineError(
            "the device that is to do the arithmetic was not put in".into(),
        ))
    }
}

impl Engine for Nobody {
    fn learn(&mut self, _: Batch<'_>) -> Result<Vec<LossTerms>, EngineError> {
        Self::refusal()
    }

    fn update(&mut self, _: &mut Learned, _: Update) -> Result<f64, EngineError> {
        Self::refusal()
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        Self::refusal()
    }

    fn collect(&mut self, _: &mut Learned) -> Result<(), EngineError> {
        Ok(())
    }
}

/// How weights follow a gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// The learning rate.
    pub learning_rate: f64,
    /// The largest norm of the gradient.
    pub clip: f64,
    /// `weight_average` of the configuration.
    pub average: Option<f64>,
}

/// What an engine is made for.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// The configuration.
    pub cfg: &'a TrainConfig,
    /// The network.
    pub network: &'a Network,
    /// Statistics of what the network sees and says.
    pub normalizers: &'a Normalizers,
    /// Statistics of what the losses compare.
    pub statistics: &'a LossStatistics,
    /// Where it starts.
    pub learned: &'a Learned,
    pub(crate) set: &'a TrainingSet,
}

impl Setup<'_> {
    /// The cloths of all trajectories; those of one cloth share it.
    pub fn graphs(&self) -> impl Iterator<Item = &Arc<ClothGraph>> {
        self.set.motions().map(|motion| &motion.graph)
    }
}

/// The slots of a step.
pub struct Batch<'a> {
    pub(crate) setup: Setup<'a>,
    pub(crate) slots: &'a mut [Slot],
    pub(crate) step: u64,
    pub(crate) frames: usize,
}

impl<'a> Batch<'a> {
    /// Frames that every slot goes through, unless it ends before.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// The slots, each on its way.
    #[must_use]
    pub fn runs(self) -> Vec<SlotRun<'a>> {
        let (setup, step, frames) = (self.setup, self.step, self.frames);
        let (seed, count) = (setup.cfg.seed, setup.cfg.batch.samples);
        let slots = self.slots.iter_mut().enumerate();
        slots
            .map(|(number, slot)| SlotRun {
                setup,
                step,
                frames,
                slot,
                rng: rng_of(seed, step, number, count),
                shown: ShownSample::default(),
                aim: None,
                done: 0,
            })
            .collect()
    }
}

/// A slot on its way through the frames of a step: show, take through the network, go on.
pub struct SlotRun<'a> {
    setup: Setup<'a>,
    step: u64,
    frames: usize,
    slot: &'a mut Slot,
    rng: ChaCha8Rng,
    shown: ShownSample,
    aim: Option<RolloutTarget>,
    done: usize,
}

impl SlotRun<'_> {
    /// Makes the next frame ready.
    pub fn show(&mut self) -> &ShownSample {
        let (cfg, set) = (self.setup.cfg, self.setup.set);
        self.slot.show(cfg, set, &mut self.rng, &mut self.shown);
        if self.frames > 1 {
            let (slot, shown) = (&*self.slot, &mut self.shown);
            let aim = self.aim.get_or_insert_with(|| {
                let (correction, given) = (slot.correction(cfg), (set, shown.yaw));
                RolloutTarget::new(cfg.scheduled_sampling.offset, correction, slot, given)
            });
            slot.aim(set, aim.next(), shown);
        }
        &self.shown
    }

    /// What was shown last.
    #[must_use]
    pub fn shown(&self) -> &ShownSample {
        &self.shown
    }

    /// The cloth of what is shown, and its arcs.
    #[must_use]
    pub fn cloth(&self) -> (&Arc<ClothGraph>, &Arc<Connectivity>) {
        let motion = self.setup.set.motion(self.shown.trajectory);
        (&motion.graph, &motion.connectivity)
    }

    /// Goes on after the network gave `output` (normalised, `[vertices, 3]`) for what was shown; whether
    /// there is another frame in this step.
    pub fn go_on(&mut self, output: &[f32]) -> bool {
        let (cfg, set) = (self.setup.cfg, self.setup.set);
        let mut acceleration = output.to_vec();
        self.setup
            .normalizers
            .acceleration
            .denormalize(&mut acceleration);
        let yaw = self.shown.yaw;
        let chance = (self.step, &mut self.rng);
        if self.frames == 1 {
            self.slot.advance(cfg, set, chance, yaw, &acceleration);
            return false;
        }
        self.done += 1;
        let goes_on = self.slot.follow(cfg, set, yaw, &acceleration);
        if goes_on && self.done < self.frames {
            return true;
        }
        self.slot.break_off(cfg, chance);
        false
    }

    /// The mean of the terms of the slot's frames, and what the gradient of each frame counts in that of
    /// the mean over the batch.
    #[must_use]
    pub fn weigh(&self, terms: &[LossTerms]) -> (LossTerms, Vec<f64>) {
        let (mean, mut weights) = unroll::weigh(self.setup.cfg, terms);
        let share = 1.0 / self.setup.cfg.batch.samples as f64;
        weights.iter_mut().for_each(|weight| *weight *= share);
        (mean, weights)
    }
}
