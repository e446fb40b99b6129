//! The training: takes samples in, and steps.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use selvedge_cloth::Stop;
use selvedge_model::{
    Instructions, Model, ModelError, Network, Normalizers, PackedWeights, Purpose,
    RunningStatistics, SpecError, Stopped, correction_groups,
};
use thiserror::Error;

use super::config::CorrectionConfig;
use super::learning::{Desk, Lesson};
use super::store::{CorrectionSample, Store};
use crate::config::InvalidConfig;
use crate::engine::Learned;
use crate::optimizer::{Adam, AdamError, clip_norm};

/// A training between two steps.
pub struct CorrectionTrainer {
    pub(super) cfg: CorrectionConfig,
    network: Network,
    pub(super) learned: Learned,
    /// None until there are samples enough to take statistics from.
    pub(super) normalizers: Option<Normalizers>,
    pub(super) step: u64,
    store: Store,
    /// Samples drawn since the store was begun.
    drawn: u64,
    packed: PackedWeights<f32>,
    desks: Vec<Desk>,
    gradient: Vec<f32>,
}

/// Report of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectionReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Mean loss of its samples.
    pub loss: f64,
    /// Norm of the gradient before clipping.
    pub gradient_norm: f64,
    /// The learning rate.
    pub learning_rate: f64,
}

