//! The configuration of a training: a TOML file, checked once, saved beside the result.

mod setting;

use std::path::Path;

use selvedge_model::ModelSpec;
use serde::{Deserialize, Serialize};

pub use self::setting::Setting;
use crate::bounds::{ConfigError, below_one, count, part, positive, require};
use crate::losses::LossWeights;
use crate::optimizer::AdamSettings;
use crate::schedule::{LearningRate, MOST_STEPS, TruthProbability, UnrollFrames};

/// Most samples per optimiser step. That they fit into memory is checked with the data.
const MOST_SAMPLES: u64 = 65_536;
/// Most predictions in a row.
const MOST_IN_A_ROW: u64 = 1_000_000;

/// Most samples that statistics are taken from.
const MOST_STATISTICS_SAMPLES: u64 = 1_000_000;
/// Most steps between two lines of the log, which are kept until then.
const MOST_LOG_EVERY: u64 = 100_000;

/// All settings that decide a training, besides its data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Name for people.
    pub name: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Optimiser steps in all.
    pub steps: u64,
    /// The network.
    pub model: ModelSpec,
    /// Weights of the loss terms.
    #[serde(default)]
    pub losses: LossWeights,
    /// Settings of the optimiser.
    #[serde(default)]
    pub optimizer: AdamSettings,
    /// The learning rate.
    pub learning_rate: LearningRate,
    /// The largest Euclidean norm of the batch's mean gradient; a longer one is shortened to it.
    /// Without this key no gradient is shortened.
    #[serde(default)]
    pub gradient_clip: Option<f64>,
    /// A sample whose loss L is above this counts with the weight `loss_cap`/L, so that one
    /// prediction gone astray does not drown the rest of its batch. Without this key all count
    /// alike.
    #[serde(default)]
    pub loss_cap: Option<f64>,
    /// The part that a step leaves of the running mean of the weights (an exponential moving
    /// average); the model is then made of this mean. Less while there are few steps: (1 + n)/(10 +
    /// n) after n of them. Without this key the model is made of the weights.
    #[serde(default)]
    pub weight_average: Option<f64>,
    /// Probability that a value between the recurrent layers is dropped; 0 where there are none.
    #[serde(default)]
    pub dropout: f64,
    /// Samples of a step.
    pub batch: BatchConfig,
    /// Noise on ground truth.
    #[serde(default)]
    pub noise: NoiseConfig,
    /// Learning from the model's own predictions.
    #[serde(default)]
    pub scheduled_sampling: ScheduledSampling,
    /// Frames of a rollout that a step learns through.
    #[serde(default)]
    pub unroll: UnrollFrames,
    /// Samples of a data set from which the statistics of inputs and targets are taken before the
    /// first step.
    pub statistics_samples: usize,
    /// Steps from one line of the log to the next.
    pub log_every: u64,
}

/// Samples of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatchConfig {
    /// Samples per optimiser step.
    pub samples: usize,
}

/// Noise on ground truth (GNS, Sanchez-Gonzalez et al. 2020): n is added to the newest positions
/// of free vertices, (1 - γ) n to the target; none on the model's own predictions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseConfig {
    /// Standard deviation per coordinate.
    pub deviation: f64,
    /// Unit of the deviation.
    pub unit: NoiseUnit,
    /// γ: the part of a displacement that the target takes back in one frame.
    pub correction: f64,
}

/// Unit of a deviation of noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseUnit {
    /// Metres.
    #[default]
    Metre,
}

/// Scheduled sampling: with probability 1 - p the model's own prediction becomes the current
/// position of the next sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScheduledSampling {
    /// p by step.
    pub truth: TruthProbability,
    /// Predictions in a row, at most, before an unrolling begins; one that has begun goes to its
    /// end.
    pub longest: u32,
    /// A run ends when a vertex is farther than this from its target `[m]`: from the recorded
    /// motion, or from what the expert labels a rollout with.
    pub farthest: f64,
    /// Where the targets of the model's own states come from.
    #[serde(default)]
    pub labels: Labels,
    /// The part of the distance to the truth that the target takes back in one frame: 1 aims at
    /// the truth itself, as in the paper; less aims at the motion of the truth, shifted.
    pub correction: f64,
}

