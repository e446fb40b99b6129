//! Targets of a rollout that starts off the truth: the truth, shifted by the rest of the offset:
//! (1 - γ)^k S e after k frames, with S e the offset smoothed over a few edges.
//!
//! Offsets are in the local axes of the frame that they were seen in and turn with the handles.

use glam::DVec3;
use selvedge_model::{ClothGraph, Yaw};

use crate::config::TrainConfig;
use crate::slot::Slot;
use crate::training_set::TrainingSet;

/// Means over neighbours that take the wrinkles out of an offset.
const SMOOTHINGS: usize = 16;

/// The offset of one rollout, frame by frame, in local axes `[m]`, `[vertices]`.
pub(crate) struct RolloutTarget {
    /// The smooth part of the offset at the start.
    start: Vec<DVec3>,
    /// The part of it that is left after a frame, 1 - γ.
    kept: f64,
    /// Frames since the start.
    frames: i32,
    /// The rest after so many frames.
    now: Vec<DVec3>,
}

impl RolloutTarget {
    /// The targets of a rollout that starts at the sample of `slot`, in the local frame `yaw`.
    pub(crate) fn of_slot(cfg: &TrainConfig, set: &TrainingSet, slot: &Slot, yaw: Yaw) -> Self {
        let graph = &*set.motion(slot.section.trajectory).graph;
        let mut start = slot.offset(set, yaw);
        smoothen(graph, &mut start);
        Self {
            now: start.clone(),
            start,
            kept: 1.0 - slot.correction(cfg),
            frames: 0,
        }
    }

    /// The rest of the offset one frame later.
    pub(crate) fn next_offset(&mut self) -> &[DVec3] {
        self.frames += 1;
        let part = self.kept.powi(self.frames);
        let rows = self.now.iter_mut().zip(&self.start);
        rows.for_each(|(now, start)| *now = part * *start);
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
