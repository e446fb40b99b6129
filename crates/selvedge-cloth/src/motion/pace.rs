//! Pace of a part of a block: a distance with an eased position, or a profile of
//! speeds.
//!
//! In TOML a pace is `{ distance = 1.0 }` or `{ start = 0.0, end = 0.02, profile = "smooth" }`.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::bounds::split_place;
use crate::error::{SceneError, require};
use crate::geometry::sin_cos;

/// Distance or speed of a part of a block.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, try_from = "PaceFields")]
pub enum Pace {
    /// A distance, covered with s(t) = (1 - cos(π t/T))/2.
    Distance {
        /// Distance covered over the block `[m]`.
        distance: f64,
    },
    /// A speed profile, sampled at t = 1/60, 2/60, … T.
    Speed {
        /// Speed at the start `[m/frame]`.
        start: f64,
        /// Speed at the end `[m/frame]`.
        end: f64,
        /// Passage from one speed to the other.
        profile: Profile,
    },
}

/// Passage of a speed from `start` to `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// In proportion to time.
    Linear,
    /// start + (end - start)(1 - cos(π t/T))/2.
    Smooth,
}

/// [`Pace`] as it is written: an untagged enum would not say which key is unknown.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PaceFields {
    distance: Option<f64>,
    start: Option<f64>,
    end: Option<f64>,
    profile: Option<Profile>,
}

impl TryFrom<PaceFields> for Pace {
    type Error = String;

    fn try_from(fields: PaceFields) -> Result<Self, String> {
        let PaceFields {
            distance,
            start,
            end,
            profile,
        } = fields;
        let missing = match (distance, start, end, profile) {
            (Some(distance), None, None, None) => return Ok(Self::Distance { distance }),
            (None, Some(start), Some(end), Some(profile)) => {
                return Ok(Self::Speed {
                    start,
                    end,
                    profile,
                });
            }
            (Some(_), ..) => {
                return Err(
                    "give either `distance`, or `start`, `end` and `profile`, not both".to_owned(),
                );
            }
            (_, None, None, None) => {
                return Err("a pace needs `distance`, or `start`, `end` and `profile`".to_owned());
            }
            (_, None, ..) => "start",
            (_, _, None, _) => "end",
            _ => "profile",
        };
        Err(format!(
            "a speed needs `start`, `end` and `profile`: `{missing}` is missing"
        ))
    }
}

impl Pace {
    /// Returns true when nothing moves.
    pub(super) fn is_zero(&self) -> bool {
        match *self {
            Self::Distance { distance } => distance == 0.0,
            Self::Speed { start, end, .. } => start == 0.0 && end == 0.0,
        }
    }

    /// The pace `factor` times as far and as fast.
    pub(super) fn times(self, factor: f64) -> Self {
        match self {
            Self::Distance { distance } => Self::Distance {
                distance: factor * distance,
            },
            Self::Speed {
                start,
                end,
                profile,
            } => Self::Speed {
                start: factor * start,
                end: factor * end,
                profile,
            },
        }
    }

    /// The distance covered at any time of a block of `frames` frames of 1/60 s.
    pub(super) fn progress(&self, field: &str, frames: usize) -> Result<Progress, SceneError> {
        let finite = |key: &str, value: f64| {
            require(value.is_finite(), format!("{field}.{key}"), "finite", value)
        };
        match *self {
            Self::Distance { distance } => {
                finite("distance", distance)?;
                Ok(Progress::Eased { distance, frames })
            }
            Self::Speed {
                start,
                end,
                profile,
            } => {
                finite("start", start)?;
                finite("end", end)?;
                let mut sums = vec![0.0];
                let mut sum = 0.0;
                for frame in 1..=frames {
                    let place = frame as f64 / frames as f64;
                    let share = match profile {
                        Profile::Linear => place,
                        Profile::Smooth => eased(place),
                    };
                    sum += start + (end - start) * share;
                    sums.push(sum);
                }
                Ok(Progress::Summed { sums })
            }
        }
    }
}

/// The distance covered as a function of the frame of a block.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Progress {
    /// distance · (1 - cos(π k/frames))/2.
    Eased { distance: f64, frames: usize },
    /// The sum of the speeds of the first k frames, `[frames + 1]`; linear between frames.
    Summed { sums: Vec<f64> },
}

impl Progress {
    /// Distance covered `[m]` after `place` frames of 1/60 s since the start of the block.
    pub(super) fn at(&self, place: f64) -> f64 {
        match self {
            Self::Eased { distance, frames } => distance * eased(place / *frames as f64),
            Self::Summed { sums } => {
                let (before, fraction) = split_place(place, sums.len() - 1);
                if fraction == 0.0 {
                    return sums[before];
                }
                sums[before] + (sums[before + 1] - sums[before]) * fraction
            }
        }
    }
}

/// (1 - cos(π s))/2: from 0 to 1 with no speed at either end. `[eq:ease]`
fn eased(s: f64) -> f64 {
    let (_, cosine) = sin_cos(PI * s.clamp(0.0, 1.0));
    (1.0 - cosine) / 2.0
}
