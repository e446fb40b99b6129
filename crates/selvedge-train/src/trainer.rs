//! The training step, read from top to bottom: every lane shows a sample, every shard goes forward
//! and backward, the gradients are added up in order, the optimiser steps, the lanes advance.
//!
//! Threads share shards. What a shard computes and the order in which shards are added do not depend
//! on their number, so the same seed gives the same bytes with any number of threads.

use std::sync::Arc;

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use selvedge_data::Dataset;
use selvedge_model::{
    ClothGraph, Connectivity, Dropout, Input, Model, ModelError, Network, Normalizers, Pass, Place,
    RunningStatistics, SpecError, Window, Workspace, Yaw, edge_groups, node_groups,
};
use thiserror::Error;

use crate::config::{InvalidConfig, TrainConfig};
use crate::corpus::{Corpus, CorpusError};
use crate::lane::{LaneState, Shown, rng_of};
use crate::losses::{LossEvaluator, LossStatistics, LossTerms, Report, RunningLossStatistics};
use crate::optimizer::{Adam, AdamError, clip_norm};

/// A training between two steps.
pub struct Trainer {
    pub(crate) cfg: TrainConfig,
    corpus: Corpus,
    network: Network,
    pub(crate) weights: Vec<f32>,
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

/// The buffers of the samples that go through the network together.
struct Shard {
    shown: Vec<Shown>,
    trajectories: Vec<usize>,
    connectivity: Connectivity,
    places: Vec<Place>,
    window: Window,
    workspace: Workspace<f32>,
    losses: LossEvaluator,
    output: Vec<f32>,
    output_gradient: Vec<f32>,
    gradient: Vec<f32>,
    terms: Vec<LossTerms>,
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
    Model(#[from] ModelError),
    #[error(
        "step {step}: the loss is not finite: lower learning_rate or set gradient_clip; the last checkpoint is whole"
    )]
    NotFinite { step: u64 },
}

impl Trainer {
    /// A training at its first step: fresh weights, statistics from `statistics_samples` samples.
    ///
    /// # Errors
    /// [`TrainError`] when the configuration or the data set cannot be used.
    pub fn new(cfg: TrainConfig, dataset: &Dataset) -> Result<Self, TrainError> {
        cfg.validate()?;
        let corpus = Corpus::load(dataset)?;
        let network = Network::new(&cfg.model)?;
        let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let (inputs, targets) = gather(&cfg, &corpus);
        let adam = Adam::new(cfg.optimizer, weights.len())?;
        let lanes = vec![LaneState::new(); cfg.batch.samples];
        Ok(Self::assemble(
            cfg,
            corpus,
            Parts {
                network,
                weights,
                adam,
                inputs,
                targets,
                lanes,
                step: 0,
            },
        ))
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
        Self {
            gradient: vec![0.0; parts.weights.len()],
            network: parts.network,
            weights: parts.weights,
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
    /// [`TrainError::NotFinite`]; the weights are then those before the step.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let step = self.step;
        let context = Context {
            cfg: &self.cfg,
            corpus: &self.corpus,
            network: &self.network,
            weights: &self.weights,
            normalizers: &self.normalizers,
            statistics: &self.statistics,
            step,
        };
        self.lanes
            .par_chunks_mut(self.cfg.batch.shard)
            .zip(&mut self.shards)
            .enumerate()
            .for_each(|(number, (lanes, shard))| shard.learn(&context, number, lanes));

        let share = 1.0 / self.cfg.batch.samples as f32;
        let shards = &self.shards;
        const CHUNK: usize = 16 * 1024;
        self.gradient
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, sum)| {
                sum.fill(0.0);
                for shard in shards {
                    let part = &shard.gradient[chunk * CHUNK..][..sum.len()];
                    sum.iter_mut().zip(part).for_each(|(s, g)| *s += share * g);
                }
            });
        let terms = mean(self.shards.iter().flat_map(|shard| &shard.terms));
        let limit = self.cfg.gradient_clip.unwrap_or(f64::INFINITY);
        let gradient_norm = clip_norm(&mut self.gradient, limit);
        if !(terms.total.is_finite() && gradient_norm.is_finite()) {
            return Err(TrainError::NotFinite { step: step + 1 });
        }
        let learning_rate = self.cfg.learning_rate.at(step);
        self.adam
            .step(&mut self.weights, &self.gradient, learning_rate);
        self.step += 1;
        Ok(StepReport {
            step: self.step,
            terms,
            gradient_norm,
            learning_rate,
            truth_probability: self.cfg.scheduled_sampling.truth.at(step),
        })
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

