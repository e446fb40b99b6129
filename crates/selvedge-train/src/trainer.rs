//! The training step, read from top to bottom: every slot shows a sample and is taken forward and
//! backward by the engine, the slots advance, the optimiser steps.
//!
//! The engine is that of this machine's processor unless another one is put in its place, or waited for.

use std::ops::ControlFlow;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_data::Dataset;
use selvedge_model::{Model, ModelError, Network, Normalizers, RunningStatistics, SpecError};
use thiserror::Error;

use crate::checkpoint::Origin;
use crate::config::{InvalidConfig, TrainConfig};
use crate::engine::cpu::CpuEngine;
use crate::engine::{Batch, Engine, EngineError, Learned, Nobody, Setup, Update};
use crate::fit_normalizers::{FitProgress, NormalizerFit, Statistics};
use crate::losses::{LossStatistics, LossTerms, RunningLossStatistics};
use crate::memory::{Arithmetic, MemoryError, Need};
use crate::optimizer::{Adam, AdamError};
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
    engine: Box<dyn Engine>,
}

/// What a step did.
#[derive(Clone, Debug, PartialEq)]
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

/// Why a training cannot start or go on.
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
    /// A training at its first step: fresh weights, statistics from `statistics_samples` samples.
    ///
    /// # Errors
    /// [`TrainError`] when the configuration or the data set cannot be used, or there is not enough
    /// memory for both.
    pub fn new(cfg: TrainConfig, dataset: &Dataset) -> Result<Self, TrainError> {
        let on = Arithmetic::OnProcessor;
        let (set, network) = prepare(&cfg, dataset, on)?;
        let mut gathering = NormalizerFit::new(&cfg, &set);
        while gathering.advance().is_some() {}
        let statistics = gathering.finish();
        Self::begin(cfg, (set, on), network, statistics)
    }

    /// The same wherever the arithmetic is done; `observe` hears of every sample of the statistics and may
    /// stop, which gives none.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn new_observed(
        cfg: TrainConfig,
        dataset: &Dataset,
        on: Arithmetic,
        observe: &mut dyn FnMut(FitProgress) -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        let (set, network) = prepare(&cfg, dataset, on)?;
        let mut gathering = NormalizerFit::new(&cfg, &set);
        while let Some(gathered) = gathering.advance() {
            if observe(gathered).is_break() {
                return Ok(None);
            }
        }
        let statistics = gathering.finish();
        Self::begin(cfg, (set, on), network, statistics).map(Some)
    }

    fn begin(
        cfg: TrainConfig,
        given: (TrainingSet, Arithmetic),
        network: Network,
        (inputs, targets): Statistics,
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
            inputs,
            targets,
            step: 0,
            origins: Vec::new(),
        };
        Ok(Self::assemble(cfg, given, parts))
    }

    pub(crate) fn assemble(
        cfg: TrainConfig,
        (set, on): (TrainingSet, Arithmetic),
        parts: Parts,
    ) -> Self {
        let statistics = parts.targets.freeze();
        let [nodes, edges] = &parts.inputs;
        let normalizers = Normalizers {
            nodes: nodes.freeze(),
            edges: edges.freeze(),
            acceleration: statistics.acceleration.clone(),
        };
        let engine: Box<dyn Engine> = match on {
            Arithmetic::OnProcessor => {
                Box::new(CpuEngine::new(&cfg, &parts.network, &parts.learned.weights))
            }
            Arithmetic::OnDevice => Box::new(Nobody),
        };
        Self {
            network: parts.network,
            learned: parts.learned,
            inputs: parts.inputs,
            targets: parts.targets,
            slots: parts.slots,
            step: parts.step,
            origins: parts.origins,
            set,
            statistics,
            normalizers,
            engine,
            cfg,
        }
    }

    /// Lets another engine do the arithmetic from the next step on.
    ///
    /// # Errors
    /// What `make` says, and what the engine before it does.
    pub fn run_on(
        &mut self,
        make: impl FnOnce(Setup<'_>) -> Result<Box<dyn Engine>, EngineError>,
    ) -> Result<(), TrainError> {
        self.collect()?;
        self.engine = make(self.setup())?;
        Ok(())
    }

    fn setup(&self) -> Setup<'_> {
        Setup {
            cfg: &self.cfg,
            network: &self.network,
            normalizers: &self.normalizers,
            statistics: &self.statistics,
            learned: &self.learned,
            set: &self.set,
        }
    }

    /// Brings weights and optimiser to where the engine has them; [`Self::save`] and [`Self::model`] are
    /// of then. On this machine's processor they always are there.
    ///
    /// # Errors
    /// When the engine fails.
    pub fn collect(&mut self) -> Result<(), TrainError> {
        Ok(self.engine.collect(&mut self.learned)?)
    }

    /// Learns from one batch.
    ///
    /// # Errors
    /// [`TrainError::NotFinite`]; the weights are then those before the step, but the slots have
    /// moved on: a checkpoint is what to go on from. So it is when the engine fails.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let step = self.step;
        let frames = self.cfg.unroll.at(step);
        let batch = Batch {
            setup: Setup {
                cfg: &self.cfg,
                network: &self.network,
                normalizers: &self.normalizers,
                statistics: &self.statistics,
                learned: &self.learned,
                set: &self.set,
            },
            slots: &mut self.slots,
            step,
            frames,
        };
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

    /// What was learned when it was last collected.
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

    /// The trainings whose weights this one began with, the first one first; none where it began with
    /// its own.
    #[must_use]
    pub fn origins(&self) -> &[Origin] {
        &self.origins
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

/// The data and the network of a training whose configuration is good and for which there is room on this
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
    need.with_lanes(cfg, &set, on).check(cfg)?;
    Ok((set, network))
}

/// What a training consists of besides configuration and data.
pub(crate) struct Parts {
    pub(crate) network: Network,
    pub(crate) learned: Learned,
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    pub(crate) slots: Vec<Slot>,
    pub(crate) step: u64,
    pub(crate) origins: Vec<Origin>,
}

#[cfg(test)]
mod tests;
