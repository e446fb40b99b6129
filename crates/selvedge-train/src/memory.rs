//! How much memory a training needs, reckoned before it is taken: what does not fit is an error
//! that names its causes, not a program that the system ends.
//!
//! Reckoned are the trajectories, the weights with their moments, the gradient of every
//! micro-batch, and the activations that every sample of a batch keeps; the rest is small. A device
//! with memory of its own holds gradients and activations and reckons for itself; here are the
//! positions that go up, and copies of them for the transfer.
//!
//! The memory that is there is the least of the machine's memory, that of the control group and the
//! limit of the address space (Linux), or [`FALLBACK`] where the system names none.

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

/// The machine that does the arithmetic of a training and whose memory that takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    /// This machine's processor.
    OnProcessor {
        /// Slots that go through the network together.
        micro_batch: usize,
    },
    /// A device with memory of its own.
    OnDevice,
}

/// A training that does not fit into memory.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "the training needs about {} of memory ({} for {samples} samples per step, {} for the weights and what goes with them, {} for the trajectories), but there are {}: lower batch.samples, unroll.frames, model.latent, model.blocks or the window, raise the micro-batch, or take a smaller data set",
    gib(needed.sum()), gib(needed.slots), gib(needed.weights), gib(needed.trajectories), gib(*available)
)]
pub struct MemoryError {
    needed: Need,
    available: f64,
    samples: usize,
}

/// Bytes that a training needs, by purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Need {
    trajectories: f64,
    weights: f64,
    slots: f64,
}

impl Need {
    /// The need as far as it is known before the data are read.
    pub(crate) fn before_reading(
        cfg: &TrainConfig,
        network: &Network,
        dataset: &Dataset,
        on: Arithmetic,
    ) -> Self {
        let entries = dataset.entries(Split::Train).iter();
        let positions: f64 = entries.map(|e| e.frames as f64 * e.vertices as f64).sum();
        // Weights, their mean, their gradient and two moments, and three where a checkpoint is
        // written; on the processor three packed for the engine, and the gradients of the
        // micro-batches.
        let copies = match on {
            Arithmetic::OnProcessor { micro_batch } => {
                5.0 + 3.0 + 3.0 + cfg.batch.samples.div_ceil(micro_batch) as f64
            }
            Arithmetic::OnDevice => 5.0 + 3.0,
        };
        Self {
            trajectories: POSITION * positions,
            weights: NUMBER * copies * network.parameter_count() as f64,
            slots: 0.0,
        }
    }

    /// The same with what the slots need, each of them the most that a cloth of `set` takes.
    pub(crate) fn with_slots(self, cfg: &TrainConfig, set: &TrainingSet, on: Arithmetic) -> Self {
        let of = |graph: &ClothGraph| {
            let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
            match on {
                Arithmetic::OnProcessor { micro_batch } => {
                    of_slots(cfg, micro_batch, vertices, arcs)
                }
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

    /// Checks that so much is there.
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

/// Bytes that all slots need for a cloth of `vertices` and `arcs`.
fn of_slots(cfg: &TrainConfig, micro_batch: usize, vertices: usize, arcs: usize) -> f64 {
    let (spec, unrolled) = (&cfg.model, cfg.unroll.most());
    let rows = |of_vertex: usize, of_arc: usize| {
        of_vertex as f64 * vertices as f64 + of_arc as f64 * arcs as f64
    };
    let kept = activations(spec);
    let activations = rows(kept.vertex as usize, kept.arc as usize);
    let features = spec.window() as f64 * rows(spec.node_width(), spec.edge_width());
    let outputs = 2.0 * 3.0 * vertices as f64;
    let history = POSITION * (spec.history() * vertices) as f64;
    let sample = history + of_targets(vertices);
    let shown = NUMBER * (activations + features + outputs) + sample;
    let samples = cfg.batch.samples as f64 * (shown + sample + history);
    if unrolled == 1 {
        return samples;
    }
    // Every micro-batch takes one slot at a time through its frames.
    let micro_batches = cfg.batch.samples.div_ceil(micro_batch) as f64;
    let by_position = history + POSITION * (unrolled * vertices) as f64;
    samples + micro_batches * (unrolled as f64 * shown + NUMBER * features + by_position)
}

/// Bytes of a sample's reference, in `f32`, and of its three local frames.
fn of_targets(vertices: usize) -> f64 {
    (POSITION + 3.0 * EXACT_POSITION) * vertices as f64
}

/// The same where a device takes them through the network: their samples, the predictions that come
/// down, and two copies of what goes up.
fn of_sent_slots(cfg: &TrainConfig, vertices: usize) -> f64 {
    let history = POSITION * (cfg.model.history() * vertices) as f64;
    let targets = of_targets(vertices);
    let sent = history.max(EXACT_POSITION * vertices as f64);
    let predicted = 2.0 * POSITION * vertices as f64;
    cfg.batch.samples as f64 * (2.0 * history + targets + predicted + 2.0 * sent)
}

/// Memory for this program `[bytes]`: the machine's, or the part that the system allows.
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

/// Bytes of a line as `MemTotal:  32768 kB`.
fn machine(text: &str) -> Option<f64> {
    let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
    let number: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1024.0 * number)
}

/// Bytes of a line as `Max address space  8589934592  unlimited  bytes`: the first is the limit
/// now.
fn address_space(text: &str) -> Option<f64> {
    let mut lines = text.lines();
    let rest = lines.find_map(|line| line.strip_prefix("Max address space"))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Bytes of the text of a number; nothing of `max`.
fn control_group(text: &str) -> Option<f64> {
    text.trim().parse().ok()
}

fn gib(bytes: f64) -> String {
    format!("{:.1} GiB", bytes / GIB)
}

#[cfg(test)]
mod tests;
