//! The configuration of a training: a TOML file, checked once, saved beside the result.

pub(crate) mod error;
mod sampling;
mod setting;

use std::path::Path;

use selvedge_model::ModelSpec;
use serde::{Deserialize, Serialize};

pub use self::error::{ConfigError, InvalidConfig, SettingError};
use self::error::{count, positive, require};
pub use self::sampling::{BatchConfig, Labels, NoiseConfig, NoiseUnit, ScheduledSampling};
pub use self::setting::Setting;
use crate::losses::LossWeights;
use crate::optimizer::AdamSettings;
use crate::schedule::{LearningRate, MOST_STEPS, UnrollFrames};

/// Most samples that statistics are taken from.
const MOST_STATISTICS_SAMPLES: usize = 1_000_000;
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
        let path = || path.to_owned();
        // Read as it is first, so that a defect of the text has its line.
        let cfg: Self = toml::from_str(text).map_err(|source| ConfigError::Syntax {
            path: path(),
            source: Box::new(source),
        })?;
        let cfg = setting::changed(cfg, text, settings).map_err(|source| ConfigError::Setting {
            path: path(),
            settings: setting::list(settings),
            source,
        })?;
        let checked = cfg.validate();
        checked.map_err(|source| ConfigError::Invalid {
            path: path(),
            source,
        })?;
        Ok(cfg)
    }

    /// Checks every value.
    pub fn validate(&self) -> Result<(), InvalidConfig> {
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
            let below = (0.0..1.0).contains(&part);
            require(below, "weight_average", "at least 0 and below 1", part)?;
        }
        self.batch.validate()?;
        let (statistics, most) = (self.statistics_samples, MOST_STATISTICS_SAMPLES);
        count("statistics_samples", statistics as u64, most as u64)?;
        let kept = (0.0..1.0).contains(&self.dropout);
        let expected = "at least 0 and below 1";
        require(kept, "dropout", expected, self.dropout)?;
        let recurrent = self.model.encoder.is_recurrent();
        let expected = "0 where model.encoder is no gru: it acts between recurrent layers";
        let has_place = recurrent || self.dropout == 0.0;
        require(has_place, "dropout", expected, self.dropout)?;
        self.noise.validate()?;
        self.scheduled_sampling.validate()?;
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
