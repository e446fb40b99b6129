//! Dropout between the layers of the recurrent encoders, the same values as on the CPU.

use selvedge_model::{Connectivity, Dropout as CpuDropout};

use crate::kernels::layers::DROPOUT;
use crate::schedule::plan::Region;
use crate::schedule::{Argument, Schedule};

/// What is dropped: value `column` of a row in `step` has the number
/// (first + step apart) latent + column, which is added to the row's seed and hashed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Probability of a zero.
    pub rate: f64,
    /// For vertices and for arcs: of each row its first number, and how far those of its steps are
    /// apart, `[rows, 2]`.
    pub numbers: [Region; 2],
    /// For vertices and for arcs: the seed of each row, low half first, `[rows, 2]`.
    pub seeds: [Region; 2],
}

/// Numbers of the rows of vertices, and of those of arcs, for [`Dropout::numbers`]: a graph that goes through the
/// network on the CPU by itself drops by these. `steps` are frames of vertices and of arcs.
#[must_use]
pub fn dropout_numbers(graph: &Connectivity, steps: [usize; 2]) -> [Vec<u32>; 2] {
    graph.dropout_rows(steps).map(|rows| rows.concat())
}

/// The seed of every row of vertices, and that of every row of arcs, for [`Dropout::seeds`].
#[must_use]
pub fn dropout_seeds(dropout: CpuDropout) -> [[u32; 2]; 2] {
    let halves = |seed: u64| [seed as u32, (seed >> 32) as u32];
    dropout.seeds().map(halves)
}

/// Multiplies rows of vertices (`kind` 0) or arcs (1) by their mask of a step, from the first of `rows`
/// to the second.
pub(super) fn drop_out(
    schedule: &mut Schedule,
    dropout: &Dropout,
    (kind, step): (usize, usize),
    rows: [Region; 2],
) {
    // As selvedge_model reckons them.
    let scale = (1.0 / (1.0 - dropout.rate)) as f32;
    let threshold = (dropout.rate * (1_u64 << 32) as f64) as u32;
    schedule.launch(
        &DROPOUT,
        dropout.numbers[kind].count() / 2,
        &[
            rows[0].into(),
            rows[1].into(),
            dropout.numbers[kind].into(),
            dropout.seeds[kind].into(),
            Argument::Count(step as u32),
            Argument::Count(threshold),
            Argument::Number(scale),
        ],
    );
}
