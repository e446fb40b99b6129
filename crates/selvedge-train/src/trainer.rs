//! The training step, read from top to bottom: every lane shows a sample, every shard goes forward
//! and backward, the gradients are added up in order, the optimiser steps, the lanes advance.
//!
//! Threads share shards. What a shard computes and the order in which shards are added do not depend
//! on their number, so the same seed gives the same bytes with any number of threads.

use std::ops::ControlFlow;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use selvedge_data::Dataset;
use selvedge_model::{
    Instructions, Model, ModelError, Network, Normalizers, PackedWeights, Purpose,
    RunningStatistics, SpecError,
};
use thiserror::Error;

use crate::config::{InvalidConfig, TrainConfig};
use crate::corpus::{Corpus, CorpusError};
use crate::gathering::{Gathered, Gathering, Statistics};
use crate::lane::LaneState;
use crate::losses::{LossStatistics, LossTerms, RunningLossStatistics};
use crate::memory::{MemoryError, Need};
use crate::optimizer::{Adam, AdamError, clip_norm};
use crate::shard::{Context, Shard};

/// A training between two steps.
pub struct Trainer {
    pub(crate) cfg: TrainConfig,
    corpus: Corpus,
    network: Network,
    pub(crate) weights: Vec<f32>,
    /// Their running mean, where the configuration wants one.
    pub(crate) averaged: Option<Vec<f32>>,
    packed: PackedWeights<f32>,
    pub(crate) adam: Adam,
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    statistics: LossStatistics,
    normalizers: Normalizers,
    pub(crate) lanes: Vec<LaneState>,
    pub(crate) step: u64,
    shards: Vec<Shard>,
    gradient: Vec<f32>,
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
    Corpus(#[from] CorpusError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error(transparent)]
    Model(#[from] ModelError),
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
        let (corpus, network) = prepare(&cfg, dataset)?;
        let mut gathering = Gathering::new(&cfg, &corpus);
        while gathering.advance().is_some() {}
        let statistics = gathering.finish();
        Self::begin(cfg, corpus, network, statistics)
    }

    /// The same; `observe` hears of every sample of the statistics and may stop, which gives none.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn new_observed(
        cfg: TrainConfig,
        dataset: &Dataset,
        observe: &mut dyn FnMut(Gathered) -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        let (corpus, network) = prepare(&cfg, dataset)?;
        let mut gathering = Gathering::new(&cfg, &corpus);
        while let Some(gathered) = gathering.advance() {
            if observe(gathered).is_break() {
                return Ok(None);
            }
        }
        let statistics = gathering.finish();
        Self::begin(cfg, corpus, network, statistics).map(Some)
    }