    /// The model as it is now, with `training` as its account of how it was trained.
    ///
    /// # Errors
    /// [`TrainError::Model`] when a weight is not finite.
    pub fn model(&self, training: String) -> Result<Model, TrainError> {
        let (weights, normalizers) = (self.weights.clone(), self.normalizers.clone());
        Ok(Model::new(&self.cfg.model, weights, normalizers, training)?)
    }
}

/// What a training consists of besides configuration and data.
pub(crate) struct Parts {
    pub(crate) network: Network,
    pub(crate) weights: Vec<f32>,
    pub(crate) adam: Adam,
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    pub(crate) lanes: Vec<LaneState>,
    pub(crate) step: u64,
}

/// What all shards share in a step.
struct Context<'a> {
    cfg: &'a TrainConfig,
    corpus: &'a Corpus,
    network: &'a Network,
    weights: &'a [f32],
    normalizers: &'a Normalizers,
    statistics: &'a LossStatistics,
    step: u64,
}

impl Shard {
    fn new(cfg: &TrainConfig, weights: usize, remaining: usize) -> Self {
        let samples = cfg.batch.shard.min(remaining);
        Self {
            shown: (0..samples).map(|_| Shown::default()).collect(),
            trajectories: Vec::new(),
            connectivity: Connectivity::union([]),
            places: Vec::new(),
            window: Window::default(),
            workspace: Workspace::new(),
            losses: LossEvaluator::new(cfg.losses, Report::Weighted),
            output: Vec::new(),
            output_gradient: Vec::new(),
            gradient: vec![0.0; weights],
            terms: Vec::with_capacity(samples),
        }
    }

    /// Shows the lanes' samples to the network, leaves the gradient of the sum of their losses,
    /// advances the lanes.
    fn learn(&mut self, context: &Context<'_>, number: usize, lanes: &mut [LaneState]) {
        let Context { cfg, corpus, .. } = *context;
        let first = number * cfg.batch.shard;
        let mut rngs: Vec<ChaCha8Rng> = (first..first + lanes.len())
            .map(|lane| rng_of(cfg.seed, context.step, lane, cfg.batch.samples))
            .collect();
        for ((lane, rng), shown) in lanes.iter_mut().zip(&mut rngs).zip(&mut self.shown) {
            lane.show(cfg, corpus, rng, shown);
        }
        self.join(corpus);
        self.write_window(context);
        self.pass(context);
        let normalizer = &context.normalizers.acceleration;
        normalizer.denormalize(&mut self.output);
        for (k, (lane, rng)) in lanes.iter_mut().zip(&mut rngs).enumerate() {
            let rows = self.rows(corpus, k);
            let yaw = self.shown[k].yaw.unwrap_or(Yaw::WORLD);
            lane.advance(cfg, corpus, (context.step, rng), yaw, &self.output[rows]);
        }
    }

    /// The disjoint union of the samples' graphs, made anew when they are other cloths.
    fn join(&mut self, corpus: &Corpus) {
        let trajectories = self.shown.iter().map(|shown| shown.trajectory);
        let graph = |t: usize| &corpus.motion(t).graph;
        let same = self.trajectories.len() == self.shown.len()
            && trajectories
                .clone()
                .zip(&self.trajectories)
                .all(|(a, &b)| Arc::ptr_eq(graph(a), graph(b)));
        if same {
            return;
        }
        self.trajectories = trajectories.collect();
        let motions: Vec<_> = self
            .trajectories
            .iter()
            .map(|&t| corpus.motion(t))
            .collect();
        self.connectivity = Connectivity::union(motions.iter().map(|m| &*m.connectivity));
        let graphs: Vec<&ClothGraph> = motions.iter().map(|m| &*m.graph).collect();
        self.places = Place::side_by_side(&graphs);
    }

    fn write_window(&mut self, context: &Context<'_>) {
        let spec = context.network.spec();
        for (shown, place) in self.shown.iter().zip(&self.places) {
            let graph = &context.corpus.motion(shown.trajectory).graph;
            let frames: Vec<&[Vec3]> = shown.frames.iter().map(Vec::as_slice).collect();
            self.window.fit(spec, place);
            let yaw = shown.yaw.unwrap_or(Yaw::WORLD);
            self.window.write(spec, graph, &frames, yaw, place);
        }
        let normalizers = context.normalizers;
        self.window
            .normalize(&normalizers.nodes, &normalizers.edges);
    }

