//! How much memory a training needs, estimated before it is taken: what does not fit is an error
//! that names its causes, not a program that the system ends.

use selvedge_data::{Dataset, Split};
use selvedge_model::Network;
use thiserror::Error;

use crate::config::TrainConfig;

const GIB: f64 = (1_u64 << 30) as f64;
/// Taken for the machine's memory where the system does not say [bytes].
const FALLBACK: f64 = 64.0 * GIB;
/// Of a number in `f32` [bytes].
const NUMBER: f64 = 4.0;
/// Arcs of a vertex, about: six edges meet in most.
const ARCS: f64 = 6.0;

/// A training that does not fit into memory.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "the training needs about {} of memory ({} for {samples} samples per step, {} for the weights and what goes with them, {} for the trajectories), but there are {}: lower batch.samples, unroll.frames, model.latent, model.blocks or the window, raise the micro-batch, or take a smaller data set",
    gib(slots + weights + trajectories), gib(*slots), gib(*weights), gib(*trajectories), gib(*available)
)]
pub struct MemoryError {
    slots: f64,
    weights: f64,
    trajectories: f64,
    available: f64,
    samples: usize,
}

/// Checks that there is enough memory for a training with so many slots in a micro-batch on this
/// machine's processor; a device estimates its own memory by itself.
pub(crate) fn check_memory(
    cfg: &TrainConfig,
    network: &Network,
    dataset: &Dataset,
    micro_batch: Option<usize>,
) -> Result<(), MemoryError> {
    let entries = || dataset.entries(Split::Train).iter();
    let positions: f64 = entries().map(|e| e.frames as f64 * e.vertices as f64).sum();
    let largest = entries().map(|e| e.vertices).max().unwrap_or(0);
    let samples = cfg.batch.samples;
    let micro_batches = micro_batch.map_or(0, |size| samples.div_ceil(size));
    let slots = micro_batch.map_or(0.0, |_| of_slots(cfg, micro_batches, largest));
    // Weights, their mean, their gradient and two moments, three where a checkpoint is written and
    // three that are packed; and the gradients of the micro-batches.
    let need = MemoryError {
        slots,
        weights: NUMBER * (11 + micro_batches) as f64 * network.parameter_count() as f64,
        trajectories: 3.0 * NUMBER * positions,
        available: available_memory(),
        samples,
    };
    if need.slots + need.weights + need.trajectories <= need.available {
        Ok(())
    } else {
        Err(need)
    }
}

/// Bytes of the activations and the features of all slots, each of a cloth of `vertices`. In a step
/// of several frames every micro-batch takes one slot at a time through all of them.
fn of_slots(cfg: &TrainConfig, micro_batches: usize, vertices: usize) -> f64 {
    let (spec, frames) = (&cfg.model, cfg.unroll.most());
    let (latent, blocks, window) = (spec.latent, spec.blocks, spec.window());
    // Two hidden layers and the output of a perceptron; states and gates of two recurrent layers.
    let encoder = if spec.encoder.is_recurrent() { 11 * window * latent } else { 3 * latent };
    let of_vertex = encoder + (7 + 5 * blocks) * latent + window * spec.node_width();
    let of_arc = encoder + (2 + 4 * blocks) * latent + window * spec.edge_width();
    let kept = NUMBER * vertices as f64 * (of_vertex as f64 + ARCS * of_arc as f64);
    match frames {
        1 => cfg.batch.samples as f64 * kept,
        _ => (micro_batches * frames) as f64 * kept,
    }
}

/// Memory for this program `[bytes]`: the least of the machine's, that of the control group and the
/// limit of the address space (Linux).
fn available_memory() -> f64 {
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
mod tests {
    use selvedge_model::Encoder;

    use super::*;
    use crate::test_data::{ENGINE, config, through, two_cloths};
    use crate::trainer::{TrainError, Trainer};

    #[test]
    fn a_training_that_no_machine_has_room_for_is_an_error() {
        let data = two_cloths();
        // Numbers within their own bounds: petabytes of weights, or of frames to learn through.
        for (latent, blocks, frames) in [(4096, 256, 1), (1024, 100, 1000)] {
            let mut cfg = through(frames, config(Encoder::MLP));
            cfg.model.latent = latent;
            cfg.model.blocks = blocks;
            cfg.batch.samples = 65_536;
            let error = Trainer::new(cfg, &data.dataset, &ENGINE);
            let error = error.err().expect("too much");
            assert!(matches!(error, TrainError::Memory(_)), "{error}");
            let text = error.to_string();
            for words in [
                "GiB of memory",
                "for 65536 samples per step",
                "lower batch.samples",
            ] {
                assert!(text.contains(words), "{text}");
            }
        }
    }

    #[test]
    fn the_least_that_the_system_says_counts() {
        let text = "MemFree:  1 kB\nMemTotal:       32768 kB\n";
        assert_eq!(machine(text), Some(32.0 * 1024.0 * 1024.0));
        let limits = "Limit  Soft Limit  Hard Limit  Units\nMax address space  8589934592  unlimited  bytes\n";
        assert_eq!(address_space(limits), Some(8.0 * GIB));
        let limits = limits.replace("8589934592", "unlimited");
        assert_eq!(address_space(&limits), None);
        assert_eq!(control_group("1073741824\n"), Some(GIB));
        assert_eq!(control_group("max\n"), None);
        let none = [machine(""), address_space(""), control_group("")];
        assert_eq!(none, [None; 3]);
        assert!(available_memory() > 0.0);
    }
}
