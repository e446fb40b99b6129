//! Targets of a rollout that starts off the truth: the truth, shifted by the rest of the offset.
//!
//! *Decaying*: (1 - γ)^k S e after k frames, with S e the offset smoothed over a few edges,
//! whatever the velocity. The first frame has to end a difference of velocities, and wrinkles, at
//! once, which no cloth can.
//!
//! *Swinging* `[eq:swinging-offset]`: the motion of a cloth that hangs aside. The smooth part of
//! the offset swings about the truth as a damped pendulum: u = S(e⁰ - e⁻¹) at first, then u ← (1 -
//! d) u - s e and e ← e + u. The rest, wrinkles in other places, decays by w a frame.
//!
//! Offsets are in the local axes of the frame that they were seen in and turn with the handles.

use glam::DVec3;
use selvedge_model::{ClothGraph, Yaw};

use crate::config::{OffsetRule, TrainConfig};
use crate::slot::Slot;
use crate::training_set::TrainingSet;

/// Means over neighbours that take the wrinkles out of an offset.
const SMOOTHINGS: usize = 16;

/// The offset of one rollout, frame by frame, in local axes `[m]`, `[vertices]`.
pub(crate) struct RolloutTarget {
    rule: Rule,
    /// The rest k frames after the start.
    now: Vec<DVec3>,
}

enum Rule {
    Decaying {
        start: Vec<DVec3>,
        kept: f64,
        frames: i32,
    },
    Swinging {
        damping: f64,
        stiffness: f64,
        kept: f64,
        smooth: Vec<DVec3>,
        velocity: Vec<DVec3>,
        wrinkles: Vec<DVec3>,
    },
}

impl RolloutTarget {
    /// The targets of a rollout that starts at the sample of `slot`, in the local frame `yaw`.
    pub(crate) fn of_slot(cfg: &TrainConfig, set: &TrainingSet, slot: &Slot, yaw: Yaw) -> Self {
        let correction = slot.correction(cfg);
        let graph = &*set.motion(slot.section.trajectory).graph;
        let offset = slot.offset(set, yaw);
        let mut smooth = offset.clone();
        smoothen(graph, &mut smooth);
        let rule = match cfg.scheduled_sampling.offset {
            OffsetRule::Decaying {} => Rule::Decaying {
                start: smooth,
                kept: 1.0 - correction,
                frames: 0,
            },
            OffsetRule::Swinging {
                damping,
                stiffness,
                wrinkles,
            } => {
                let mut velocity = slot.offset_velocity(set, yaw);
                smoothen(graph, &mut velocity);
                let apart = offset.iter().zip(&smooth);
                Rule::Swinging {
                    damping,
                    stiffness,
                    kept: 1.0 - wrinkles,
                    wrinkles: apart.map(|(all, smooth)| *all - *smooth).collect(),
                    smooth,
                    velocity,
                }
            }
        };
        Self { rule, now: offset }
    }

    /// The rest of the offset one frame later.
    pub(crate) fn next_offset(&mut self) -> &[DVec3] {
        match &mut self.rule {
            Rule::Decaying {
                start,
                kept,
                frames,
            } => {
                *frames += 1;
                let part = kept.powi(*frames);
                let rows = self.now.iter_mut().zip(start);
                rows.for_each(|(now, start)| *now = part * *start);
            }
            Rule::Swinging {
                damping,
                stiffness,
                kept,
                smooth,
                velocity,
                wrinkles,
            } => {
                let rows = smooth.iter_mut().zip(velocity).zip(wrinkles);
                for (now, ((e, u), w)) in self.now.iter_mut().zip(rows) {
                    *u = (1.0 - *damping) * *u - *stiffness * *e;
                    *e += *u;
                    *w *= *kept;
                    *now = *e + *w;
                }
            }
        }
        &self.now
    }
}

/// Replaces every free vertex's row by the mean of its own and its neighbours', [`SMOOTHINGS`]
/// times: what varies over fewer edges than the root of that is gone. Handles are where they should
/// be.
fn smoothen(graph: &ClothGraph, offset: &mut Vec<DVec3>) {
    for _ in 0..SMOOTHINGS {
        let mut sums: Vec<(DVec3, f64)> = offset.iter().map(|&e| (e, 1.0)).collect();
        for (&sender, &receiver) in graph.senders().iter().zip(graph.receivers()) {
            let (sum, count) = &mut sums[receiver as usize];
            *sum += offset[sender as usize];
            *count += 1.0;
        }
        offset.clear();
        offset.extend(sums.iter().map(|(sum, count)| *sum / *count));
        for v in graph.handles().vertices() {
            offset[v.index()] = DVec3::ZERO;
        }
    }
}

#[cfg(test)]
mod tests;