/// Targets of states that are off the recorded motion: those that the model has led to, and those
/// with noise on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Labels {
    /// The recorded motion, less a part of the distance to it (`correction`), as in the paper.
    #[default]
    Recorded,
    /// What the physics of the data set makes of the state ([`crate::Expert`]).
    Expert,
}

impl Default for NoiseConfig {
    /// The paper's.
    fn default() -> Self {
        Self {
            deviation: 0.003,
            unit: NoiseUnit::Metre,
            correction: 0.1,
        }
    }
}

impl Default for ScheduledSampling {
    /// None; the rest as in the paper.
    fn default() -> Self {
        Self {
            truth: TruthProbability::Always {},
            longest: 30,
            farthest: 1e3,
            labels: Labels::default(),
            correction: 1.0,
        }
    }
}

impl TrainConfig {
    /// True where the physics labels the model's own states.
    pub(crate) fn asks_expert(&self) -> bool {
        self.scheduled_sampling.labels == Labels::Expert
    }

    /// Reads and checks the TOML text of a configuration; errors name it `path`.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        Self::parse_with(text, path, &[])
    }

    /// The same with some of its values changed, later ones after earlier ones.
    pub fn parse_with(text: &str, path: &Path, settings: &[Setting]) -> Result<Self, ConfigError> {
        let named =
            |error: &dyn std::fmt::Display| ConfigError(format!("{}: {error}", path.display()));
        // Read as it is first, so that a defect of the text has its line.
        let cfg: Self = toml::from_str(text).map_err(|error| named(&error))?;
        let cfg = setting::changed(cfg, text, settings).map_err(|error| {
            let settings = setting::list(settings);
            ConfigError(format!("{} with {settings}: {error}", path.display()))
        })?;
        cfg.validate().map_err(|error| named(&error))?;
        Ok(cfg)
    }

    /// Checks every value.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.model.validate()?;
        self.losses.validate()?;
        self.optimizer.validate()?;
        self.learning_rate.validate()?;
        count("steps", self.steps, MOST_STEPS)?;
        count("log_every", self.log_every, MOST_LOG_EVERY)?;
        if let Some(limit) = self.gradient_clip {
            positive("gradient_clip", limit)?;
        }
        if let Some(cap) = self.loss_cap {
            positive("loss_cap", cap)?;
        }
        if let Some(part) = self.weight_average {
            below_one("weight_average", part)?;
        }
        count("batch.samples", self.batch.samples as u64, MOST_SAMPLES)?;
        let statistics = self.statistics_samples as u64;
        count("statistics_samples", statistics, MOST_STATISTICS_SAMPLES)?;
        below_one("dropout", self.dropout)?;
        let recurrent = self.model.encoder.is_recurrent();
        let expected = "0 where model.encoder is no gru: it acts between recurrent layers";
        let has_place = recurrent || self.dropout == 0.0;
        require(has_place, "dropout", expected, self.dropout)?;
        below_one("noise.deviation", self.noise.deviation)?;
        part("noise.correction", self.noise.correction)?;
        let sampling = &self.scheduled_sampling;
        sampling.truth.validate()?;
        let longest = sampling.longest.into();
        count("scheduled_sampling.longest", longest, MOST_IN_A_ROW)?;
        positive("scheduled_sampling.farthest", sampling.farthest)?;
        part("scheduled_sampling.correction", sampling.correction)?;
        self.unroll.validate()?;
        // A kinetic energy depends on the positions before it, too: the way back leaves that out.
        let weight = self.losses.kinetic_energy;
        let expected = "0 where unroll.frames is above 1";
        let apart = self.unroll.most() == 1 || weight == 0.0;
        require(apart, "losses.kinetic_energy", expected, weight)
    }
}

#[cfg(test)]
mod tests;
