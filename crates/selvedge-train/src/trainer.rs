//! The training step, read from top to bottom: every slot shows a sample and is taken forward and
//! backward by the engine, the slots advance, the optimiser steps.

use std::ops::{ControlFlow, Range};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::Stop;
use selvedge_cluster::{ClusterError, Ranks};
use selvedge_data::Dataset;
use selvedge_model::{Domain, Model, Network, Normalizers, RunningStatistics, SpecError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::config::{InvalidConfig, TrainConfig};
use crate::engine::{Batch, Engine, EngineError, EngineMaker, Learned, Setup, Update};
use crate::expert::Expert;
use crate::fit_normalizers::{Statistics, fit};
use crate::losses::{LossStatistics, LossTerms, RunningLossStatistics};
use crate::memory::{Arithmetic, MemoryError, check_memory};
use crate::optimizer::Adam;
use crate::origin::Origin;
use crate::slot::{Slot, pack_slots, unpack_slots};
use crate::training_set::{TrainingSet, TrainingSetError};

/// A training between two steps.
pub struct Trainer {
    pub(crate) cfg: TrainConfig,
    pub(crate) set: TrainingSet,
    network: Network,
    pub(crate) learned: Learned,
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    statistics: LossStatistics,
    normalizers: Normalizers,
    pub(crate) slots: Vec<Slot>,
    pub(crate) step: u64,
    pub(crate) origins: Vec<Origin>,
    pub(crate) fresh_tensors: Vec<String>,
    /// Steps since the last line of the log, which a checkpoint keeps.
    pub(crate) since_line: Vec<StepReport>,
    engine: Box<dyn Engine>,
    stop: Stop,
    expert: Option<Box<dyn Expert>>,
    /// The ranks of the engine, and the slots that this one moves.
    ranks: Ranks,
    own: Range<usize>,
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

/// Wishes of a rank after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wishes {
    pub(crate) stop: bool,
    /// To write a checkpoint.
    pub(crate) save: bool,
    /// To end, since the time is up.
    pub(crate) end: bool,
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
    TrainingSet(#[from] TrainingSetError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error(transparent)]
    Ranks(Box<ClusterError>),
    #[error(
        "rank {rank} sent slots that are none of this training's: start one program on all ranks"
    )]
    Slots { rank: usize },
    #[error(
        "the model to start from is another one: {differences}: set these values as they are there, or train without it"
    )]
    OtherModel { differences: String },
    #[error("comparing the models: {0}")]
    Json(serde_json::Error),
    #[error("step {step}: the loss is not finite: lower learning_rate or set gradient_clip")]
    NotFinite { step: u64 },
    #[error(
        "scheduled_sampling.labels is \"expert\", but the training was given no physics to ask: call `Trainer::ask` before the first step"
    )]
    NoExpert,
    #[error("step {step} was given up, as was asked")]
    Stopped { step: u64 },
}

impl From<ClusterError> for TrainError {
    fn from(error: ClusterError) -> Self {
        Self::Ranks(Box::new(error))
    }
}

impl Trainer {
    /// A training at its first step on the engine that `engine` makes: fresh weights, statistics
    /// from `statistics_samples` samples.
    pub fn new(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
    ) -> Result<Self, TrainError> {
        let mut go_on = || ControlFlow::Continue(());
        let trainer = Self::new_observed(cfg, dataset, engine, &mut go_on)?;
        trainer.ok_or(TrainError::Stopped { step: 0 })
    }

