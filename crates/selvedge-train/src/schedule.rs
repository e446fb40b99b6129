//! Schedules of a training as functions of the optimiser's step: the learning rate, the probability
//! of ground truth (scheduled sampling, Bengio et al. 2015; paper §5.4) and the frames of a
//! rollout.
//!
//! Closed forms of the step alone, so that a resumed training continues exactly.

use serde::{Deserialize, Serialize};
use thiserror::Error;

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
    ///
    /// # Errors
    /// Names the field.
    pub fn validate(&self) -> Result<(), ScheduleError> {
        let most = self.most();
        check((1..=1000).contains(&most), || {
            error("unroll", "frames", "between 1 and 1000", most)
        })?;
        match *self {
            Self::Growing { start, end, .. } => {
                check(end > start, || {
                    error("unroll", "end", format!("after start = {start}"), end)
                })?;
                within_training("unroll", "end", end)
            }
            Self::Constant { .. } => Ok(()),
        }
    }

    /// The steps at which something changes.
    pub(crate) fn steps(&mut self) -> Vec<&mut u64> {
        match self {
            Self::Constant { .. } => vec![],
            Self::Growing { start, end, .. } => vec![start, end],
        }
    }

    /// The largest number.
    #[must_use]
    pub fn most(&self) -> usize {
        match *self {
            Self::Constant { frames } | Self::Growing { frames, .. } => frames,
        }
    }

    /// The number of step `step`, counted from 0; growing from `start` to `end` it is
    /// 1 + ⌊(frames - 1) (step - start) / (end - start)⌋.
    #[must_use]
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

/// A schedule that cannot be followed.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{schedule}.{field} must be {expected}, found {found}")]
pub struct ScheduleError {
    schedule: &'static str,
    field: &'static str,
    expected: String,
    found: String,
}

impl LearningRate {
    /// Checks rates and the order of steps.
    ///
    /// # Errors
    /// Names the field.
    pub fn validate(&self) -> Result<(), ScheduleError> {
        let positive = |field, rate: f64| {
            check(rate.is_finite() && rate > 0.0, || {
                error("learning_rate", field, "finite and positive", rate)
            })
        };
        match *self {
            Self::Constant { rate } => positive("rate", rate),
            Self::Drop { from, to, at } => positive("from", from)
                .and(positive("to", to))
                .and(within_training("learning_rate", "at", at)),
            Self::Cosine {
                warmup,
                from,
                to,
                end,
            } => {
                positive("from", from)?;
                check(to.is_finite() && (0.0..=from).contains(&to), || {
                    error("learning_rate", "to", format!("between 0 and {from}"), to)
                })?;
                check(end > warmup, || {
                    let expected = format!("after the warm-up of {warmup} steps");
                    error("learning_rate", "end", expected, end)
                })?;
                within_training("learning_rate", "end", end)
            }
        }
    }

    /// The steps at which something changes.
    pub(crate) fn steps(&mut self) -> Vec<&mut u64> {
        match self {
            Self::Constant { .. } => vec![],
            Self::Drop { at, .. } => vec![at],
            Self::Cosine { warmup, end, .. } => vec![warmup, end],
        }
    }

    /// The rate of step `step`, counted from 0 `[eq:learning-rate]`. Cosine: for `step` < warmup
    /// from (step + 1) / (warmup + 1); then
    /// to + (from - to) (1 + cos(π (step - warmup) / (end - warmup))) / 2; from `end` on, to.
    #[must_use]
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
    ///
    /// # Errors
    /// Names the field.
    pub fn validate(&self) -> Result<(), ScheduleError> {
        let Self::Linear {
            start,
            end,
            probability,
        } = *self
        else {
            return Ok(());
        };
        check((0.0..=1.0).contains(&probability), || {
            error(
                "scheduled_sampling.truth",
                "probability",
                "between 0 and 1",
                probability,
            )
        })?;
        check(end > start, || {
            error(
                "scheduled_sampling.truth",
                "end",
                format!("after its start {start}"),
                end,
            )
        })?;
        within_training("scheduled_sampling.truth", "end", end)
    }

    /// The steps at which something changes.
    pub(crate) fn steps(&mut self) -> Vec<&mut u64> {
        match self {
            Self::Always {} => vec![],
            Self::Linear { start, end, .. } => vec![start, end],
        }
    }

