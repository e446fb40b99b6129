//! The configuration of a training: a TOML file, checked once, saved beside the result.

mod setting;

use std::path::{Path, PathBuf};

use selvedge_model::{Encoder, ModelSpec, SpecError};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::losses::{LossWeights, LossWeightsError};
use crate::optimizer::{AdamError, AdamSettings};
use crate::schedule::{LearningRate, MOST_STEPS, ScheduleError, TruthProbability, UnrollFrames};
pub use setting::{Setting, SettingError};

/// Most samples per optimiser step. That they fit into memory is checked with the data.
const MOST_SAMPLES: usize = 65_536;
/// Most samples that statistics are taken from.
const MOST_STATISTICS_SAMPLES: usize = 1_000_000;
/// Most steps between two lines of the log, which are kept until then.
const MOST_LOG_EVERY: u64 = 100_000;
/// Most predictions in a row.
const MOST_IN_A_ROW: u32 = 1_000_000;

/// All settings that decide a training, besides its data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Name for people.
    pub name: String,
    /// Decides every random number.
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
    /// Without this key nothing is.
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
    /// Learn from the mirror image of every trajectory as well.
    #[serde(default)]
    pub mirror_images: bool,
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
    /// Samples from which the statistics of inputs and targets are taken before the first step.
    pub statistics_samples: usize,
    /// A line of the log every so many steps.
    pub log_every: u64,
}

/// Samples of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "BatchTable")]
pub struct BatchConfig {
    /// Samples per optimiser step.
    pub samples: usize,
}

/// The table `[batch]` as files have it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BatchTable {
    samples: usize,
    /// A key of earlier versions: how many samples went through the network together. That is a
    /// setting of the engine now ([`crate::OnProcessor`]) and changes results by rounding only, so
    /// files with the key stay readable.
    #[serde(default, rename = "shard")]
    _shard: Option<IgnoredAny>,
}

impl From<BatchTable> for BatchConfig {
    fn from(table: BatchTable) -> Self {
        Self {
            samples: table.samples,
        }
    }
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
    /// The mean length of the cloth's edges at rest: the same for every fineness of the mesh.
    Edge,
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
    /// A run ends when a vertex is farther from the truth than this `[m]`.
    pub farthest: f64,
    /// The part of the distance to the truth that the target takes back in one frame: 1 aims at
    /// the truth itself, as in the paper; less aims at the motion of the truth, shifted.
    pub correction: f64,
    /// Course of that distance in the targets of several frames in a row.
    pub offset: OffsetRule,
}

/// The course of an offset from the truth in the targets of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum OffsetRule {
    /// A part of its smooth part is taken back every frame (`correction`).
    Decaying {},
    /// It swings about the truth.
    Swinging {
        /// Part of its velocity that is lost per frame, d.
        damping: f64,
        /// Part of the way back that is gone per frame squared, s.
        stiffness: f64,
        /// Part of its wrinkles that is lost per frame, w.
        wrinkles: f64,
    },
}

impl Default for OffsetRule {
    fn default() -> Self {
        Self::Decaying {}
    }
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
            correction: 1.0,
            offset: OffsetRule::default(),
        }
    }
}

/// A configuration that cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ConfigError {
    #[error("cannot read {path}: {source}")]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {source}")]
    Syntax {
        path: PathBuf,
        source: Box<toml::de::Error>,
    },
    #[error("{path}: {source}")]
    Invalid {
        path: PathBuf,
        source: InvalidConfig,
    },
    #[error("{path} with {settings}: {source}")]
    Setting {
        path: PathBuf,
        settings: String,
        source: SettingError,
    },
}

/// A value of a configuration that cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message is its source's")]
pub enum InvalidConfig {
    #[error(transparent)]
    Model(#[from] SpecError),
    #[error(transparent)]
    Losses(#[from] LossWeightsError),
    #[error(transparent)]
    Optimizer(#[from] AdamError),
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    #[error("{field} must be between 1 and {most}, found {found}")]
    Count {
        field: &'static str,
        most: u64,
        found: u64,
    },
    #[error("{field} must be {expected}, found {found}")]
    Value {
        field: &'static str,
        expected: &'static str,
        found: f64,
    },
}

impl TrainConfig {
    /// Reads and checks the TOML file at `path`.
    ///
    /// # Errors
    /// [`ConfigError`] names the file and the field.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::read_with(path, &[])
    }

    /// The same with some of its values changed, later ones after earlier ones.
    ///
    /// # Errors
    /// [`ConfigError`] names the file, the field, and the changes where one of them does not fit.
    pub fn read_with(path: &Path, settings: &[Setting]) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse_with(&text, path, settings)
    }

    /// Checks the TOML text of a configuration that people know as `path`.
    ///
    /// # Errors
    /// [`ConfigError`] names the file and the field.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        Self::parse_with(text, path, &[])
    }

