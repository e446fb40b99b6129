//! The seam between a training and the machine that does its arithmetic: forward and backward over
//! the batch, then the optimiser's update.
//!
//! Slots and all that is drawn by chance stay with the trainer. A step is therefore the same on
//! every engine but for rounding. The engine of this machine's processor is in `cpu`; it uses what
//! any other one gets.

mod cpu;
mod micro_batch;
mod over_ranks;
mod slot_run;

use std::ops::Range;
use std::sync::Arc;

use selvedge_cloth::Stop;
use selvedge_cluster::Ranks;
use selvedge_model::{ClothGraph, Model, ModelSpec, Network, Normalizers, SpecError};

pub use self::cpu::OnProcessor;
pub use self::over_ranks::OverRanks;
pub use self::slot_run::{FramePasses, SlotRun, run_slots};
use crate::bounds::ConfigError;
use crate::config::TrainConfig;
use crate::losses::{LossStatistics, LossTerms};
use crate::optimizer::{Adam, clip_norm};
use crate::slot::Expert;
use crate::training_set::TrainingSet;

/// Weights and optimiser of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// The weights, as [`Network::parameters`] lays them out.
    pub weights: Vec<f32>,
    /// Their running mean, where the configuration asks for one.
    pub averaged: Option<Vec<f32>>,
    /// The optimiser.
    pub adam: Adam,
}

impl Learned {
    /// Before the first step.
    pub(crate) fn first(cfg: &TrainConfig, weights: Vec<f32>) -> Result<Self, ConfigError> {
        Ok(Self {
            adam: Adam::new(cfg.optimizer, weights.len())?,
            averaged: cfg.weight_average.map(|_| weights.clone()),
            weights,
        })
    }

    /// The part of the way to the weights that their running mean goes after `steps` steps of the
    /// optimiser; `part` is `weight_average` of the configuration.
    pub fn averaging(steps: u64, part: f64) -> f32 {
        let steps = steps as f64;
        1.0 - part.min((1.0 + steps) / (10.0 + steps)) as f32
    }

    /// Clips `gradient` and takes the weights a step against it. Returns its norm before clipping;
    /// where that is not finite nothing changes.
    pub(crate) fn update(&mut self, gradient: &mut [f32], update: Update) -> f64 {
        let norm = clip_norm(gradient, update.clip);
        if !norm.is_finite() {
            return norm;
        }
        self.adam
            .step(&mut self.weights, gradient, update.learning_rate);
        if let (Some(part), Some(averaged)) = (update.average, &mut self.averaged) {
            let share = Self::averaging(self.adam.steps(), part);
            for (mean, &weight) in averaged.iter_mut().zip(&self.weights) {
                *mean += share * (weight - *mean);
            }
        }
        norm
    }

    /// The model of the mean of the weights, or of the weights where there is none.
    pub(crate) fn model(
        &self,
        spec: &ModelSpec,
        normalizers: &Normalizers,
        training: String,
    ) -> Result<Model, SpecError> {
        let weights = self.averaged.as_ref().unwrap_or(&self.weights).clone();
        Model::new(spec, weights, normalizers.clone(), training)
    }
}

/// The arithmetic of a training.
pub trait Engine: Send {
    /// Takes every slot of a batch, each before its first frame, through its frames and keeps the
    /// gradient of the mean of the slots' losses. Returns the terms of each slot; none where the
    /// step was given up, by this engine or by one of several ranks, and then there is no gradient.
    fn learn(
        &mut self,
        setup: Setup<'_>,
        slots: &mut [SlotRun<'_>],
    ) -> Result<Vec<LossTerms>, EngineError>;

    /// Takes the weights a step of the optimiser against that gradient. Returns its norm before
    /// clipping; where that is not finite nothing changes.
    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError>;

    /// Adds a range of the gradient of the latest [`Self::learn`] to `sum`: piece after piece,
    /// where it has kept several.
    fn add_gradient(&mut self, range: Range<usize>, sum: &mut [f32]) -> Result<(), EngineError>;

    /// Takes `gradient` for the next [`Self::update`], in the place of its own.
    fn set_gradient(&mut self, gradient: &[f32]) -> Result<(), EngineError>;

    /// The gradient that the latest step took, after clipping.
    fn gradient(&mut self) -> Result<Vec<f32>, EngineError>;

    /// Copies weights and optimiser from the engine to `learned`.
    fn collect(&mut self, learned: &mut Learned) -> Result<(), EngineError>;
}

/// A failure of an engine.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct EngineError(pub Box<dyn std::error::Error + Send + Sync>);

/// Settings of an engine, from which a training makes it. They decide speed and memory; results
/// differ only by rounding.
pub trait EngineMaker {
    /// Slots that go through the network together on this machine's processor; none on a device
    /// with memory of its own.
    fn micro_batch(&self) -> Option<usize> {
        None
    }

    /// Makes the engine of a training.
    fn make(&self, setup: Setup<'_>) -> Result<Box<dyn Engine>, EngineError>;

    /// The ranks that share a training.
    fn ranks(&self) -> Ranks {
        Ranks::alone()
    }

    /// The slots of a batch of so many that this rank takes through the network.
    fn own_slots(&self, samples: usize) -> Range<usize> {
        0..samples
    }
}

/// One step of the optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// The learning rate.
    pub learning_rate: f64,
    /// The largest norm of the gradient.
    pub clip: f64,
    /// `weight_average` of the configuration.
    pub average: Option<f64>,
}

/// The parts of a training that its engine needs.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// The configuration.
    pub cfg: &'a TrainConfig,
    /// The network.
    pub network: &'a Network,
    /// Statistics of the network's inputs and outputs.
    pub normalizers: &'a Normalizers,
    /// Statistics of the quantities that the losses compare.
    pub statistics: &'a LossStatistics,
    /// Weights and optimiser as they are now.
    pub learned: &'a Learned,
    /// Wanted where the step is to be given up: an engine may then leave its work undone, and gives
    /// no terms.
    pub stop: &'a Stop,
    /// The physics that labels own states, where the configuration asks for it.
    pub(crate) expert: Option<&'a dyn Expert>,
    pub(crate) set: &'a TrainingSet,
}

impl<'a> Setup<'a> {
    /// The cloths of all trajectories; those of one cloth share it.
    pub fn graphs(&self) -> impl Iterator<Item = &'a Arc<ClothGraph>> {
        self.set.motions().map(|motion| &motion.graph)
    }
}

#[cfg(test)]
mod tests;
