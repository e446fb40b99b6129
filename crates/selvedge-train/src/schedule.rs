//! Schedules of a training as functions of the optimiser's step: the learning rate, the probability
//! of ground truth (scheduled sampling, Bengio et al. 2015; paper §5.4) and the frames of a
//! rollout.
//!
//! Closed forms of the step alone, so that a resumed training continues exactly.

use serde::{Deserialize, Serialize};

use crate::bounds::{ConfigError, count, part, positive, require};

/// Most steps of a training, and the last step at which something may change.
pub(crate) const MOST_STEPS: u64 = 1_000_000_000;

/// The learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LearningRate {
    /// The same throughout.
    Constant {
        /// The rate.
        rate: f64,
    },
    /// One drop, as in the paper's released training.
    Drop {
        /// The rate before.
        from: f64,
        /// The rate after.
        to: f64,
        /// The first step after the drop.
        at: u64,
    },
    /// A linear rise, then half a cosine down.
    Cosine {
        /// Steps of the rise.
        warmup: u64,
        /// The highest rate.
        from: f64,
        /// The rate at `end` and after.
        to: f64,
        /// The step at which the decay ends.
        end: u64,
    },
}

/// The probability that the next sample uses ground truth, p in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum TruthProbability {
    /// Always ground truth: p = 1.
    Always {},
    /// p = 1, then linearly down, then constant.
    Linear {
        /// The last step with p = 1.
        start: u64,
        /// The first step with p = `probability`.
        end: u64,
        /// The probability from `end` on.
        probability: f64,
    },
}

/// Frames of a rollout that the gradient goes back through: 1 learns from single predictions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum UnrollFrames {
    /// The same number throughout.
    Constant {
        /// The number.
        frames: usize,
    },
    /// 1, then linearly up, then constant.
    Growing {
        /// The last step with 1.
        start: u64,
        /// The first step with `frames`.
        end: u64,
        /// The number from `end` on.
        frames: usize,
    },
}

impl Default for UnrollFrames {
    /// Single predictions, as in the paper.
    fn default() -> Self {
        Self::Constant { frames: 1 }
    }
}

impl UnrollFrames {
    /// Checks the number and the order of steps.
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        count("unroll.frames", self.most() as u64, 1000)?;
        match *self {
            Self::Growing { start, end, .. } => {
                let expected = format!("after start = {start}");
                require(end > start, "unroll.end", expected, end)?;
                within_training("unroll.end", end)
            }
            Self::Constant { .. } => Ok(()),
        }
    }

    /// The largest number.
    pub fn most(&self) -> usize {
        match *self {
            Self::Constant { frames } | Self::Growing { frames, .. } => frames,
        }
    }

    /// The number of step `step`, counted from 0; growing from `start` to `end` it is
    /// 1 + ⌊(frames - 1) (step - start) / (end - start)⌋.
    pub fn at(&self, step: u64) -> usize {
        match *self {
            Self::Constant { frames } => frames,
            Self::Growing { start, end, frames } => {
                let gone = step.clamp(start, end) - start;
                1 + ((frames as u64 - 1) * gone / (end - start)) as usize
            }
        }
    }
}

impl LearningRate {
    /// Checks rates and the order of steps.
    pub fn validate(&self) -> Result<(), ConfigError> {
        match *self {
            Self::Constant { rate } => positive("learning_rate.rate", rate),
            Self::Drop { from, to, at } => positive("learning_rate.from", from)
                .and(positive("learning_rate.to", to))
                .and(within_training("learning_rate.at", at)),
            Self::Cosine {
                warmup,
                from,
                to,
                end,
            } => {
                positive("learning_rate.from", from)?;
                let below = (0.0..=from).contains(&to);
                let expected = format!("between 0 and {from}");
                require(below, "learning_rate.to", expected, to)?;
                let expected = format!("after the warm-up of {warmup} steps");
                require(end > warmup, "learning_rate.end", expected, end)?;
                within_training("learning_rate.end", end)
            }
        }
    }

    /// The rate of step `step`, counted from 0 `[eq:learning-rate]`. Cosine: for `step` < warmup
    /// from (step + 1) / (warmup + 1); then
    /// to + (from - to) (1 + cos(π (step - warmup) / (end - warmup))) / 2; from `end` on, to.
    pub fn at(&self, step: u64) -> f64 {
        match *self {
            Self::Constant { rate } => rate,
            Self::Drop { from, to, at } => {
                if step < at {
                    from
                } else {
                    to
                }
            }
            Self::Cosine { warmup, from, .. } if step < warmup => {
                from * (step + 1) as f64 / (warmup + 1) as f64
            }
            Self::Cosine {
                warmup,
                from,
                to,
                end,
            } => {
                let angle = std::f64::consts::PI * progress(step, warmup, end);
                to + (from - to) * 0.5 * (1.0 + angle.cos())
            }
        }
    }
}

impl TruthProbability {
    /// Checks the probability and the order of steps.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let Self::Linear {
            start,
            end,
            probability,
        } = *self
        else {
            return Ok(());
        };
        part("scheduled_sampling.truth.probability", probability)?;
        let (field, expected) = (
            "scheduled_sampling.truth.end",
            format!("after its start {start}"),
        );
        require(end > start, field, expected, end)?;
        within_training(field, end)
    }

    /// The probability at step `step`, counted from 0 `[eq:scheduled-sampling]`:
    /// 1 - (1 - probability) clamp((step - start) / (end - start), 0, 1).
    pub fn at(&self, step: u64) -> f64 {
        match *self {
            Self::Always {} => 1.0,
            Self::Linear {
                start,
                end,
                probability,
            } => 1.0 - (1.0 - probability) * progress(step, start, end),
        }
    }
}

/// Progress of `step` from `start` to `end`, in [0, 1]; 1 where both are the same.
fn progress(step: u64, start: u64, end: u64) -> f64 {
    if step >= end {
        return 1.0;
    }
    step.saturating_sub(start) as f64 / end.saturating_sub(start) as f64
}

fn within_training(field: &str, step: u64) -> Result<(), ConfigError> {
    require(
        step <= MOST_STEPS,
        field,
        format!("at most {MOST_STEPS}"),
        step,
    )
}

#[cfg(test)]
mod tests;