    /// The probability at step `step`, counted from 0 `[eq:scheduled-sampling]`:
    /// 1 - (1 - probability) clamp((step - start) / (end - start), 0, 1).
    #[must_use]
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

fn within_training(
    schedule: &'static str,
    field: &'static str,
    step: u64,
) -> Result<(), ScheduleError> {
    check(step <= MOST_STEPS, || {
        error(schedule, field, format!("at most {MOST_STEPS}"), step)
    })
}

fn check(holds: bool, error: impl FnOnce() -> ScheduleError) -> Result<(), ScheduleError> {
    if holds { Ok(()) } else { Err(error()) }
}

fn error(
    schedule: &'static str,
    field: &'static str,
    expected: impl Into<String>,
    found: impl ToString,
) -> ScheduleError {
    ScheduleError {
        schedule,
        field,
        expected: expected.into(),
        found: found.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSINE: LearningRate = LearningRate::Cosine {
        warmup: 4,
        from: 1e-3,
        to: 1e-5,
        end: 104,
    };

    fn close(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() < 1e-15,
            "{found} instead of {expected}"
        );
    }

    #[test]
    fn constant_and_drop_are_what_they_say() {
        let drop = LearningRate::Drop {
            from: 1e-4,
            to: 1e-5,
            at: 100,
        };
        assert_eq!(
            [0, 99, 100, u64::MAX].map(|k| drop.at(k)),
            [1e-4, 1e-4, 1e-5, 1e-5]
        );
        assert_eq!(LearningRate::Constant { rate: 3e-4 }.at(7), 3e-4);
    }

    #[test]
    fn cosine_rises_linearly_and_falls_along_half_a_cosine() {
        for (step, expected) in [(0, 2e-4), (1, 4e-4), (3, 8e-4), (4, 1e-3)] {
            close(COSINE.at(step), expected);
        }
        // A third, half and two thirds of half a turn: cos = 1/2, 0, -1/2.
        let wide = LearningRate::Cosine {
            warmup: 0,
            from: 1.0,
            to: 0.0,
            end: 300,
        };
        for (step, expected) in [(0, 1.0), (100, 0.75), (150, 0.5), (200, 0.25), (300, 0.0)] {
            close(wide.at(step), expected);
        }
        assert_eq!([104, 1000].map(|k| COSINE.at(k)), [1e-5, 1e-5]);
        for step in 4..104 {
            assert!(COSINE.at(step + 1) < COSINE.at(step));
            // Half a turn away it is as far from the other end.
            close(COSINE.at(step) + COSINE.at(108 - step), 1e-3 + 1e-5);
        }
    }

    #[test]
    fn the_frames_of_a_rollout_grow_from_one_to_the_last_number() {
        let growing = UnrollFrames::Growing {
            start: 10,
            end: 50,
            frames: 5,
        };
        let steps = [0, 10, 19, 20, 29, 30, 40, 49, 50, u64::MAX];
        let expected = [1, 1, 1, 2, 2, 3, 4, 4, 5, 5];
        assert_eq!(steps.map(|step| growing.at(step)), expected);
        assert_eq!(UnrollFrames::default().at(7), 1);
        let refused = |frames: UnrollFrames| frames.validate().expect_err("a defect").to_string();
        let none = UnrollFrames::Constant { frames: 0 };
        assert!(refused(none).contains("unroll.frames must be between 1 and 1000, found 0"));
        let back = UnrollFrames::Growing {
            start: 5,
            end: 5,
            frames: 2,
        };
        assert!(refused(back).contains("unroll.end must be after start = 5, found 5"));
    }

    #[test]
    fn the_probability_of_ground_truth_falls_linearly() {
        let linear = TruthProbability::Linear {
            start: 75,
            end: 300,
            probability: 0.1,
        };
        for (step, expected) in [
            (0, 1.0),
            (75, 1.0),
            (120, 0.82),
            (210, 0.46),
            (300, 0.1),
            (900, 0.1),
        ] {
            close(linear.at(step), expected);
        }
        assert_eq!(TruthProbability::Always {}.at(10), 1.0);
    }

    #[test]
    fn schedules_that_make_no_sense_are_refused() {
        let cosine = |from, to, end| {
            let warmup = 10;
            let schedule = LearningRate::Cosine {
                warmup,
                from,
                to,
                end,
            };
            schedule.validate().expect_err("a defect").to_string()
        };
        assert_eq!(
            cosine(0.0, 0.0, 20),
            "learning_rate.from must be finite and positive, found 0"
        );
        assert_eq!(
            cosine(1.0, 2.0, 20),
            "learning_rate.to must be between 0 and 1, found 2"
        );
        assert!(cosine(1.0, 0.5, 10).contains("end must be after the warm-up of 10 steps"));
        assert!(
            LearningRate::Constant { rate: f64::NAN }
                .validate()
                .is_err()
        );
        let linear = |end, probability| {
            let start = 5;
            let schedule = TruthProbability::Linear {
                start,
                end,
                probability,
            };
            schedule.validate().expect_err("a defect").to_string()
        };
        assert!(linear(6, 1.5).starts_with("scheduled_sampling.truth.probability must be between"));
        assert!(linear(5, 0.5).contains("end must be after its start 5"));
        COSINE.validate().expect("a good one");
        TruthProbability::Always {}.validate().expect("a good one");
    }

    #[test]
    fn configuration_round_trips_and_unknown_keys_are_errors() {
        let text = toml::to_string(&COSINE).expect("plain");
        assert_eq!(
            toml::from_str::<LearningRate>(&text).expect("its own text"),
            COSINE
        );
        let unknown = [
            "kind = 'constant'\nrate = 1.0\nat = 3",
            "kind = 'cosin'\nrate = 1.0",
        ];
        assert!(
            unknown
                .iter()
                .all(|text| toml::from_str::<LearningRate>(text).is_err())
        );
        let always = toml::from_str::<TruthProbability>("kind = 'always'");
        assert_eq!(always.expect("no fields"), TruthProbability::Always {});
        assert!(toml::from_str::<TruthProbability>("kind = 'always'\nend = 3").is_err());
    }
}
