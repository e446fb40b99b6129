//! Targets of the frames of a rollout.
//!
//! *Recorded*: the recorded motion plus what is left of the offset e that the rollout began with,
//! (1 - γ)ᵏ e after k frames, in the local axes of each frame. With γ = 1, as in the paper, a frame
//! has to end the whole offset.
//!
//! *Labels*: what the physics makes of the state that the rollout began with ([`crate::Expert`]).

use glam::DVec3;
use selvedge_model::Yaw;

use crate::config::TrainConfig;
use crate::slot::{ShownSample, Slot};
use crate::training_set::TrainingSet;

/// The targets of one rollout, frame by frame.
pub(crate) enum RolloutTarget {
    Recorded {
        /// The rest of the offset, in local axes `[m]`, `[vertices]`.
        offset: Vec<DVec3>,
        /// 1 - γ.
        kept: f64,
    },
    Labels {
        /// World positions `[m]`, `[frames, vertices]`.
        frames: Vec<Vec<DVec3>>,
        /// How many of them were shown.
        shown: usize,
    },
}

impl RolloutTarget {
    /// Recorded targets of a rollout that starts at the sample of `slot`, in the local frame `yaw`.
    pub(crate) fn recorded(cfg: &TrainConfig, set: &TrainingSet, slot: &Slot, yaw: Yaw) -> Self {
        Self::Recorded {
            offset: slot.offset(set, yaw),
            kept: 1.0 - slot.correction(cfg),
        }
    }

    /// Targets that the physics gave, world positions `[m]`, `[frames, vertices]`.
    pub(crate) fn labels(frames: Vec<Vec<DVec3>>) -> Self {
        Self::Labels { frames, shown: 0 }
    }

    /// Makes the next of them the target of `sample`, which `slot` shows.
    pub(crate) fn show_next(&mut self, set: &TrainingSet, slot: &Slot, sample: &mut ShownSample) {
        match self {
            Self::Recorded { offset, kept } => {
                offset.iter_mut().for_each(|e| *e *= *kept);
                slot.show_shifted(set, offset, sample);
            }
            Self::Labels { frames, shown } => {
                slot.show_label(set, &frames[*shown], sample);
                *shown += 1;
            }
        }
    }

    /// The label that is shown; none of recorded targets, and none before the first frame.
    pub(crate) fn label(&self) -> Option<&[DVec3]> {
        match self {
            Self::Recorded { .. } => None,
            Self::Labels { frames, shown } => Some(&frames[shown.checked_sub(1)?]),
        }
    }
}

#[cfg(test)]
mod tests;