    /// The same with an observer: `observe` is called after every sample of the statistics and may
    /// stop the fit, which gives no training.
    pub fn new_observed(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
        observe: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        let Some(statistics) = fit(&cfg, &set, observe) else {
            return Ok(None);
        };
        let weights = first_weights(&cfg, &network);
        let parts = Parts::at_first_step(&cfg, network, weights, statistics, Vec::new())?;
        Self::assemble(cfg, set, engine, parts).map(Some)
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
            stop: &Stop::default(),
            expert: None,
            set: &set,
        };
        let made = engine.make(setup)?;
        Ok(Self {
            ranks: engine.ranks(),
            own: engine.own_slots(cfg.batch.samples),
            network: parts.network,
            learned: parts.learned,
            inputs,
            targets,
            slots: parts.slots,
            step: parts.step,
            origins: parts.origins,
            fresh_tensors: Vec::new(),
            since_line: parts.since_line,
            set,
            statistics,
            normalizers,
            engine: made,
            stop: Stop::default(),
            expert: None,
            cfg,
        })
    }

    /// Copies weights and optimiser from the engine, for [`Self::save`] and [`Self::model`]. The
    /// engine of this machine's processor always has them here.
    pub fn collect(&mut self) -> Result<(), TrainError> {
        self.engine.collect(&mut self.learned)?;
        if self.ranks.are_several() {
            self.collect_slots()?;
        }
        Ok(())
    }

    /// Brings the slots that other ranks move to rank 0.
    fn collect_slots(&mut self) -> Result<(), TrainError> {
        let all = self
            .ranks
            .gather(pack_slots(&self.slots[self.own.clone()]))?;
        if !self.ranks.is_first() {
            return Ok(());
        }
        let mut slots = Vec::with_capacity(self.slots.len());
        for (rank, packed) in all.iter().enumerate() {
            slots.extend(unpack_slots(packed).ok_or(TrainError::Slots { rank })?);
        }
        if slots.len() != self.slots.len() {
            let rank = all.len() - 1;
            return Err(TrainError::Slots { rank });
        }
        self.slots = slots;
        Ok(())
    }

    /// The ranks that share the training.
    pub fn ranks(&self) -> &Ranks {
        &self.ranks
    }

    /// Agrees on what all ranks do after a step: rank 0 says whether time is up and a checkpoint is
    /// due, and any of them may stop.
    pub(crate) fn agree(&self, own: Wishes) -> Result<Wishes, TrainError> {
        if !self.ranks.are_several() {
            return Ok(own);
        }
        let Wishes { stop, save, end } = own;
        let told = [stop, save, end].map(u8::from).to_vec();
        let all = self.ranks.gather_for_all(told)?;
        let of_first = |wish: usize| all[0].get(wish) == Some(&1);
        Ok(Wishes {
            stop: all.iter().any(|told| told.first() == Some(&1)),
            save: of_first(1),
            end: of_first(2),
        })
    }

    /// Lets [`Self::step`] be given up in the middle from when `stop` is wanted. Where one of
    /// several ranks gives it up, all do, as soon as each has done or given up its part.
    pub fn stop_by(&mut self, stop: Stop) {
        self.stop = stop;
    }

    /// Gives the training the physics that made its data, which labels the model's own states
    /// (`scheduled_sampling.labels = "expert"`).
    pub fn ask(&mut self, expert: Box<dyn Expert>) {
        self.expert = Some(expert);
    }

    /// Learns from one batch.
    ///
    /// # Errors
    /// [`TrainError::Stopped`], which leaves the training as it was before; else
    /// [`TrainError::NotFinite`] or a failure of the engine. The weights are then those before the
    /// step, but the slots have moved on: resume from a checkpoint.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let step = self.step;
        if self.expert.is_none() && self.cfg.asks_expert() {
            return Err(TrainError::NoExpert);
        }
        // Frames of a history are shared: none of their positions is copied.
        let slots = self.slots.clone();
        let frames = self.cfg.unroll.at(step);
        let setup = Setup {
            cfg: &self.cfg,
            network: &self.network,
            normalizers: &self.normalizers,
            statistics: &self.statistics,
            learned: &self.learned,
            stop: &self.stop,
            expert: self.expert.as_deref().filter(|_| self.cfg.asks_expert()),
            set: &self.set,
        };
        let batch = Batch::new(setup, &mut self.slots, step, frames);
        let terms = self.engine.learn(batch)?;
        if terms.is_empty() {
            self.slots = slots;
            return Err(TrainError::Stopped { step: step + 1 });
        }
        let terms = LossTerms::mean(&terms);
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
    pub fn learned(&self) -> &Learned {
        &self.learned
    }

    /// Steps done so far.
    pub fn steps_done(&self) -> u64 {
        self.step
    }

    /// The configuration.
    pub fn config(&self) -> &TrainConfig {
        &self.cfg
    }

    /// Number of weights.
    pub fn parameter_count(&self) -> usize {
        self.learned.weights.len()
    }

    /// Number of tensors of weights.
    pub fn tensor_count(&self) -> usize {
        self.network.parameters().len()
    }

    /// Number of samples in the sections of the data set.
    pub fn sample_count(&self) -> u64 {
        self.set.sample_count() as u64
    }

    /// The name of the data set.
    pub fn dataset_name(&self) -> &str {
        &self.set.name
    }

    /// The trainings whose weights this one began with, the first one first; none where it began
    /// with its own.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// Names of the tensors that the training or the model that this one began with has not, so
    /// that they begin with random numbers; none where it has them all, and none after a resume.
    pub fn fresh_tensors(&self) -> &[String] {
        &self.fresh_tensors
    }

    /// The domain of what is learned from.
    pub fn domain(&self) -> &Domain {
        self.set.domain()
    }

    /// The mean gradient of the last step, after clipping, laid out like the weights.
    pub fn gradient(&mut self) -> Result<Vec<f32>, TrainError> {
        Ok(self.engine.gradient()?)
    }

    /// The model as it was last collected, with `training` as its account of how it was trained.
    pub fn model(&self, training: String) -> Result<Model, TrainError> {
        let model = &self.cfg.model;
        Ok(self.learned.model(model, &self.normalizers, training)?)
    }
}

/// The weights of a training that begins with nothing.
pub(crate) fn first_weights(cfg: &TrainConfig, network: &Network) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
    network.initialise(&mut || rng.random::<f64>())
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
    check_memory(cfg, &network, dataset, on)?;
    Ok((TrainingSet::load(dataset)?, network))
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

impl Parts {
    /// The parts of a training at its first step.
    pub(crate) fn at_first_step(
        cfg: &TrainConfig,
        network: Network,
        weights: Vec<f32>,
        statistics: Statistics,
        origins: Vec<Origin>,
    ) -> Result<Self, TrainError> {
        Ok(Self {
            learned: Learned {
                adam: Adam::new(cfg.optimizer, weights.len())?,
                averaged: cfg.weight_average.map(|_| weights.clone()),
                weights,
            },
            slots: vec![Slot::new(); cfg.batch.samples],
            network,
            statistics,
            step: 0,
            origins,
            since_line: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests;
