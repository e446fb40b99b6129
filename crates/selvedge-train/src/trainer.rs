//! The training step, read from top to bottom: every slot shows a sample and is taken forward and
//! backward by the engine, the slots advance, the optimiser steps.

use std::ops::ControlFlow;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_data::Dataset;
use selvedge_model::{
    Domain, Model, ModelError, Network, Normalizers, RunningStatistics, SpecError,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::config::{InvalidConfig, TrainConfig};
use crate::engine::{Batch, Engine, EngineError, EngineMaker, Learned, Setup, Update};
use crate::fit_normalizers::{FitProgress, NormalizerFit, Statistics};
use crate::losses::{LossStatistics, LossTerms, RunningLossStatistics};
use crate::memory::{Arithmetic, MemoryError, Need};
use crate::optimizer::{Adam, AdamError};
use crate::origin::Origin;
use crate::slot::Slot;
use crate::training_set::{TrainingSet, TrainingSetError};

/// A training between two steps.
pub struct Trainer {
    pub(crate) cfg: TrainConfig,
    set: TrainingSet,
    network: Network,
    pub(crate) learned: Learned,
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    statistics: LossStatistics,
    normalizers: Normalizers,
    pub(crate) slots: Vec<Slot>,
    pub(crate) step: u64,
    pub(crate) origins: Vec<Origin>,
    /// Steps since the last line of the log, which a checkpoint keeps.
    pub(crate) since_line: Vec<StepReport>,
    engine: Box<dyn Engine>,
}

/// Report of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Mean over the batch of each loss term.
    pub terms: LossTerms,
    /// Norm of the gradient before clipping.
    pub gradient_norm: f64,
    /// The learning rate of the step.
    pub learning_rate: f64,
    /// The probability of ground truth in the step.
    pub truth_probability: f64,
    /// Frames of a rollout that the step learned through.
    pub frames: usize,
}