/// A training that cannot be begun or go on.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum CorrectionTrainError {
    #[error(transparent)]
    Config(#[from] InvalidConfig),
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    Adam(#[from] AdamError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error("there are no samples yet to learn from")]
    NoSamples,
    #[error("step {step}: the gradient is not finite: lower the learning rate, or clip it")]
    Gradient { step: u64 },
    #[error("step {step} was given up, as was asked")]
    Stopped { step: u64 },
}

impl CorrectionTrainer {
    /// A training before its first step.
    ///
    /// # Errors
    /// What of the configuration is wrong.
    pub fn new(cfg: CorrectionConfig) -> Result<Self, CorrectionTrainError> {
        cfg.validate()?;
        let network = Network::new(&cfg.model)?;
        let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let learned = Learned {
            averaged: cfg.weight_average.map(|_| weights.clone()),
            adam: Adam::new(cfg.optimizer, weights.len())?,
            weights,
        };
        Ok(Self::with(cfg, network, learned))
    }

    /// A training with these weights, without samples or statistics.
    pub(super) fn with(cfg: CorrectionConfig, network: Network, learned: Learned) -> Self {
        let count = learned.weights.len();
        let using = Instructions::Detected;
        Self {
            packed: network.pack(&learned.weights, Purpose::Training, using),
            desks: (0..cfg.batch.samples).map(|_| Desk::new(count)).collect(),
            gradient: vec![0.0; count],
            normalizers: None,
            step: 0,
            store: Store::default(),
            drawn: 0,
            cfg,
            network,
            learned,
        }
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &CorrectionConfig {
        &self.cfg
    }

    /// Steps done.
    #[must_use]
    pub fn steps_done(&self) -> u64 {
        self.step
    }

    /// Number of weights.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.learned.weights.len()
    }

    /// Samples that were added since the training was begun or resumed.
    #[must_use]
    pub fn samples_made(&self) -> u64 {
        self.store.added
    }

    /// Returns true where more samples are due before the next step.
    #[must_use]
    pub fn wants_samples(&self) -> bool {
        let samples = &self.cfg.samples;
        self.normalizers.is_none()
            || self.store.samples().len() < samples.statistics
            || self.drawn as f64 >= samples.uses * self.store.added as f64
    }

    /// Adds samples, and takes the statistics of the first ones.
    pub fn add(&mut self, samples: impl IntoIterator<Item = CorrectionSample>) {
        for sample in samples {
            self.store.add(sample, self.cfg.samples.kept);
        }
        let enough = self.store.samples().len() >= self.cfg.samples.statistics;
        if self.normalizers.is_none() && enough {
            self.normalizers = Some(self.statistics());
        }
        if self.store.samples().len() <= self.cfg.samples.statistics {
            // Those of the statistics are no debt.
            self.drawn = (self.store.added as f64 * self.cfg.samples.uses) as u64;
        }
    }

    fn statistics(&self) -> Normalizers {
        let mut all = correction_groups().map(|groups| RunningStatistics::new(&groups));
        let [nodes, targets] = &mut all;
        for sample in self.store.samples() {
            nodes.add(&sample.nodes);
            let rows = sample.target.chunks_exact(self.cfg.model.outputs());
            for (row, _) in rows.zip(&sample.weights).filter(|(_, w)| **w > 0.0) {
                targets.add(row);
            }
        }
        let [nodes, acceleration] = all.map(|statistics| statistics.freeze());
        Normalizers {
            nodes,
            edges: RunningStatistics::new(&[]).freeze(),
            acceleration,
        }
    }

    /// Lets [`Self::step`] be given up in the middle from when `stop` is wanted.
    pub fn stop_by(&mut self, stop: Stop) {
        for desk in &mut self.desks {
            desk.stop_by(stop.clone());
        }
    }

    /// One step.
    ///
    /// # Errors
    /// No samples, a gradient that is not finite, or [`CorrectionTrainError::Stopped`]; the weights
    /// are then as they were.
    pub fn step(&mut self) -> Result<CorrectionReport, CorrectionTrainError> {
        let Some(normalizers) = &self.normalizers else {
            return Err(CorrectionTrainError::NoSamples);
        };
        let store = self.store.samples();
        if store.is_empty() {
            return Err(CorrectionTrainError::NoSamples);
        }
        let cfg = &self.cfg;
        let mut rng = ChaCha8Rng::seed_from_u64(cfg.seed);
        rng.set_stream(1 + self.step);
        let picks: Vec<usize> = (0..cfg.batch.samples)
            .map(|_| rng.random_range(0..store.len()))
            .collect();
        self.network.repack(&self.learned.weights, &mut self.packed);
        let lesson = Lesson {
            network: &self.network,
            weights: &self.packed,
            normalizers,
            cap: cfg.loss_cap,
            part: 1.0 / picks.len() as f64,
        };
        let desks = self.desks.par_iter_mut().zip(&picks);
        let losses: Result<Vec<f64>, Stopped> = desks
            .map(|(desk, &pick)| desk.learn(lesson, &store[pick]))
            .collect();
        let Ok(losses) = losses else {
            let step = self.step + 1;
            return Err(CorrectionTrainError::Stopped { step });
        };
        self.drawn += picks.len() as u64;
        self.gradient.fill(0.0);
        for desk in &self.desks {
            let pairs = self.gradient.iter_mut().zip(&desk.gradient);
            pairs.for_each(|(sum, g)| *sum += g);
        }
        let learning_rate = cfg.learning_rate.at(self.step);
        let gradient_norm = self.update(learning_rate)?;
        self.step += 1;
        Ok(CorrectionReport {
            step: self.step,
            loss: losses.iter().sum::<f64>() / losses.len() as f64,
            gradient_norm,
            learning_rate,
        })
    }

    /// Takes the weights a step against the gradient. Gives its norm before clipping.
    fn update(&mut self, learning_rate: f64) -> Result<f64, CorrectionTrainError> {
        let limit = self.cfg.gradient_clip.unwrap_or(f64::INFINITY);
        let norm = clip_norm(&mut self.gradient, limit);
        if !norm.is_finite() {
            let step = self.step + 1;
            return Err(CorrectionTrainError::Gradient { step });
        }
        let Learned {
            weights,
            averaged,
            adam,
        } = &mut self.learned;
        adam.step(weights, &self.gradient, learning_rate);
        if let (Some(part), Some(averaged)) = (self.cfg.weight_average, averaged) {
            let share = Learned::averaging(adam.steps(), part);
            for (mean, &weight) in averaged.iter_mut().zip(&*weights) {
                *mean += share * (weight - *mean);
            }
        }
        Ok(norm)
    }

    /// The model as it is now; none before there are statistics.
    ///
    /// # Errors
    /// Weights that are not finite.
    pub fn model(&self, account: String) -> Result<Option<Model>, CorrectionTrainError> {
        let Some(normalizers) = self.normalizers.clone() else {
            return Ok(None);
        };
        let Learned {
            weights, averaged, ..
        } = &self.learned;
        let weights = averaged.as_ref().unwrap_or(weights).clone();
        let model = Model::new(&self.cfg.model, weights, normalizers, account)?;
        Ok(Some(model))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::correction::learning::tests::sample;

    pub(in crate::correction) fn config(text: &str) -> CorrectionConfig {
        let text = format!(
            "name = \"tiny\"\nseed = 1\nsteps = 100\nlog_every = 10\nbatch = {{ samples = 2 }}\n\
             learning_rate = {{ kind = \"constant\", rate = 1e-2 }}\n{text}\n\
             [teacher]\nscenes = [\"first\"]\nsubsteps = 2\n\
             [samples]\nstatistics = 4\nkept = 8\nuses = 3.0\n\
             [model]\nencoder = {{ kind = \"mlp\" }}\nlatent = 8\nblocks = 0\n\
             base = {{ substeps = 1 }}\n"
        );
        CorrectionConfig::parse_with(&text, "tiny.toml".as_ref(), &[]).unwrap()
    }

    #[test]
    fn samples_are_wanted_until_statistics_and_after_so_many_uses() {
        let mut trainer = CorrectionTrainer::new(config("")).unwrap();
        assert!(matches!(
            trainer.step(),
            Err(CorrectionTrainError::NoSamples)
        ));
        assert!(trainer.model(String::new()).unwrap().is_none());
        trainer.add((0..3).map(sample));
        assert!(trainer.wants_samples());
        trainer.add([sample(3)]);
        assert!(trainer.normalizers.is_some());
        assert!(
            trainer.wants_samples(),
            "one that was not in the statistics"
        );
        trainer.add([sample(4)]);
        let mut steps = 0;
        while !trainer.wants_samples() {
            trainer.step().unwrap();
            steps += 1;
        }
        // Three uses, two samples a step.
        assert_eq!(steps, 2);
    }

    #[test]
    fn it_learns_what_repeats() {
        let mut trainer = CorrectionTrainer::new(config("weight_average = 0.9")).unwrap();
        trainer.add((0..4).map(sample));
        let first = trainer.step().unwrap().loss;
        let mut last = first;
        for _ in 0..800 {
            last = trainer.step().unwrap().loss;
        }
        assert!(last < 0.5 * first, "{first} {last}");
        let model = trainer.model("account".to_owned()).unwrap().unwrap();
        assert_eq!(model.training, "account");
        let other = CorrectionTrainer::new(config("")).unwrap();
        assert_ne!(model.weights(), other.learned.weights);
    }

    #[test]
    fn a_step_that_is_given_up_changes_nothing() {
        let run = |gives_up: bool| {
            let mut trainer = CorrectionTrainer::new(config("")).unwrap();
            trainer.add((0..5).map(sample));
            for _ in 0..5 {
                if gives_up {
                    let stop = Stop::default();
                    stop.ask();
                    trainer.stop_by(stop);
                    let error = trainer.step().unwrap_err();
                    assert!(matches!(error, CorrectionTrainError::Stopped { .. }));
                    trainer.stop_by(Stop::default());
                }
                trainer.step().unwrap();
            }
            trainer.learned
        };
        assert_eq!(run(true), run(false));
    }

    #[test]
    fn the_same_samples_give_the_same_weights() {
        let run = || {
            let mut trainer = CorrectionTrainer::new(config("")).unwrap();
            trainer.add((0..5).map(sample));
            for _ in 0..5 {
                trainer.step().unwrap();
            }
            trainer.learned
        };
        assert_eq!(run(), run());
    }
}
