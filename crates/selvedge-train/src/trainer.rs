//! The training step, read from top to bottom: every slot shows a sample and is taken forward and
//! backward by the engine, the slots advance, the optimiser steps.

use std::ops::{ControlFlow, Range};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::Stop;
use selvedge_cluster::{ClusterError, Ranks};
use selvedge_data::Dataset;
use selvedge_model::{
    Domain, Model, Network, Normalizers, Place, RunningStatistics, SpecError, Window, edge_groups,
    node_groups,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::bounds::ConfigError;
use crate::checkpoint::State;
use crate::config::TrainConfig;
use crate::engine::{Engine, EngineError, EngineMaker, Learned, Setup, SlotRun, Update};
use crate::from_model::{Origin, check_model, take_model};
use crate::losses::{LossStatistics, LossTerms, RunningLossStatistics};
use crate::memory::{MemoryError, check_memory};
use crate::slot::{Expert, ShownSample, Slot, pack_slots, rng_of, unpack_slots};
use crate::training_set::{TrainingSet, TrainingSetError};

/// A training between two steps.
pub struct Trainer {
    pub(crate) cfg: TrainConfig,
    pub(crate) set: TrainingSet,
    network: Network,
    pub(crate) learned: Learned,
    pub(crate) state: State,
    statistics: LossStatistics,
    normalizers: Normalizers,
    fresh_tensors: Vec<String>,
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

/// A training that cannot start or go on.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TrainError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    TrainingSet(#[from] TrainingSetError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error(transparent)]
    Engine(#[from] EngineError),
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
        Self::Engine(error.into())
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
        let trainer = Self::begin(cfg, dataset, engine, None, &mut go_on)?;
        trainer.ok_or(TrainError::Stopped { step: 0 })
    }

    /// The same with an observer: `observe` is called after every sample of the statistics and may
    /// stop the fit, which gives no training. Where there is a `model`, the training has its weights
    /// and the statistics of its inputs and its output, and takes from samples only what the losses
    /// are measured by. Only the network must be that of the configuration, except its encoder:
    /// weights that the model has none for are fresh ([`Self::fresh_tensors`]).
    pub fn begin(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
        model: Option<&Model>,
        observe: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        if let Some(model) = model {
            check_model(&cfg, model)?;
        }
        let (set, network) = prepare(&cfg, dataset, engine.micro_batch())?;
        let Some(mut state) = first_state(&cfg, &set, observe) else {
            return Ok(None);
        };
        let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
        let mut weights = network.initialise(&mut || rng.random::<f64>());
        let fresh_tensors = match model {
            Some(model) => take_model(model, &cfg, &mut state, &network, &mut weights)?,
            None => Vec::new(),
        };
        let learned = Learned::first(&cfg, weights)?;
        let trainer = Self::assemble((cfg, set, network), engine, learned, state)?;
        Ok(Some(Self {
            fresh_tensors,
            ..trainer
        }))
    }

    pub(crate) fn assemble(
        (cfg, set, network): (TrainConfig, TrainingSet, Network),
        engine: &dyn EngineMaker,
        learned: Learned,
        state: State,
    ) -> Result<Self, TrainError> {
        let statistics = state.targets.freeze();
        let [nodes, edges] = &state.inputs;
        let normalizers = Normalizers {
            nodes: nodes.freeze(),
            edges: edges.freeze(),
            acceleration: statistics.acceleration.clone(),
        };
        let setup = Setup {
            cfg: &cfg,
            network: &network,
            normalizers: &normalizers,
            statistics: &statistics,
            learned: &learned,
            stop: &Stop::default(),
            expert: None,
            set: &set,
        };
        let made = engine.make(setup)?;
        Ok(Self {
            ranks: engine.ranks(),
            own: engine.own_slots(cfg.batch.samples),
            network,
            learned,
            state,
            fresh_tensors: Vec::new(),
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
            .gather(pack_slots(&self.state.slots[self.own.clone()]))?;
        if !self.ranks.is_first() {
            return Ok(());
        }
        let mut slots = Vec::with_capacity(self.state.slots.len());
        for (rank, packed) in all.iter().enumerate() {
            slots.extend(unpack_slots(packed).ok_or(TrainError::Slots { rank })?);
        }
        if slots.len() != self.state.slots.len() {
            let rank = all.len() - 1;
            return Err(TrainError::Slots { rank });
        }
        self.state.slots = slots;
        Ok(())
    }

    /// The ranks that share the training.
    pub fn ranks(&self) -> &Ranks {
        &self.ranks
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
        let step = self.state.step;
        if self.expert.is_none() && self.cfg.asks_expert() {
            return Err(TrainError::NoExpert);
        }
        // Frames of a history are shared: none of their positions is copied.
        let slots = self.state.slots.clone();
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
        let runs = self.state.slots.iter_mut().enumerate();
        let mut runs: Vec<SlotRun<'_>> = runs
            .map(|(number, slot)| SlotRun::new(setup, (step, frames), number, slot))
            .collect();
        let terms = self.engine.learn(setup, &mut runs)?;
        if terms.is_empty() {
            self.state.slots = slots;
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
        self.state.step += 1;
        Ok(StepReport {
            step: self.state.step,
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
        self.state.step
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
        &self.state.origins
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

/// Reads the data and builds the network, after checking the configuration and the memory of this
/// machine.
pub(crate) fn prepare(
    cfg: &TrainConfig,
    dataset: &Dataset,
    micro_batch: Option<usize>,
) -> Result<(TrainingSet, Network), TrainError> {
    cfg.validate()?;
    let network = Network::new(&cfg.model)?;
    check_memory(cfg, &network, dataset, micro_batch)?;
    let set = TrainingSet::load(dataset)?;
    set.check_features(&cfg.model, dataset)?;
    Ok((set, network))
}

/// The state before the first step, with statistics of as many samples as the configuration says,
/// drawn as in training; none where `observe`, which is called after each, stops there.
fn first_state(
    cfg: &TrainConfig,
    set: &TrainingSet,
    observe: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<State> {
    let spec = &cfg.model;
    let [mut nodes, mut edges] =
        [node_groups(spec), edge_groups(spec)].map(|groups| RunningStatistics::new(&groups));
    let mut targets = RunningLossStatistics::default();
    let (mut shown, mut window) = (ShownSample::default(), Window::default());
    // The last streams: no training reaches them. The bounds of both counts leave room.
    let last = u64::MAX / cfg.batch.samples as u64 - 1;
    for stream in last - cfg.statistics_samples as u64..last {
        let mut rng = rng_of(cfg.seed, stream, 0, cfg.batch.samples);
        Slot::new().show(cfg, set, &mut rng, &mut shown);
        let graph = shown.graph(&set.motion(shown.trajectory).graph);
        let place = Place::alone(graph);
        window.write(spec, graph, shown.window(), &place);
        nodes.add(&window.nodes);
        edges.add(&window.arcs);
        targets.add(&shown.triplet(graph));
        if observe().is_break() {
            return None;
        }
    }
    Some(State {
        step: 0,
        optimizer_steps: 0,
        inputs: [nodes, edges],
        targets,
        slots: vec![Slot::new(); cfg.batch.samples],
        origins: Vec::new(),
        since_line: Vec::new(),
    })
}

#[cfg(test)]
mod tests;