    /// The same with some of its values changed, later ones after earlier ones.
    ///
    /// # Errors
    /// [`ConfigError`] names the file, the field, and the changes where one of them does not fit.
    pub fn parse_with(text: &str, path: &Path, settings: &[Setting]) -> Result<Self, ConfigError> {
        let path = path.to_owned();
        // Read as it is first, so that a defect of the text has its line.
        let read: Result<Self, toml::de::Error> = toml::from_str(text);
        let cfg = match read {
            Ok(cfg) => cfg,
            Err(source) => {
                let source = Box::new(source);
                return Err(ConfigError::Syntax { path, source });
            }
        };
        let cfg = match setting::changed(cfg, text, settings) {
            Ok(cfg) => cfg,
            Err(source) => {
                let settings = setting::list(settings);
                return Err(ConfigError::Setting {
                    path,
                    settings,
                    source,
                });
            }
        };
        match cfg.validate() {
            Ok(()) => Ok(cfg),
            Err(source) => Err(ConfigError::Invalid { path, source }),
        }
    }

    /// The whole course of this training in `steps` steps: its schedules shrunk or stretched in
    /// proportion, to the nearest step.
    ///
    /// # Errors
    /// [`InvalidConfig`] where so few steps leave no room between two that have to follow each
    /// other, or so many are too many.
    pub fn scaled_to(&self, steps: u64) -> Result<Self, InvalidConfig> {
        let mut cfg = self.clone();
        let mut changes = cfg.learning_rate.steps();
        changes.extend(cfg.scheduled_sampling.truth.steps());
        changes.extend(cfg.unroll.steps());
        for step in changes {
            let exact = u128::from(*step) * u128::from(steps);
            let of = u128::from(self.steps.max(1));
            *step = u64::try_from((exact + of / 2) / of).unwrap_or(u64::MAX);
        }
        cfg.steps = steps;
        cfg.validate()?;
        Ok(cfg)
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`InvalidConfig`] names the field.
    pub fn validate(&self) -> Result<(), InvalidConfig> {
        self.model.validate()?;
        self.losses.validate()?;
        self.optimizer.validate()?;
        self.learning_rate.validate()?;
        count("steps", self.steps, MOST_STEPS)?;
        let (statistics, most) = (self.statistics_samples, MOST_STATISTICS_SAMPLES);
        count("statistics_samples", statistics as u64, most as u64)?;
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
        let kept = (0.0..1.0).contains(&self.dropout);
        let expected = "at least 0 and below 1";
        require(kept, "dropout", expected, self.dropout)?;
        let recurrent = !matches!(self.model.encoder, Encoder::Mlp { .. });
        let expected = "0 where model.encoder is no gru: it acts between recurrent layers";
        let has_place = recurrent || self.dropout == 0.0;
        require(has_place, "dropout", expected, self.dropout)?;
        self.batch.validate()?;
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

impl BatchConfig {
    fn validate(&self) -> Result<(), InvalidConfig> {
        count("batch.samples", self.samples as u64, MOST_SAMPLES as u64)
    }
}

impl NoiseConfig {
    fn validate(&self) -> Result<(), InvalidConfig> {
        let small = (0.0..1.0).contains(&self.deviation);
        let expected = "at least 0 and below 1 (noise.unit: metre or edge)";
        require(small, "noise.deviation", expected, self.deviation)?;
        part("noise.correction", self.correction)
    }
}

impl ScheduledSampling {
    fn validate(&self) -> Result<(), InvalidConfig> {
        self.truth.validate()?;
        let (longest, most) = (self.longest.into(), MOST_IN_A_ROW.into());
        count("scheduled_sampling.longest", longest, most)?;
        positive("scheduled_sampling.farthest", self.farthest)?;
        part("scheduled_sampling.correction", self.correction)?;
        if let OffsetRule::Swinging {
            damping,
            stiffness,
            wrinkles,
        } = self.offset
        {
            part("scheduled_sampling.offset.damping", damping)?;
            part("scheduled_sampling.offset.stiffness", stiffness)?;
            part("scheduled_sampling.offset.wrinkles", wrinkles)?;
        }
        Ok(())
    }
}

fn count(field: &'static str, found: u64, most: u64) -> Result<(), InvalidConfig> {
    if (1..=most).contains(&found) {
        return Ok(());
    }
    Err(InvalidConfig::Count { field, most, found })
}

fn positive(field: &'static str, found: f64) -> Result<(), InvalidConfig> {
    let holds = found.is_finite() && found > 0.0;
    require(holds, field, "finite and positive", found)
}

fn part(field: &'static str, found: f64) -> Result<(), InvalidConfig> {
    let holds = (0.0..=1.0).contains(&found);
    require(holds, field, "between 0 and 1", found)
}

fn require(
    holds: bool,
    field: &'static str,
    expected: &'static str,
    found: f64,
) -> Result<(), InvalidConfig> {
    if holds {
        return Ok(());
    }
    Err(InvalidConfig::Value {
        field,
        expected,
        found,
    })
}

#[cfg(test)]
mod tests;
