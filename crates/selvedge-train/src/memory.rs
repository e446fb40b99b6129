//! How much memory a training needs, reckoned before it is taken: what does not fit is an error that
//! names its causes, not a program that the system ends.
//!
//! Reckoned are the trajectories, the weights with their moments and the gradient of every shard, and
//! what every sample of a batch keeps on its way through the network; the rest is small. Where a device with
//! memory of its own does the arithmetic, that has the gradients of the shards and what is kept on the way, and
//! reckons for itself; here are the positions that go up, and copies of them for the transfer. What there
//! is, is what the system says: the machine's memory, that of the control group and the limit of the
//! address space (Linux), the least of them; [`FALLBACK`] where it says nothing.

use selvedge_data::{Dataset, Split};
use selvedge_model::{ClothGraph, Network, activations};
use thiserror::Error;

use crate::config::TrainConfig;
use crate::training_set::TrainingSet;

const GIB: f64 = (1_u64 << 30) as f64;
/// Taken for the machine's memory where the system does not say [bytes].
const FALLBACK: f64 = 64.0 * GIB;
/// Of a number, of a position in `f32` and in `f64` [bytes].
const NUMBER: f64 = 4.0;
const POSITION: f64 = 12.0;
const EXACT_POSITION: f64 = 24.0;

/// Where the arithmetic of a training is done, and with that whose memory it takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Arithmetic {
    /// By this machine's processor.
    #[default]
    OnProcessor,
    /// By a device with memory of its own, which [`crate::Trainer::run_on`] puts in before the first step.
    OnDevice,
}

/// A training that does not fit into memory.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "the training needs about {} of memory ({} for {samples} samples per step, {} for the weights and what goes with them, {} for the trajectories), but there are {}: lower batch.samples, unroll.frames, model.latent, model.blocks or the window, raise batch.shard, or take a smaller data set",
    gib(needed.sum()), gib(needed.slots), gib(needed.weights), gib(needed.trajectories), gib(*available)
)]
pub struct MemoryError {
    needed: Need,
    available: f64,
    samples: usize,
}

/// What a training needs, by what it is for [bytes].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Need {
    trajectories: f64,
    weights: f64,
    slots: f64,
}

impl Need {
    /// What can be said before the data are read.
    pub(crate) fn before_reading(
        cfg: &TrainConfig,
        network: &Network,
        dataset: &Dataset,
        on: Arithmetic,
    ) -> Self {
        let entries = dataset.entries(Split::Train).iter();
        let positions: f64 = entries.map(|e| e.frames as f64 * e.vertices as f64).sum();
        let images = if cfg.mirror_images { 2.0 } else { 1.0 };
        // Weights, their mean, their gradient and two moments, and three where a checkpoint is written; on the
        // processor three packed for the engine, and the gradients of the shards.
        let copies = match on {
            Arithmetic::OnProcessor => 5.0 + 3.0 + 3.0 + shard_count(cfg) as f64,
            Arithmetic::OnDevice => 5.0 + 3.0,
        };
        Self {
            trajectories: images * POSITION * positions,
            weights: NUMBER * copies * network.parameter_count() as f64,
            slots: 0.0,
        }
    }

    /// The same with what the slots need, each of them the most that a cloth of `set` takes.
    pub(crate) fn with_lanes(self, cfg: &TrainConfig, set: &TrainingSet, on: Arithmetic) -> Self {
        let of = |graph: &ClothGraph| {
            let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
            match on {
                Arithmetic::OnProcessor => of_slots(cfg, vertices, arcs),
                Arithmetic::OnDevice => of_sent_slots(cfg, vertices),
            }
        };
        Self {
            slots: set.graphs().map(of).fold(0.0, f64::max),
            ..self
        }
    }

    fn sum(self) -> f64 {
        self.trajectories + self.weights + self.slots
    }

    /// That so much is there.
    pub(crate) fn check(self, cfg: &TrainConfig) -> Result<(), MemoryError> {
        self.check_against(cfg, available_memory())
    }

    fn check_against(self, cfg: &TrainConfig, available: f64) -> Result<(), MemoryError> {
        if self.sum() <= available {
            return Ok(());
        }
        Err(MemoryError {
            needed: self,
            available,
            samples: cfg.batch.samples,
        })
    }
}

fn shard_count(cfg: &TrainConfig) -> usize {
    cfg.batch.samples.div_ceil(cfg.batch.shard)
}

/// What all slots need for a cloth of `vertices` and `arcs` [bytes].
fn of_slots(cfg: &TrainConfig, vertices: usize, arcs: usize) -> f64 {
    let (spec, unrolled) = (&cfg.model, cfg.unroll.most());
    let rows = |of_vertex: usize, of_arc: usize| {
        of_vertex as f64 * vertices as f64 + of_arc as f64 * arcs as f64
    };
    let kept = activations(spec);
    let activations = rows(kept.vertex as usize, kept.arc as usize);
    let features = spec.window() as f64 * rows(spec.node_width(), spec.edge_width());
    let outputs = 2.0 * 3.0 * vertices as f64;
    let history = POSITION * (spec.history() * vertices) as f64;
    let targets = 3.0 * EXACT_POSITION * vertices as f64;
    let shown = NUMBER * (activations + features + outputs) + history + targets;
    let samples = cfg.batch.samples as f64 * (shown + history);
    if unrolled == 1 {
        return samples;
    }
    // Every shard takes one slot at a time through its frames.
    let shards = shard_count(cfg) as f64;
    let by_position = history + POSITION * (unrolled * vertices) as f64;
    samples + shards * (unrolled as f64 * shown + NUMBER * features + by_position)
}

/// The same where a device takes them through the network: what they show, the predictions that come down, and
/// two copies of what goes up.
fn of_sent_slots(cfg: &TrainConfig, vertices: usize) -> f64 {
    let history = POSITION * (cfg.model.history() * vertices) as f64;
    let targets = 3.0 * EXACT_POSITION * vertices as f64;
    let sent = history.max(EXACT_POSITION * vertices as f64);
    let predicted = 2.0 * POSITION * vertices as f64;
    cfg.batch.samples as f64 * (2.0 * history + targets + predicted + 2.0 * sent)
}

/// What this program may take `[bytes]`: the machine's memory, or what the system allows of it.
#[must_use]
pub fn available_memory() -> f64 {
    let text = |path| std::fs::read_to_string(path).unwrap_or_default();
    let said = [
        machine(&text("/proc/meminfo")),
        address_space(&text("/proc/self/limits")),
        control_group(&text("/sys/fs/cgroup/memory.max")),
    ];
    said.into_iter()
        .flatten()
        .reduce(f64::min)
        .unwrap_or(FALLBACK)
}

/// Of a line as `MemTotal:  32768 kB`.
fn machine(text: &str) -> Option<f64> {
    let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
    let number: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1024.0 * number)
}

/// Of a line as `Max address space  8589934592  unlimited  bytes`: the first is the limit now.
fn address_space(text: &str) -> Option<f64> {
    let mut lines = text.lines();
    let rest = lines.find_map(|line| line.strip_prefix("Max address space"))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// A number, or `max`.
fn control_group(text: &str) -> Option<f64> {
    text.trim().parse().ok()
}

fn gib(bytes: f64) -> String {
    format!("{:.1} GiB", bytes / GIB)
}

#[cfg(test)]
mod tests;