    fn begin(
        cfg: TrainConfig,
        corpus: Corpus,
        network: Network,
        (inputs, targets): Statistics,
    ) -> Result<Self, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let parts = Parts {
            adam: Adam::new(cfg.optimizer, weights.len())?,
            lanes: vec![LaneState::new(); cfg.batch.samples],
            averaged: cfg.weight_average.map(|_| weights.clone()),
            network,
            weights,
            inputs,
            targets,
            step: 0,
        };
        Ok(Self::assemble(cfg, corpus, parts))
    }

    pub(crate) fn assemble(cfg: TrainConfig, corpus: Corpus, parts: Parts) -> Self {
        let statistics = parts.targets.freeze();
        let [nodes, edges] = &parts.inputs;
        let normalizers = Normalizers {
            nodes: nodes.freeze(),
            edges: edges.freeze(),
            acceleration: statistics.acceleration.clone(),
        };
        let shard_count = cfg.batch.samples.div_ceil(cfg.batch.shard);
        let shards = (0..shard_count)
            .map(|k| {
                Shard::new(
                    &cfg,
                    parts.weights.len(),
                    cfg.batch.samples - k * cfg.batch.shard,
                )
            })
            .collect();
        let (purpose, using) = (Purpose::Training, Instructions::Detected);
        Self {
            packed: PackedWeights::new(&parts.network, &parts.weights, purpose, using),
            gradient: vec![0.0; parts.weights.len()],
            network: parts.network,
            weights: parts.weights,
            averaged: parts.averaged,
            adam: parts.adam,
            inputs: parts.inputs,
            targets: parts.targets,
            lanes: parts.lanes,
            step: parts.step,
            corpus,
            statistics,
            normalizers,
            shards,
            cfg,
        }
    }

    /// Learns from one batch.
    ///
    /// # Errors
    /// [`TrainError::NotFinite`]; the weights are then those before the step, but the lanes have
    /// moved on: a checkpoint is what to go on from.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let step = self.step;
        self.packed.update(&self.network, &self.weights);
        let context = Context {
            cfg: &self.cfg,
            corpus: &self.corpus,
            network: &self.network,
            weights: &self.packed,
            normalizers: &self.normalizers,
            statistics: &self.statistics,
            step,
        };
        let frames = self.cfg.unroll.at(step);
        self.lanes
            .par_chunks_mut(self.cfg.batch.shard)
            .zip(&mut self.shards)
            .enumerate()
            .for_each(|(number, (lanes, shard))| match frames {
                1 => shard.learn(&context, number, lanes),
                _ => shard.learn_unrolled(&context, (number, frames), lanes),
            });

        self.sum_gradients();
        let terms = LossTerms::mean(self.shards.iter().flat_map(|shard| &shard.terms));
        let limit = self.cfg.gradient_clip.unwrap_or(f64::INFINITY);
        let gradient_norm = clip_norm(&mut self.gradient, limit);
        if !(terms.total.is_finite() && gradient_norm.is_finite()) {
            return Err(TrainError::NotFinite { step: step + 1 });
        }
        let learning_rate = self.cfg.learning_rate.at(step);
        self.adam
            .step(&mut self.weights, &self.gradient, learning_rate);
        self.average();
        self.step += 1;
        Ok(StepReport {
            step: self.step,
            terms,
            gradient_norm,
            learning_rate,
            truth_probability: self.cfg.scheduled_sampling.truth.at(step),
            frames,
        })
    }

    /// Takes the weights into their running mean.
    fn average(&mut self) {
        let (Some(part), Some(averaged)) = (self.cfg.weight_average, &mut self.averaged) else {
            return;
        };
        let steps = self.adam.steps() as f64;
        let left = part.min((1.0 + steps) / (10.0 + steps)) as f32;
        for (mean, &weight) in averaged.iter_mut().zip(&self.weights) {
            *mean += (1.0 - left) * (weight - *mean);
        }
    }

    /// The mean over the batch of the shards' gradients, added in their order whatever the number
    /// of threads.
    fn sum_gradients(&mut self) {
        const CHUNK: usize = 16 * 1024;
        let share = 1.0 / self.cfg.batch.samples as f32;
        let shards = &self.shards;
        let chunks = self.gradient.par_chunks_mut(CHUNK).enumerate();
        chunks.for_each(|(chunk, sum)| {
            sum.fill(0.0);
            for shard in shards {
                let part = &shard.gradient[chunk * CHUNK..][..sum.len()];
                sum.iter_mut().zip(part).for_each(|(s, g)| *s += share * g);
            }
        });
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
        self.weights.len()
    }

    /// Number of samples in the sections of the data set.
    #[must_use]
    pub fn sample_count(&self) -> usize {
        self.corpus.sample_count()
    }

    /// The mean gradient of the last step, after clipping.
    #[cfg(test)]
    pub(crate) fn gradient(&self) -> &[f32] {
        &self.gradient
    }

    /// The model as it is now, with `training` as its account of how it was trained.
    ///
    /// # Errors
    /// [`TrainError::Model`] when a weight is not finite.
    pub fn model(&self, training: String) -> Result<Model, TrainError> {
        let weights = self.averaged.as_ref().unwrap_or(&self.weights).clone();
        let normalizers = self.normalizers.clone();
        Ok(Model::new(&self.cfg.model, weights, normalizers, training)?)
    }
}

/// The data and the network of a training whose configuration is good and for which there is room.
pub(crate) fn prepare(
    cfg: &TrainConfig,
    dataset: &Dataset,
) -> Result<(Corpus, Network), TrainError> {
    cfg.validate()?;
    let network = Network::new(&cfg.model)?;
    let need = Need::before_reading(cfg, &network, dataset);
    need.check(cfg)?;
    let corpus = Corpus::load(dataset, cfg.mirror_images)?;
    need.with_lanes(cfg, &corpus).check(cfg)?;
    Ok((corpus, network))
}

/// What a training consists of besides configuration and data.
pub(crate) struct Parts {
    pub(crate) network: Network,
    pub(crate) weights: Vec<f32>,
    pub(crate) averaged: Option<Vec<f32>>,
    pub(crate) adam: Adam,
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    pub(crate) lanes: Vec<LaneState>,
    pub(crate) step: u64,
}

#[cfg(test)]
mod tests;