    /// Forward, losses, backward.
    fn pass(&mut self, context: &Context<'_>) {
        let Context {
            cfg,
            corpus,
            network,
            weights,
            ..
        } = *context;
        let input = Input {
            nodes: &self.window.nodes,
            edges: &self.window.edges,
        };
        let dropout = Dropout {
            rate: cfg.dropout,
            seed: self.shown[0].dropout_seed,
        };
        let pass = Pass::Training(Some(dropout));
        let graph = &self.connectivity;
        let out = network.forward(weights, graph, input, pass, &mut self.workspace);
        self.output.clear();
        self.output.extend_from_slice(out);
        self.output_gradient.resize(out.len(), 0.0);
        self.terms.clear();
        for k in 0..self.shown.len() {
            let rows = self.rows(corpus, k);
            let shown = &self.shown[k];
            let triplet = shown.triplet(&corpus.motion(shown.trajectory).graph);
            let gradient = &mut self.output_gradient[rows.clone()];
            let predicted = &self.output[rows];
            let statistics = context.statistics;
            self.terms.push(
                self.losses
                    .evaluate(&triplet, statistics, predicted, gradient),
            );
        }
        self.gradient.fill(0.0);
        let both = (weights, &mut *self.gradient);
        network.backward(
            both,
            graph,
            input,
            &self.output_gradient,
            &mut self.workspace,
        );
    }

    /// Where sample `k` stands in an array `[vertices, 3]` of the union.
    fn rows(&self, corpus: &Corpus, k: usize) -> std::ops::Range<usize> {
        let graph = &corpus.motion(self.shown[k].trajectory).graph;
        let first = self.places[k].first_vertex;
        3 * first..3 * (first + graph.vertex_count())
    }
}

/// Statistics of inputs and targets over samples drawn as in training, before the first step.
fn gather(cfg: &TrainConfig, corpus: &Corpus) -> ([RunningStatistics; 2], RunningLossStatistics) {
    let spec = &cfg.model;
    let mut nodes = RunningStatistics::new(&node_groups(spec));
    let mut edges = RunningStatistics::new(&edge_groups(spec));
    let mut targets = RunningLossStatistics::default();
    let (mut shown, mut window) = (Shown::default(), Window::default());
    // The last streams: no training reaches them.
    let stream = u64::MAX / cfg.batch.samples as u64 - 1 - cfg.statistics_samples as u64;
    for number in 0..cfg.statistics_samples as u64 {
        let mut rng = rng_of(cfg.seed, stream + number, 0, cfg.batch.samples);
        LaneState::new().show(cfg, corpus, &mut rng, &mut shown);
        let graph = &*corpus.motion(shown.trajectory).graph;
        let place = Place::alone(graph);
        let frames: Vec<&[Vec3]> = shown.frames.iter().map(Vec::as_slice).collect();
        window.fit(spec, &place);
        window.write(
            spec,
            graph,
            &frames,
            shown.yaw.unwrap_or(Yaw::WORLD),
            &place,
        );
        nodes.add(&window.nodes);
        edges.add(&window.edges);
        targets.add(&shown.triplet(graph));
    }
    ([nodes, edges], targets)
}

fn mean<'a>(terms: impl Iterator<Item = &'a LossTerms>) -> LossTerms {
    let all: Vec<&LossTerms> = terms.collect();
    let share = 1.0 / all.len() as f64;
    let sum = |of: fn(&LossTerms) -> f64| share * all.iter().map(|t| of(t)).sum::<f64>();
    let sum_some = |of: fn(&LossTerms) -> Option<f64>| {
        let values: Option<Vec<f64>> = all.iter().map(|t| of(t)).collect();
        values.map(|values| share * values.iter().sum::<f64>())
    };
    LossTerms {
        acceleration: sum(|t| t.acceleration),
        kinetic_energy: sum_some(|t| t.kinetic_energy),
        edge_vector: sum_some(|t| t.edge_vector),
        edge_length: sum_some(|t| t.edge_length),
        bending_angle: sum_some(|t| t.bending_angle),
        total: sum(|t| t.total),
    }
}
