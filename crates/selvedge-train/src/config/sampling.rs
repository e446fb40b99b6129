//! The part of a configuration that puts samples together: the batch, the noise, and the model's
//! own predictions.

use serde::{Deserialize, Serialize};

use super::error::{InvalidConfig, count, part, positive, require};
use crate::schedule::TruthProbability;

/// Most samples per optimiser step. That they fit into memory is checked with the data.
const MOST_SAMPLES: usize = 65_536;
/// Most predictions in a row.
const MOST_IN_A_ROW: u32 = 1_000_000;

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

impl BatchConfig {
    pub(super) fn validate(&self) -> Result<(), InvalidConfig> {
        count("batch.samples", self.samples as u64, MOST_SAMPLES as u64)
    }
}

impl NoiseConfig {
    pub(super) fn validate(&self) -> Result<(), InvalidConfig> {
        let small = (0.0..1.0).contains(&self.deviation);
        let expected = "at least 0 and below 1";
        require(small, "noise.deviation", expected, self.deviation)?;
        part("noise.correction", self.correction)
    }
}

impl ScheduledSampling {
    pub(super) fn validate(&self) -> Result<(), InvalidConfig> {
        self.truth.validate()?;
        let (longest, most) = (self.longest.into(), MOST_IN_A_ROW.into());
        count("scheduled_sampling.longest", longest, most)?;
        positive("scheduled_sampling.farthest", self.farthest)?;
        part("scheduled_sampling.correction", self.correction)?;
        Ok(())
    }
}