/// A training that cannot start or go on.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TrainError {
    #[error(transparent)]
    Config(#[from] InvalidConfig),
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    Optimizer(#[from] AdamError),
    #[error(transparent)]
    TrainingSet(#[from] TrainingSetError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error("step {step}: the loss is not finite: lower learning_rate or set gradient_clip")]
    NotFinite { step: u64 },
}

impl Trainer {
    /// A training at its first step on the engine that `engine` makes: fresh weights, statistics
    /// from `statistics_samples` samples.
    ///
    /// # Errors
    /// [`TrainError`] when the configuration or the data set cannot be used, there is not enough
    /// memory for both, or the engine cannot be made.
    pub fn new(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
    ) -> Result<Self, TrainError> {
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        let mut fit = NormalizerFit::new(&cfg, &set);
        while fit.advance().is_some() {}
        let statistics = fit.finish();
        Self::begin(cfg, set, engine, network, statistics)
    }

    /// The same with an observer: `observe` hears of every sample of the statistics and may stop
    /// the fit, which gives no training.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn new_observed(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
        observe: &mut dyn FnMut(FitProgress) -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        let mut fit = NormalizerFit::new(&cfg, &set);
        while let Some(progress) = fit.advance() {
            if observe(progress).is_break() {
                return Ok(None);
            }
        }
        let statistics = fit.finish();
        Self::begin(cfg, set, engine, network, statistics).map(Some)
    }

    fn begin(
        cfg: TrainConfig,
        set: TrainingSet,
        engine: &dyn EngineMaker,
        network: Network,
        statistics: Statistics,
    ) -> Result<Self, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let parts = Parts {
            learned: Learned {
                adam: Adam::new(cfg.optimizer, weights.len())?,
                averaged: cfg.weight_average.map(|_| weights.clone()),
                weights,
            },
            slots: vec![Slot::new(); cfg.batch.samples],
            network,
            statistics,
            step: 0,
            origins: Vec::new(),
            since_line: Vec::new(),
        };
        Self::assemble(cfg, set, engine, parts)
    }

    pub(crate) fn assemble(
        cfg: TrainConfig,
        set: TrainingSet,
        engine: &dyn EngineMaker,
        parts: Parts,
    ) -> Result<Self, TrainError> {
        let Statistics { inputs, targets } = parts.statistics;
        let statistics = targets.freeze();
        let [nodes, edges] = &inputs;
        let normalizers = Normalizers {
            nodes: nodes.freeze(),
            edges: edges.freeze(),
            acceleration: statistics.acceleration.clone(),
        };
        let setup = Setup {
            cfg: &cfg,
            network: &parts.network,
            normalizers: &normalizers,
            statistics: &statistics,
            learned: &parts.learned,
            set: &set,
        };
        let engine = engine.make(setup)?;
        Ok(Self {
            network: parts.network,
            learned: parts.learned,
            inputs,
            targets,
            slots: parts.slots,
            step: parts.step,
            origins: parts.origins,
            since_line: parts.since_line,
            set,
            statistics,
            normalizers,
            engine,
            cfg,
        })
    }

    /// Copies weights and optimiser from the engine, for [`Self::save`] and [`Self::model`]. The
    /// engine of this machine's processor always has them here.
    ///
    /// # Errors
    /// When the engine fails.
    pub fn collect(&mut self) -> Result<(), TrainError> {
        Ok(self.engine.collect(&mut self.learned)?)
    }

    /// Learns from one batch.
    ///
    /// # Errors
    /// [`TrainError::NotFinite`], or a failure of the engine. The weights are then those before the
    /// step, but the slots have moved on: resume from a checkpoint.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let step = self.step;
        let frames = self.cfg.unroll.at(step);
        let setup = Setup {
            cfg: &self.cfg,
            network: &self.network,
            normalizers: &self.normalizers,
            statistics: &self.statistics,
            learned: &self.learned,
            set: &self.set,
        };
        let batch = Batch::new(setup, &mut self.slots, step, frames);
        let terms = LossTerms::mean(&self.engine.learn(batch)?);
        let not_finite = TrainError::NotFinite { step: step + 1 };
        if !terms.total.is_finite() {
            return Err(not_finite);
        }
        let update = Update {
            learning_rate: self.cfg.learning_rate.at(step),
            clip: self.cfg.gradient_clip.unwrap_or(f64::INFINITY),
            average: self.cfg.weight_average,
        };
        let gradient_norm = self.engine.update(&mut self.learned, update)?;
        if !gradient_norm.is_finite() {
            return Err(not_finite);
        }
        self.step += 1;
        Ok(StepReport {
            step: self.step,
            terms,
            gradient_norm,
            learning_rate: update.learning_rate,
            truth_probability: self.cfg.scheduled_sampling.truth.at(step),
            frames,
        })
    }

    /// Weights and optimiser as they were last collected.
    #[must_use]
    pub fn learned(&self) -> &Learned {
        &self.learned
    }

    /// Steps done so far.
    #[must_use]
    pub fn steps_done(&self) -> u64 {
        self.step
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.cfg
    }

    /// Number of weights.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.learned.weights.len()
    }

    /// Number of samples in the sections of the data set.
    #[must_use]
    pub fn sample_count(&self) -> usize {
        self.set.sample_count()
    }

    /// The motions whose mirror images are not learned from, although `mirror_images` is set: their
    /// handles would go as in a motion to test on.
    #[must_use]
    pub fn images_left_out(&self) -> &[String] {
        self.set.images_left_out()
    }

    /// The trainings whose weights this one began with, the first one first; none where it began
    /// with its own.
    #[must_use]
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// The domain of what is learned from.
    #[must_use]
    pub fn domain(&self) -> Option<&Domain> {
        self.set.domain()
    }

    /// The mean gradient of the last step, after clipping, laid out like the weights.
    ///
    /// # Errors
    /// When the engine fails.
    pub fn gradient(&mut self) -> Result<Vec<f32>, TrainError> {
        Ok(self.engine.gradient()?)
    }

    /// The model as it was last collected, with `training` as its account of how it was trained.
    ///
    /// # Errors
    /// [`TrainError::Model`] when a weight is not finite.
    pub fn model(&self, training: String) -> Result<Model, TrainError> {
        let Learned {
            weights, averaged, ..
        } = &self.learned;
        let weights = averaged.as_ref().unwrap_or(weights).clone();
        let normalizers = self.normalizers.clone();
        Ok(Model::new(&self.cfg.model, weights, normalizers, training)?)
    }
}

/// Reads the data and builds the network, after checking the configuration and the memory of this
/// machine.
pub(crate) fn prepare(
    cfg: &TrainConfig,
    dataset: &Dataset,
    on: Arithmetic,
) -> Result<(TrainingSet, Network), TrainError> {
    cfg.validate()?;
    let network = Network::new(&cfg.model)?;
    let need = Need::before_reading(cfg, &network, dataset, on);
    need.check(cfg)?;
    let set = TrainingSet::load(dataset, cfg.model.coarse_levels, cfg.mirror_images)?;
    need.with_slots(cfg, &set, on).check(cfg)?;
    Ok((set, network))
}

/// The parts of a training besides configuration and data.
pub(crate) struct Parts {
    pub(crate) network: Network,
    pub(crate) learned: Learned,
    pub(crate) statistics: Statistics,
    pub(crate) slots: Vec<Slot>,
    pub(crate) step: u64,
    pub(crate) origins: Vec<Origin>,
    pub(crate) since_line: Vec<StepReport>,
}

#[cfg(test)]
mod tests;
